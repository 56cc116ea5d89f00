#include "console/console_part.h"

#include <algorithm>
#include <fstream>
#include <mutex>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "monitor/service/service.h"
#include "storage/history/history_database.h"
#include "storage/history/history_writer.h"
#include "storage/models/models.h"
#include "tests/idl/test_domain.h"
#include "tests/monitor/test_support.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::console {
namespace {

class ConsolePartTest : public testing::Test {
 protected:
  ConsolePartTest() {
    std::filesystem::create_directories(page());
    std::ofstream(page() / "index.html") << "<html></html>";
    global_.domain = domain_.id();
  }
  std::filesystem::path page() const { return directory_.path() / "page"; }
  std::shared_ptr<ConsolePart> Part() {
    ConsoleOptions options;
    options.address.host = "127.0.0.1";
    options.files = page();
    return std::make_shared<ConsolePart>(options, "*", global_, log_);
  }
  std::size_t Count(std::string_view event) {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(std::ranges::count_if(
        lines_,
        [&](const std::string& line) { return line.starts_with(event); }));
  }

  const idl::TestDomain domain_;
  const storage::TemporaryDirectory directory_;
  report::GlobalOptions global_;
  std::mutex mutex_;
  std::vector<std::string> lines_;
  const LogSink log_{[this](LogLevel, std::string_view line) {
    const std::lock_guard lock(mutex_);
    lines_.emplace_back(line);
  }};
};

// Twice, as the first participant may leave threads of the library behind.
TEST_F(ConsolePartTest, AnErrorAtTheStartOfTheServiceLeavesNoThread) {
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  std::size_t threads_left = 0;
  for (const char* data : {"first", "second"}) {
    global_.data_dir = directory_.path() / data;
    const report::Context context{global_, log_, "fdi-test 1.0",
                                  "fdi-monitor run"};
    threads_left = monitor::ThreadCount();
    monitor::ServiceOptions options;
    options.parts.push_back(Part());
    monitor::Service service(options, context);
    {
      storage::Database database(global_.data_dir / "history.db",
                                 storage::HistorySchema(),
                                 storage::Access::kOccasionalWriter);
      storage::Transaction transaction(database);
      database.Run("DROP TABLE event_outbox");
      transaction.Commit();
    }

    EXPECT_THROW(service.Run(signals), std::exception);
  }
  EXPECT_EQ(Count("console_listening"), 2U);
  EXPECT_EQ(Count("monitor_stopped"), 2U);
  EXPECT_EQ(monitor::ThreadCount(), threads_left);
}

TEST_F(ConsolePartTest, ValvesThatOughtToBeThereAreListed) {
  global_.data_dir = directory_.path() / "data";
  storage::DataDirectory data{global_.data_dir};
  storage::EnsureExists(data);
  storage::ModelStore(data.models(), storage::Access::kOccasionalWriter);
  storage::HistoryWriter history(data.history());
  const auto part = Part();
  constexpr std::int64_t kDayNs = 86'400'000'000'000;
  monitor::PartContext context;
  context.data = data;
  context.log = log_;
  context.facts = [] { return MonitorFacts{"OK", {}, 0}; };
  context.seen = {{"OLD", 1 * kDayNs}, {"NEW", 60 * kDayNs}};
  part->Start(context);
  part->OnAssigned({"GIVEN"});
  monitor::Exposition page;
  part->AddMetrics(page);
  part->Leave();
  part->Close();

  auto* const board = dynamic_cast<LiveBoard*>(part->listener());
  ASSERT_NE(board, nullptr);
  std::vector<std::string> valves;
  for (const ValveState& valve : board->Valves(false)) {
    valves.push_back(valve.id);
  }
  EXPECT_THAT(valves, testing::UnorderedElementsAre("NEW", "GIVEN"));
  EXPECT_THAT(page.text(), testing::HasSubstr("fdi_console_streams 0\n"));
}

}  // namespace
}  // namespace fdi::console
