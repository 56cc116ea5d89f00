// /metrics, /healthz and /readyz of the built fdi-monitor, over real HTTP.

#include <regex>
#include <set>
#include <sstream>

#include <gmock/gmock.h>
#include <httplib.h>

#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;

class ProbesTest : public MonitorFixture {
 protected:
  std::unique_ptr<ChildProcess> StartWithHttp(
      std::vector<std::string> arguments = {}) {
    arguments.emplace_back("--http=127.0.0.1:0");
    auto monitor = StartMonitor(arguments);
    std::smatch address;
    const std::regex pattern("http_listening address=127.0.0.1:([0-9]+)");
    EXPECT_TRUE(std::regex_search(monitor->errors(), address, pattern));
    port_ = std::stoi(address[1]);
    return monitor;
  }

  httplib::Result Get(const std::string& path) const {
    httplib::Client client("127.0.0.1", port_);
    client.set_read_timeout(10);
    return client.Get(path);
  }

  /// From "name" or "name{label="value"}" to what stands behind it.
  std::map<std::string, double> Scrape() const {
    const httplib::Result answer = Get("/metrics");
    std::map<std::string, double> values;
    if (!answer || answer->status != 200) {
      return values;
    }
    std::istringstream lines(answer->body);
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with("#")) {
        const std::size_t blank = line.rfind(' ');
        values[line.substr(0, blank)] = std::stod(line.substr(blank + 1));
      }
    }
    return values;
  }

  int port_{0};
};

// The text format, version 0.0.4: every value belongs to the family begun
// last, each of them with help and type, none of them twice.
void ExpectExposition(const std::string& page) {
  const std::regex value(
      R"re(([a-z_]+)(\{[a-z_]+="[^"\\]*"\})? -?[0-9][0-9.e+-]*)re");
  std::set<std::string> families;
  std::set<std::string> seen;
  std::string family;
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string hash;
    std::string keyword;
    std::string type;
    std::smatch parts;
    if (line.starts_with("# HELP ")) {
      words >> hash >> keyword >> family;
      EXPECT_TRUE(families.insert(family).second) << line;
      std::getline(lines, line);
      std::istringstream next(line);
      std::string name;
      next >> hash >> keyword >> name >> type;
      EXPECT_EQ(keyword, "TYPE") << line;
      EXPECT_EQ(name, family) << line;
      EXPECT_EQ(type == "counter", family.ends_with("_total")) << line;
    } else {
      ASSERT_TRUE(std::regex_match(line, parts, value)) << line;
      EXPECT_EQ(parts[1], family) << line;
      EXPECT_TRUE(seen.insert(line.substr(0, line.rfind(' '))).second) << line;
    }
  }
  EXPECT_GT(families.size(), 40U);
}

TEST_F(ProbesTest, MetricsParseAndAgreeWithTheStatusOnTheBus) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartWithHttp({"--record", "--valve", "V1"});
  Publish(0, 40);
  Publish(BadSample(40));
  Publish(PlantSample(7));
  Publish(PlantSample(0), "V2");
  Publish(41, 80, kF7Offset);
  ASSERT_TRUE(AwaitEvent(TransitionKind::kIsolated)) << monitor->errors();
  ASSERT_TRUE(Await([this] {
    return counters_["received"] == 82 && counters_["recorded"] == 81 &&
           counters_["open_episodes"] == 1;
  }));

  ExpectExposition(Get("/metrics")->body);
  std::map<std::string, double> metrics = Scrape();
  const std::map<std::string, std::string> names{
      {"received", "fdi_samples_received_total"},
      {"diagnosed", "fdi_samples_diagnosed_total"},
      {"filtered_samples", R"(fdi_samples_excluded_total{reason="filtered"})"},
      {"not_finite", R"(fdi_samples_judged_total{verdict="not_finite"})"},
      {"late", R"(fdi_samples_judged_total{verdict="late"})"},
      {"accepted", R"(fdi_samples_judged_total{verdict="accepted"})"},
      {"samples_live", R"(fdi_sample_periods_total{quality="live"})"},
      {"decisions", "fdi_decision_vectors_total"},
      {"events", "fdi_fault_events_total"},
      {"recorded", "fdi_samples_recorded_total"},
      {"valves", "fdi_valves"},
      {"open_episodes", "fdi_open_episodes"}};
  for (const auto& [counter, metric] : names) {
    ASSERT_TRUE(metrics.contains(metric)) << metric;
    EXPECT_EQ(metrics[metric], static_cast<double>(counters_[counter]))
        << metric;
    EXPECT_GT(metrics[metric], 0.0) << metric;
  }
  EXPECT_EQ(metrics[R"(fdi_dds_publishers{state="matched"})"], 1.0);
  EXPECT_GT(metrics[R"(fdi_database_wal_bytes{database="history"})"], 0.0);
  EXPECT_EQ(metrics[R"(fdi_persistence_degraded{database="history"})"], 0.0);
}

TEST_F(ProbesTest, ReadyOnceThereAreModelsAndAPublisher) {
  const auto monitor = StartWithHttp();
  const httplib::Result before = Get("/readyz");
  StoreModels(data_, LinearModels());
  ASSERT_TRUE(monitor->AwaitLine("models_reassigned")) << monitor->errors();
  const httplib::Result ready = Get("/readyz");
  samples_.reset();
  ASSERT_TRUE(Await([this] {
    return Scrape()[R"(fdi_dds_publishers{state="matched"})"] == 0.0;
  }));
  const httplib::Result alone = Get("/readyz");

  EXPECT_EQ(before->status, 503);
  EXPECT_THAT(before->body, HasSubstr(R"("model_sets":0)"));
  EXPECT_EQ(ready->status, 200) << ready->body;
  EXPECT_EQ(alone->status, 503);
  EXPECT_THAT(alone->body, HasSubstr(R"("publishers":0)"));
  EXPECT_EQ(Get("/healthz")->status, 200);
  EXPECT_EQ(Get("/elsewhere")->status, 404);
}

TEST_F(ProbesTest, AnAddressThatIsTakenIsNamed) {
  const auto monitor = StartWithHttp();
  const std::string taken = "127.0.0.1:" + std::to_string(port_);
  data_ = directory_.path() / "other";
  ChildProcess second(Command({"--http=" + taken}));

  EXPECT_EQ(second.AwaitExit(), 1);
  EXPECT_THAT(second.errors(), HasSubstr(taken + ": cannot listen: Address "));
  EXPECT_FALSE(std::filesystem::exists(data_));
}

TEST_F(ProbesTest, AnAddressThatCannotBeIsRefusedWithTheAcceptedForm) {
  for (const char* word : {"127.0.0.1:65536", "127.0.0.1", "a:b", ":1", "::1:2",
                           "[::1]", "9464x", "-1"}) {
    ChildProcess monitor(Command({std::string("--http=") + word}));

    EXPECT_EQ(monitor.AwaitExit(), 2) << word;
    EXPECT_THAT(monitor.errors(), HasSubstr("[IPv6]:PORT")) << word;
  }
}

}  // namespace
}  // namespace fdi::monitor
