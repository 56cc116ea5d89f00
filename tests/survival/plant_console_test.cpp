// fdi-monitor console: three monitors on loopback in one list, one of them
// killed; their episodes from PostgreSQL, which goes away and comes back.
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <httplib.h>
#include <nlohmann/json.hpp>

#include "tests/idl/test_domain.h"
#include "tests/survival/plant_fixture.h"
#include "tests/survival/shared_plant.h"
#include "tests/system/monitor_process.h"

namespace fdi::storage {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr int kValves = 6;  // V0 to V5, two for each monitor.

class PlantConsoleTest : public PlantFixture {
 protected:
  void SetUp() override {
    PlantFixture::SetUp();
    if (IsSkipped()) {
      return;
    }
    plant_ = std::make_unique<monitor::SharedPlant>(domain_.Options(), kValves,
                                                    milliseconds(100));
    Init();
    for (const auto& [name, valves] : globs_) {
      monitor::StoreLinearModels(Folder(name));
      StartMonitor(name);
    }
    StartConsole();
  }

  void StartMonitor(const std::string& name) {
    monitors_[name] = std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--data", Folder(name).string(), "--domain",
        std::to_string(domain_.id()), "run", "--valve", globs_.at(name)});
    ASSERT_TRUE(monitors_[name]->AwaitLine("monitor_ready"))
        << monitors_[name]->errors();
  }

  void StartConsole() {
    std::ofstream(Folder("page") / "index.html") << "<title>page</title>";
    console_ = std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_MONITOR_PROGRAM, "--domain", std::to_string(domain_.id()),
        "console", "--db", Url(), "--listen", "127.0.0.1:0", "--console-files",
        Folder("page").string(), "--log-level", "info"});
    ASSERT_TRUE(console_->AwaitLine("console_listening")) << console_->errors();
    const std::string& log = console_->errors();
    const std::size_t at = log.find("address=127.0.0.1:");
    client_ = std::make_unique<httplib::Client>("127.0.0.1",
                                                std::stoi(log.substr(at + 18)));
  }

  json Get(const std::string& path, int status = 200) {
    const httplib::Result answer = client_->Get("/api/v1/" + path);
    if (!answer || answer->status != status) {
      return nullptr;
    }
    return json::parse(answer->body);
  }
  /// Content of the tiles: id -> value of `key`.
  std::map<std::string, json> Tiles(const char* key) {
    std::map<std::string, json> values;
    const json answer = Get("valves");
    for (const json& tile : answer["valves"]) {
      values[tile["id"]] = tile.value(key, json());
    }
    return values;
  }
  std::map<std::string, json> Only(const std::map<std::string, json>& tiles,
                                   const std::set<std::string>& ids,
                                   bool of = true) {
    std::map<std::string, json> some = tiles;
    std::erase_if(
        some, [&](const auto& item) { return ids.contains(item.first) != of; });
    return some;
  }
  bool AllAre(const std::map<std::string, json>& tiles, const json& value) {
    return !tiles.empty() && std::ranges::all_of(tiles, [&](const auto& item) {
      return item.second == value;
    });
  }

  static bool Await(const std::function<bool()>& condition) {
    const auto end = Clock::now() + std::chrono::seconds(30);
    while (!condition()) {
      if (Clock::now() > end) {
        return false;
      }
      std::this_thread::sleep_for(milliseconds(20));
    }
    return true;
  }
  std::string NameOf(const std::string& monitor) {
    const json lines = Get("status")["plant"]["monitors"];
    for (const json& line : lines) {
      const std::string name = line["monitor"];
      if (name.ends_with(":" + std::to_string(monitors_[monitor]->pid()))) {
        return name;
      }
    }
    return "";
  }

  const std::map<std::string, std::string> globs_{
      {"a", "V[01]"}, {"b", "V[23]"}, {"c", "V[45]"}};
  const idl::TestDomain domain_;
  std::unique_ptr<monitor::SharedPlant> plant_;
  std::map<std::string, std::unique_ptr<ChildProcess>> monitors_;
  std::unique_ptr<ChildProcess> console_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(PlantConsoleTest, ShowsThreeMonitorsAndWhichOneWasKilled) {
  ASSERT_TRUE(Await([this] {
    const auto tiles = Tiles("quality");
    return tiles.size() == kValves && AllAre(tiles, "LIVE");
  })) << Get("valves");
  ASSERT_TRUE(Await([this] {
    const auto lines = Get("status")["plant"]["monitors"];
    return lines.size() == 3U &&
           std::ranges::all_of(lines, [](const json& line) {
             return line["valves"] == 2 && line["health"] == "OK";
           });
  })) << Get("status");
  const std::string killed = NameOf("b");
  EXPECT_EQ(Tiles("monitor")["V0"], NameOf("a"));
  EXPECT_EQ(Tiles("monitor")["V3"], killed);
  EXPECT_EQ(Tiles("monitor")["V5"], NameOf("c"));

  plant_->SetFaulty(true);
  ASSERT_TRUE(Await([this] { return AllAre(Tiles("state"), "ISOLATED"); }));
  ASSERT_TRUE(Await([this] { return Get("alarms")["alarms"].size() == 6U; }))
      << "heard";
  EXPECT_EQ(Get("history")["episodes"].size(), 0U);
  for (const char* name : {"a", "b", "c"}) {
    const Outcome outcome = Ship(name);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }
  std::set<std::pair<std::string, std::string>> found;
  const json rows = Get("history")["episodes"];
  for (const json& row : rows) {
    found.emplace(row["valve"].get<std::string>(),
                  row["monitor"].get<std::string>());
  }
  EXPECT_THAT(found,
              testing::ElementsAre(std::pair("V0", "a"), std::pair("V1", "a"),
                                   std::pair("V2", "b"), std::pair("V3", "b"),
                                   std::pair("V4", "c"), std::pair("V5", "c")));
  ASSERT_TRUE(Await([this] {
    const json alarms = Get("alarms")["alarms"];
    return std::ranges::count_if(alarms, [](const json& row) {
             return row.contains("monitor");
           }) == 6;
  }));
  json episode;  // Its evidence is committed after it.
  ASSERT_TRUE(Await([&] {
    for (const char* name : {"a", "b", "c"}) {
      Ship(name);
    }
    episode = Get("episodes/last");
    return episode["trace"]["t_ms"].size() > 5U;
  })) << episode;
  EXPECT_TRUE(episode["trace"]["T"].is_number()) << "heard on the bus";
  EXPECT_EQ(Get("worklist")["rows"].size(), 6U);

  monitors_["b"]->Signal(SIGKILL);
  const std::set<std::string> its = {"V2", "V3"};
  const auto silent = [&] {
    const auto tiles = Tiles("quality");
    EXPECT_TRUE(AllAre(Only(tiles, its, false), "LIVE")) << json(tiles);
    return AllAre(Only(tiles, its), "MONITOR_SILENT");
  };
  EXPECT_TRUE(Await(silent)) << Get("valves");
  const json lines = Get("status")["plant"]["monitors"];
  ASSERT_EQ(lines.size(), 3U);
  for (const json& line : lines) {
    EXPECT_EQ(line["silent"], line["monitor"] == killed) << line;
  }
  EXPECT_EQ(Get("status")["valves"]["live"], 4);

  StartMonitor("b");
  EXPECT_TRUE(Await([&] { return AllAre(Tiles("quality"), "LIVE"); }));
  EXPECT_NE(Tiles("monitor")["V2"], killed);
}

TEST_F(PlantConsoleTest, GoesOnWithoutPostgres) {
  ASSERT_TRUE(Await([this] { return AllAre(Tiles("quality"), "LIVE"); }));
  ASSERT_TRUE(Await([this] {
    return Get("status")["plant"]["history_away"].is_null() &&
           Get("history").is_object();
  }));

  server_->Stop();
  ASSERT_TRUE(Await(
      [this] { return Get("status")["plant"]["history_away"].is_object(); }));
  EXPECT_TRUE(Get("history", 503).is_object());
  // One that waits for PostgreSQL takes 5 s; twenty would take 100.
  const auto start = Clock::now();
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(Get("worklist", 503).is_object());
    EXPECT_TRUE(AllAre(Tiles("quality"), "LIVE"));
    EXPECT_TRUE(Get("valves/V0/trend").is_object());
  }
  EXPECT_LT(Clock::now() - start, std::chrono::seconds(60));
  server_->Start();
  EXPECT_TRUE(Await([this] { return Get("history").is_object(); }));
  EXPECT_TRUE(Get("status")["plant"]["history_away"].is_null());

  const httplib::Result refused = client_->Post(
      "/api/v1/episodes/0123456789abcdef/ack", "{}", "application/json");
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->status, 403);
  EXPECT_THAT(refused->body, testing::HasSubstr("page of a plant"));
  console_->Signal(SIGTERM);
  EXPECT_EQ(console_->AwaitExit(), 0);

  // A valve that was seen, and is silent when the page starts.
  PlantDatabase(Url()).Run(
      "INSERT INTO fdi.health_hour (monitor_id, valve_id, hour, model_hash, "
      "epoch, live_ms, bytes) SELECT 1, 'GONE', extract(epoch FROM now())::"
      "bigint / 3600 - 5, 0, 0, 0, ''");
  StartConsole();
  EXPECT_TRUE(Await([this] { return Tiles("state")["GONE"] == "NOT_JUDGED"; }))
      << Get("valves");
  EXPECT_TRUE(Await([this] {
    return AllAre(Only(Tiles("quality"), {"GONE"}, false), "LIVE");
  }));
}

// Without a monitor.
class PlantPageTest : public PlantFixture {
 protected:
  void SetUp() override {
    PlantFixture::SetUp();
    if (!IsSkipped()) {
      Init();
      std::ofstream(Folder("page") / "index.html") << "<title>page</title>";
    }
  }
  void Start() {
    const std::vector<std::string> arguments{FDI_MONITOR_PROGRAM,
                                             "--domain",
                                             std::to_string(domain_.id()),
                                             "console",
                                             "--db",
                                             Url(),
                                             "--listen",
                                             "127.0.0.1:0",
                                             "--console-files",
                                             Folder("page").string(),
                                             "--log-level",
                                             "info"};
    console_ = std::make_unique<ChildProcess>(arguments);
    ASSERT_TRUE(console_->AwaitLine("console_listening")) << console_->errors();
    const std::string& log = console_->errors();
    port_ = std::stoi(log.substr(log.find("address=127.0.0.1:") + 18));
  }
  int Status(const std::string& path) const {
    httplib::Client client("127.0.0.1", port_);
    client.set_read_timeout(20);
    const httplib::Result answer = client.Get("/api/v1/" + path);
    return answer ? answer->status : 0;
  }

  const idl::TestDomain domain_;
  int port_{0};
  std::unique_ptr<ChildProcess> console_;
};

TEST_F(PlantPageTest, AForeignLockHoldsUpNeitherThePageNorItsEnd) {
  Start();
  ASSERT_TRUE(monitor::Await([this] { return Status("history") == 200; }));
  PlantDatabase other(Url());
  const PlantTransaction transaction(other);
  other.Run("LOCK fdi.episode IN ACCESS EXCLUSIVE MODE");
  std::vector<std::jthread> clients;
  for (int i = 0; i < 8; ++i) {
    clients.emplace_back([this] { Status("statistics"); });
  }
  const auto wait = [this] {
    return PlantRowsOf("SELECT count(*) >= 4 FROM pg_locks WHERE NOT granted")
               .front() == "|t";
  };
  ASSERT_TRUE(monitor::Await(wait));
  EXPECT_EQ(Status("valves"), 200);
  EXPECT_EQ(Status("status"), 200);
  EXPECT_TRUE(wait()) << "the others are not waited for";
  console_->Signal(SIGTERM);
  EXPECT_EQ(console_->AwaitExit(), 0);
}

}  // namespace
}  // namespace fdi::storage
