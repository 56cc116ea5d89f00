#pragma once

#include <filesystem>
#include <fstream>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include <gtest/gtest.h>
#include <httplib.h>

#include "base/time_text.h"
#include "console/console.h"
#include "diagnosis/decision/valve_engine.h"
#include "storage/models/models.h"
#include "tests/monitor/linear_models.h"
#include "tests/storage/history_fixture.h"

namespace fdi::console {

/// The secret of the proxy, which the tests play.
inline constexpr const char* kSecret = "0123456789abcdef0123456789abcdef";

inline httplib::Headers ProxyHeaders(const std::string& user,
                                     const std::string& role) {
  return {{"X-FDI-Secret", kSecret},
          {"X-FDI-User", user},
          {"X-FDI-Role", role},
          {"X-Real-IP", "10.1.2.3"}};
}

/// The console over real HTTP, beside a history, without a pipeline.
class ConsoleRoutesTest : public storage::HistoryFixture {
 protected:
  ConsoleRoutesTest() : writer_(path_) {
    writer_.BeginSession(kDetected - kSecond, "test", "");
    const auto folder = directory_.path() / "page";
    std::filesystem::create_directory(folder);
    std::ofstream(folder / "index.html") << "<title>page</title>";
    std::ofstream(directory_.path() / "secret.txt") << "secret";
    storage::ModelStore(directory_.path() / "models.db",
                        storage::Access::kOccasionalWriter);
  }

  std::filesystem::path WriteSecret(const std::string& text = kSecret) const {
    const auto file = directory_.path() / "proxy-secret";
    std::ofstream(file) << text << "\n";
    std::filesystem::permissions(file, std::filesystem::perms(0640));
    return file;
  }
  /// Behind a proxy, which names the engineer anna.
  void Start() {
    Start(WriteSecret());
    client_->set_default_headers(ProxyHeaders("anna", "engineer"));
  }
  /// @param secret file of the proxy's secret; empty: no proxy.
  void Start(const std::filesystem::path& secret) {
    ConsoleOptions options;
    options.address.host = "127.0.0.1";
    options.files = directory_.path() / "page";
    options.proxy_secret = secret;
    console_.emplace(options, report::GlobalOptions{},
                     [this](LogLevel, std::string_view line) {
                       const std::lock_guard lock(log_mutex_);
                       log_.append(line).append("\n");
                     });
    console_->Start({path_, directory_.path() / "models.db", "0.0", kDetected,
                     [] {
                       return MonitorFacts{"OK", {{"received", 7}}, 1};
                     },
                     NowNs});
    const std::string log = TakeLog();
    const std::size_t line = log.find("console_listening");
    port_ = std::stoi(log.substr(log.find(':', line) + 1));
    client_.emplace("127.0.0.1", port_);
  }

  /// Begins an episode so many seconds after the others.
  void RecordLater(const std::string& valve, double after_s) {
    FaultEvent event = Event(TransitionKind::kDetected, after_s, 0, 0.3,
                             EndReason::kNone, valve);
    event.transition.detection_stamp_ns = event.transition.stamp_ns;
    writer_.Record(event, kDetected);
  }

  void ShowValve(const std::string& id, int samples, double offset = 0.0) {
    const auto models = monitor::SharedLinearModels();
    ValveEngine engine(models);
    for (int k = 0; k < samples; ++k) {
      const Sample sample = monitor::PlantSample(static_cast<std::uint64_t>(k),
                                                 k < 50 ? 0.0 : offset);
      console_->live().OnVerdict(id, sample,
                                 {engine.Step(sample), models.get(), false});
    }
  }

  Json Get(const std::string& path, int status = 200) {
    const httplib::Result answer = client_->Get(path);
    EXPECT_TRUE(answer) << path;
    if (!answer) {
      return {};
    }
    EXPECT_EQ(answer->status, status) << path << answer->body;
    return Json::parse(answer->body);
  }
  /// By whom `body` names, else by anna.
  Json Post(const std::string& path, const Json& body, int status = 200) {
    const std::string who =
        body.is_object() ? body.value("who", "anna") : "anna";
    httplib::Client client("127.0.0.1", port_);
    httplib::Headers headers = ProxyHeaders(who, "engineer");
    headers.emplace("Origin", Origin());
    const httplib::Result answer =
        client.Post(path, headers, body.dump(), "application/json");
    EXPECT_TRUE(answer) << path;
    if (!answer) {
      return {};
    }
    EXPECT_EQ(answer->status, status) << path << answer->body;
    return Json::parse(answer->body);
  }
  std::string Origin() const {
    return "http://127.0.0.1:" + std::to_string(port_);
  }
  /// The log since this was called last.
  std::string TakeLog() {
    const std::lock_guard lock(log_mutex_);
    return std::exchange(log_, {});
  }
  std::string IdText() const { return storage::EpisodeIdText(Id()); }

  storage::HistoryWriter writer_;
  std::optional<Console> console_;
  std::mutex log_mutex_;
  std::string log_;
  int port_{0};
  std::optional<httplib::Client> client_;
};

}  // namespace fdi::console
