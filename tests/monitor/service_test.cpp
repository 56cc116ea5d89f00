#include "monitor/service/service.h"

#include <chrono>
#include <csignal>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "monitor/bus/bus_valve_states.h"
#include "report/shared_files.h"
#include "storage/history/history_database.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "tests/idl/test_domain.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"
#include "tests/monitor/test_support.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

// The service in this process, over DDS on loopback.
class ServiceTest : public testing::Test {
 protected:
  ServiceTest() {
    global_.data_dir = directory_.path() / "data";
    global_.domain = domain_.id();
  }
  report::Context Context(const std::string& software = "fdi-test 1.0") {
    return {global_,
            [this](LogLevel, std::string_view line) {
              notice_.Apply([&] { lines_.emplace_back(line); });
            },
            software, "fdi-monitor run"};
  }
  std::size_t Count(std::string_view event) const {
    std::size_t count = 0;
    for (const std::string& line : lines_) {
      count += line.starts_with(event) ? 1U : 0U;
    }
    return count;
  }
  // Behind the back of the service.
  static void Execute(const std::filesystem::path& path,
                      const storage::Schema& schema, std::string_view sql) {
    storage::Database database(path, schema,
                               storage::Access::kOccasionalWriter);
    storage::Transaction transaction(database);
    database.Run(sql);
    transaction.Commit();
  }

  storage::TemporaryDirectory directory_;
  const idl::TestDomain domain_;
  report::GlobalOptions global_;
  Notice notice_;
  std::vector<std::string> lines_;
};

// The bus takes no text of more than 64 bytes: publishing the status throws. It
// is not needed to serve, and only the last one is an error of the session.
TEST_F(ServiceTest, AStatusThatFailsStopsNothingAndTheSessionEndsInOrder) {
  const report::Context context = Context(std::string(100, 's'));
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  ServiceOptions options;
  options.status_period_s = 0.0;  // A line in the log after each status.
  Service service(options, context);
  std::thread driver([&] {
    EXPECT_TRUE(notice_.Await([&] {
      return Count("part_failed id=M155 part=status") == 1 &&
             Count("monitor_status") > 0;
    }));
    kill(getpid(), SIGTERM);
  });

  EXPECT_THROW(service.Run(signals), DataError);

  driver.join();
  EXPECT_EQ(Count("monitor_stopping"), 1U);
  EXPECT_EQ(Count("monitor_stopped"), 1U);
  HistoryStore(global_.data_dir / "history.db", NowNs, context.log)
      .BeginSession("test", "");
  EXPECT_THAT(lines_, Not(Contains(StartsWith("session_died"))));
}

// The next start would take its session for one that died.
TEST_F(ServiceTest, AnErrorInTheOptionsLeavesNoTraceInTheHistory) {
  ServiceOptions options;
  options.pipeline.valve_glob = std::string(300, 'V');

  EXPECT_THROW(Service(options, Context()), ConfigError);

  storage::HistoryReader history(global_.data_dir / "history.db");
  EXPECT_TRUE(history.Sessions().empty());
}

// The folder may be one that was not meant.
TEST_F(ServiceTest, AFolderThatHadToBeMadeIsSaidOnce) {
  global_.data_dir = directory_.path() / "mistyped";
  ServiceOptions options;
  options.pipeline.valve_glob = std::string(300, 'V');

  EXPECT_THROW(Service(options, Context()), ConfigError);
  EXPECT_EQ(Count("data_folder_made path=" + global_.data_dir.string()), 1U);
  EXPECT_THROW(Service(options, Context()), ConfigError);
  EXPECT_EQ(Count("data_folder_made"), 1U);
}

// Says what the service does with it.
class TalkingPart : public ServicePart {
 public:
  explicit TalkingPart(std::string& said) : said_(said) {}
  std::string_view name() const override { return "talking"; }
  void Start(const PartContext& context) override {
    said_ += "start " + context.software + ", ";
  }
  void OnAssigned(const std::vector<std::string>& valves) override {
    said_ += std::to_string(valves.size()) + " assigned, ";
  }
  void OnCommitted(const FaultEvent& /*event*/, bool /*stored*/) override {}
  void Leave() override { said_ += "leave, "; }
  void Stop() override { said_ += "stop, "; }
  void Close() override { said_ += "close"; }

 private:
  std::string& said_;
};

TEST_F(ServiceTest, AnErrorAtTheStartEndsItsParts) {
  std::string said;
  ServiceOptions options;
  options.parts.push_back(std::make_shared<TalkingPart>(said));
  const report::Context context = Context();
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  Service service(options, context);
  Execute(global_.data_dir / "history.db", storage::HistorySchema(),
          "DROP TABLE event_outbox");

  EXPECT_THROW(service.Run(signals), std::exception);

  EXPECT_EQ(said, "start fdi-test 1.0, 0 assigned, leave, stop, close");
  EXPECT_EQ(Count("monitor_stopped"), 1U);
}

// As if another program had written the row.
TEST_F(ServiceTest, AnEventThatCannotBeSentAgainDoesNotEndTheService) {
  const ModelSet models = LinearModels();
  std::filesystem::create_directory(global_.data_dir);
  {
    HistoryStore history(global_.data_dir / "history.db", NowNs, Context().log);
    history.BeginSession("test", "");
    for (const auto& valve : {"V1", "V2"}) {
      FaultEvent event;
      event.valve_id = valve;
      event.episode_id = EpisodeId(valve, 1, 5);
      event.transition.detection_stamp_ns = event.transition.stamp_ns = 5;
      event.candidates = {{7, 0.5, 0.5, false}};
      event.models = {std::shared_ptr<void>(), &models};
      history.CommitBatch([&] { history.Record(event); });
    }
    history.EndSession();
  }
  Execute(global_.data_dir / "history.db", storage::HistorySchema(),
          "UPDATE event_outbox SET candidates = '999:0.5:0.5:0' "
          "WHERE event_id = (SELECT min(event_id) FROM event_outbox)");
  const report::Context context = Context();
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  ServiceOptions options;
  options.status_period_s = 0.0;
  Service service(options, context);
  std::thread driver([&] {
    EXPECT_TRUE(notice_.Await([&] { return Count("monitor_status") > 0; }));
    kill(getpid(), SIGTERM);
  });

  EXPECT_EQ(service.Run(signals), report::kExitOk);

  driver.join();
  EXPECT_EQ(Count("part_failed id=M155 part=bus"), 1U);
  EXPECT_THAT(lines_,
              Contains(testing::AllOf(testing::HasSubstr("events_resent=1"),
                                      testing::HasSubstr("events_unsent=1"))));
}

// Who asks for a reload wants to know, however often.
TEST_F(ServiceTest, EveryReloadThatFailsIsALineOfTheLog) {
  const report::Context context = Context();
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  Service service({}, context);
  Execute(global_.data_dir / "models.db", storage::ModelsSchema(),
          "DROP TABLE valve");
  std::thread driver([&] {
    for (std::size_t reload = 1; reload <= 3; ++reload) {
      kill(getpid(), SIGHUP);
      EXPECT_TRUE(notice_.Await(
          [&] { return Count("reload_failed id=M112") >= reload; }));
    }
    kill(getpid(), SIGTERM);
  });

  EXPECT_EQ(service.Run(signals), 0);

  driver.join();
}

// A change is not made twice because the file could not be read once.
// Meanwhile nobody is told every few seconds of sets that are not in use.
TEST_F(ServiceTest, AReloadThatFailedIsTriedAgain) {
  const std::filesystem::path models = global_.data_dir / "models.db";
  std::filesystem::create_directory(global_.data_dir);
  {
    storage::ModelStore store(models, storage::Access::kOccasionalWriter);
    for (const char* name : {"first", "second"}) {
      ModelSet set = LinearModels();
      set.name = name;
      store.Save(set);
      store.AssignModelSet(name, storage::ModelReference{name, 1});
    }
  }
  const report::Context context = Context();
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  Service service({}, context);
  const auto rename = [&](const std::string& from, const std::string& to) {
    Execute(
        models, storage::ModelsSchema(),
        "UPDATE model_set SET name = '" + to + "' WHERE name = '" + from + "'");
  };
  rename("second", "away");
  std::thread driver([&] {
    kill(getpid(), SIGHUP);
    EXPECT_TRUE(notice_.Await([&] { return Count("models_unreadable") == 1; }));
    rename("away", "second");
    EXPECT_TRUE(
        notice_.Await([&] { return Count("models_reload cause=retry") == 1; }));
    kill(getpid(), SIGTERM);
  });

  EXPECT_EQ(service.Run(signals), 0);

  driver.join();
  EXPECT_EQ(Count("reload_failed id=M112"), 1U);
  // At the start, by the reload and by the second retry.
  EXPECT_EQ(Count("models_loaded model_set=first@1"), 3U);
}

// It must not end the monitor at each start, either.
TEST_F(ServiceTest, ADamagedHourEndsNoBudget) {
  std::filesystem::create_directories(global_.data_dir);
  Execute(global_.data_dir / "history.db", storage::HistorySchema(),
          "INSERT INTO health_hour VALUES ('V1', 1, 1, 0, 0, x'FF')");
  const report::Context context = Context();
  report::StopSignals signals(report::StopSignals::HangUp::kReload);
  ServiceOptions options;
  options.alarm_budget = "1/day";
  options.on_ready = [] { kill(getpid(), SIGTERM); };

  EXPECT_EQ(Service(options, context).Run(signals), 0);

  EXPECT_EQ(Count("hours_damaged valve=V1"), 1U);
  EXPECT_EQ(Count("part_failed"), 0U);
}

// An alarm whose data ended stands beside a notice, and ends once the valve is
// normal.
TEST(BusValveStatesTest, ANoticeTakesThePlaceOfNoAlarm) {
  const idl::TestDomain domain;
  idl::DdsOptions dds;
  dds.domain = domain.id();
  idl::Participant participant(dds);
  BusValveStates states(participant, "monitor",
                        report::FaultTexts(report::SharedFile("faults.toml")));
  FaultEvent event;
  event.valve_id = "V1";
  event.episode_id = 1;
  event.transition.kind = TransitionKind::kClosed;
  event.transition.reason = EndReason::kStreamEnded;
  event.transition.stamp_ns = 1;
  states.OnEvent(event);
  ASSERT_THAT(states.Unconfirmed(), ElementsAre(1U));

  FaultEvent notice = event;
  notice.episode_id = 2;
  notice.transition.kind = TransitionKind::kDetected;
  notice.transition.notice = true;
  notice.transition.stamp_ns = 2;
  Verdict verdict;
  verdict.detected = true;
  verdict.stamp_ns = 2;
  ValveOutcome outcome{verdict, nullptr, false};
  outcome.notice = true;
  states.OnVerdict("V1", {}, outcome);
  states.OnEvent(notice);
  EXPECT_THAT(states.Unconfirmed(), ElementsAre(1U));

  verdict.detected = outcome.notice = false;
  verdict.stamp_ns = 3;
  outcome.found_normal = true;
  states.OnVerdict("V1", {}, outcome);
  EXPECT_THAT(states.Unconfirmed(), IsEmpty());
}

// The audit found that the rod sticks; the episode that took over from it
// names the flow transmitter. Whoever reads the bus hears of the contradiction.
TEST(BusValveStatesTest, ANameThatTheAuditContradictsIsOneOfSeveral) {
  const idl::TestDomain domain;
  idl::DdsOptions dds;
  dds.domain = domain.id();
  idl::Participant participant(dds);
  BusValveStates states(participant, "monitor",
                        report::FaultTexts(report::SharedFile("faults.toml")));
  idl::Subscriber<idl::ValveStateMessage> reader(participant);
  constexpr std::chrono::seconds kPatience(30);
  ASSERT_TRUE(reader.WaitForWriters(1, kPatience));
  // The certainty that is told of `episode_id` once `event` has come.
  const auto told_after = [&](const FaultEvent& event) {
    states.OnEvent(event);
    std::string certainty;
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (certainty.empty() && std::chrono::steady_clock::now() < end) {
      reader.Take({[&](const idl::ValveStateMessage& state, const auto&) {
                     if (state.episode_id == event.episode_id) {
                       certainty = state.certainty;
                     }
                   },
                   {}},
                  std::chrono::milliseconds(100));
    }
    return certainty;
  };
  FaultEvent event;
  event.valve_id = "V1";
  event.episode_id = 1;
  event.candidates = {{19, 0.95, 0.5, true}};
  event.transition.kind = TransitionKind::kIsolated;
  event.transition.stamp_ns = 1;
  event.transition.factor = 0.95;
  event.transition.strength = 0.5;
  EXPECT_EQ(told_after(event), "sure");

  FaultEvent audit = event;
  audit.episode_id = 2;
  audit.candidates = {{kStiction, 0.0, 0.0, true}};
  audit.transition.kind = TransitionKind::kClosed;
  audit.transition.reason = EndReason::kSuperseded;
  audit.transition.layer = Layer::kAudit;
  states.OnEvent(audit);
  event.episode_id = 3;
  EXPECT_EQ(told_after(event), "one of");
}

}  // namespace
}  // namespace fdi::monitor
