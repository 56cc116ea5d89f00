// A shift of twenty valves in fast time: list, page, bus, SQL, PostgreSQL,
// hook, gateway and metrics say the same of every alarm at eleven moments; so
// do the work list, the view of one episode and the dashboard.
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <set>
#include <string>
#include <thread>
#include <tuple>

#include <gmock/gmock.h>
#include <httplib.h>
#include <nlohmann/json.hpp>

#include "diagnosis/model/severity.h"
#include "plant/plant_database.h"
#include "storage/database/data_directory.h"
#include "storage/history/episode.h"
#include "storage/history/history_database.h"
#include "tests/storage/private_postgres.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;
using storage::PrivatePostgres;

// All of them have to agree on these keys of an alarm.
constexpr std::array kAgreed = {
    "valve_id", "fault",       "fault_name", "strength",
    "worst",    "severity",    "priority",   "alarm_state",
    "shelved",  "unconfirmed", "acked_by",   "ack_comment",
    "label",    "certainty",   "stands",     "score"};
using Alarms = std::map<std::string, json>;  // By episode.

constexpr const char* kViewColumns =
    "episode_id, valve_id, fault, fault_name, strength, worst_strength, "
    "severity, priority, alarm_state, shelved_until_utc IS NOT NULL, "
    "unconfirmed_utc IS NOT NULL, acked_by, ack_comment, label, certainty "
    "FROM ";

bool Same(const json& a, const json& b) {
  return a.is_number() && b.is_number()
             ? std::abs(a.get<double>() - b.get<double>()) < 6e-4
             : a == b;
}

// One line for each difference; empty if there is none.
std::string Differences(const std::string& where, const Alarms& list,
                        const Alarms& other) {
  std::string text;
  for (const auto& [id, row] : list) {
    const auto found = other.find(id);
    if (found == other.end()) {
      text += where + " lacks " + row.dump() + '\n';
      continue;
    }
    for (const char* key : kAgreed) {
      if (row.contains(key) && found->second.contains(key) &&
          !Same(row[key], found->second[key])) {
        text += where + ": " + key + " of " + row["valve_id"].dump() + " is " +
                found->second[key].dump() + ", the list has " +
                row[key].dump() + '\n';
      }
    }
  }
  for (const auto& [id, row] : other) {
    text += list.contains(id) ? "" : where + " has also " + row.dump() + '\n';
  }
  return text;
}

struct Valve {
  std::string id;
  double offset{0.0};    // Change of X by the fault at full strength.
  double strength{0.0};  // Now.
  double rate{0.0};      // A second.
  bool silent{false};
  bool gateway{false};  // Published by the gateway that dies.
};

class ShiftTest : public MonitorFixture {
 protected:
  static void SetUpTestSuite() {
    if (PrivatePostgres::IsInstalled()) {
      server_ = new PrivatePostgres;
      server_->Create("plant");
    }
  }
  static void TearDownTestSuite() {
    delete server_;
    server_ = nullptr;
  }

  ShiftTest() {
    for (int i = 1; i <= 20; ++i) {
      Valve& valve = valves_.emplace_back();
      valve.id = std::string(i < 10 ? "FV-0" : "FV-") + std::to_string(i);
      valve.gateway = i >= 9 && i <= 13;
    }
    std::ofstream(directory_.path() / "index.html") << "<title>page</title>";
    WritePrivate("hook", "#!/bin/sh\ncat >>\"$(dirname \"$0\")/told\"\n");
    std::filesystem::permissions(directory_.path() / "hook",
                                 std::filesystem::perms(0700));
    StoreModels(data_, LinearModels());
    // The models tell strengths from 0.75 to 1.
    std::ofstream(data_ / "faults.toml")
        << "[f1]\nseverity = [{from = 0.0, level = \"high\"}, "
           "{from = 0.85, level = \"critical\"}]\n"
           "[f7]\nseverity = [{from = 0.0, level = \"high\"}, "
           "{from = 0.85, level = \"critical\"}]\n";
    gateway_.emplace(*participant_,
                     idl::PublisherOptions{idl::Profile::kLossless, 100});
    if (server_ != nullptr) {
      Store("ship --init --db '" + server_->Url("plant") + "'");
    }
  }

  void WritePrivate(const char* name, const std::string& text) {
    std::ofstream(directory_.path() / name) << text;
    std::filesystem::permissions(directory_.path() / name,
                                 std::filesystem::perms(0600));
  }

  void Start() {
    monitor_ =
        StartMonitor({"--console=127.0.0.1:0", "--console-files",
                      directory_.path().string(), "--http=127.0.0.1:0",
                      "--on-event", (directory_.path() / "hook").string(),
                      "--on-event-rate", "6000", "--stale-timeout", "600"});
    page_ = PortOf("console_listening");
    metrics_ = PortOf("http_listening");
    EXPECT_TRUE(gateway_->WaitForReaders(1, kMonitorPatience));
  }
  int PortOf(const std::string& event) const {
    std::smatch address;
    EXPECT_TRUE(
        std::regex_search(monitor_->errors(), address,
                          std::regex(event + " address=127.0.0.1:([0-9]+)")));
    return std::stoi(address[1]);
  }

  Valve& Of(const std::string& id) {
    return *std::ranges::find(valves_, id, &Valve::id);
  }

  // `seconds` of the plant, one sample each, of every valve that sends.
  void Pass(int seconds) {
    for (const int end = now_s_ + seconds; now_s_ < end; ++now_s_) {
      for (Valve& valve : valves_) {
        valve.strength += valve.rate;
        if (valve.silent) {
          continue;
        }
        auto& publisher = valve.gateway ? *gateway_ : *samples_;
        ASSERT_EQ(publisher.Write(
                      {valve.id, PlantSample(static_cast<std::uint64_t>(now_s_),
                                             valve.offset * valve.strength)},
                      {}, kMonitorPatience),
                  idl::WriteResult::kSent);
      }
      if (now_s_ % 10 == 0) {
        Take();
      }
    }
  }

  std::string Store(const std::string& arguments) const {
    const auto out = directory_.path() / "out";
    const std::string command = FDI_STORE_PROGRAM " --data " + data_.string() +
                                " " + arguments + " >" + out.string();
    EXPECT_EQ(std::system(command.c_str()), 0) << arguments;
    std::ostringstream text;
    text << std::ifstream(out).rdbuf();
    return text.str();
  }

  // ---- The six who say something. An alarm that is over is in no list.
  Alarms FromList() const {
    Alarms alarms;
    json listed = json::parse(Store("history list --json"));
    for (json& row : listed["episodes"]) {
      row["worst"] = row["worst_strength"];
      row["shelved"] = !row["shelved_until_utc"].is_null();
      row["unconfirmed"] = !row["unconfirmed_utc"].is_null();
      row["stands"] = row["returned_utc"].is_null();
      if (row["alarm_state"] != "NORMAL") {
        alarms[row["episode_id"]] = row;
      }
    }
    return alarms;
  }
  json Get(const std::string& path) const {
    const auto answer = httplib::Client("127.0.0.1", page_).Get(path);
    EXPECT_TRUE(answer && answer->status == 200) << path;
    return answer ? json::parse(answer->body) : json();
  }
  Alarms FromPage() const {
    Alarms alarms;
    json page = Get("/api/v1/alarms");
    for (json& row : page["alarms"]) {
      row["valve_id"] = row["valve"];
      row["fault_name"] = row["fault"].is_null() ? json() : row["name"];
      row["worst"] = row["worst_strength"];
      row["alarm_state"] = row["isa"];
      row["shelved"] = !row["shelved"].is_null();
      row["unconfirmed"] = !row["unconfirmed_ms"].is_null();
      row["stands"] = row["returned_ms"].is_null();
      alarms[row["episode"]] = row;
    }
    return alarms;
  }
  // Reads active alarms alone.
  Alarms FromTiles() const {
    Alarms alarms;
    const json page = Get("/api/v1/valves");
    for (const json& tile : page["valves"]) {
      if (!tile["episode"].is_null()) {
        alarms[tile["episode"]] = {
            {"valve_id", tile["id"]},
            {"fault", tile["fault"]},
            {"strength", tile["strength"]},
            {"severity", tile["severity"]},
            {"certainty", tile["certainty"]},
            {"alarm_state", tile["unacked"] == true ? "UNACK" : "ACKED"},
            {"shelved", !tile["shelved_until_ms"].is_null()},
            {"unconfirmed", !tile["unconfirmed_ms"].is_null()}};
      }
    }
    return alarms;
  }
  static json AlarmOfRow(const std::vector<json>& row) {
    json alarm;
    for (std::size_t i = 0; i + 1 < row.size(); ++i) {
      alarm[kAgreed[i]] = row[i + 1];
    }
    return alarm;
  }
  Alarms FromSql() const {
    storage::Database file(storage::DataDirectory{data_}.history(),
                           storage::HistorySchema(), storage::Access::kReader);
    storage::Statement row =
        file.Prepare(std::string("SELECT ") + kViewColumns +
                     "fault_history WHERE alarm_state <> 'NORMAL'");
    Alarms alarms;
    while (row.Step()) {
      std::vector<json> cells;
      for (int c = 0; c < row.ColumnCount(); ++c) {
        cells.push_back(row.IsNull(c) ? json()
                        : row.TypeOf(c) == storage::ColumnType::kReal
                            ? json(row.Double(c))
                        : row.TypeOf(c) == storage::ColumnType::kInteger
                            ? c == 9 || c == 10 ? json(row.Int64(c) != 0)
                                                : json(row.Int64(c))
                            : json(row.Text(c)));
      }
      alarms[cells[0]] = AlarmOfRow(cells);
    }
    return alarms;
  }
  Alarms FromPostgres() const {
    const std::string url = server_->Url("plant");
    Store("ship --db '" + url + "' --monitor here");
    storage::PlantDatabase plant(url);
    const storage::PlantRows rows =
        plant.Run(std::string("SELECT ") + kViewColumns +
                  "fdi.fault_history WHERE alarm_state <> 'NORMAL'");
    Alarms alarms;
    for (int r = 0; r < rows.size(); ++r) {
      std::vector<json> cells;
      for (int c = 0; c < rows.columns(); ++c) {
        const auto text = rows.Text(r, c);
        cells.push_back(!text               ? json()
                        : c == 4 || c == 5  ? json(std::stod(*text))
                        : c == 7            ? json(std::stoi(*text))
                        : c == 9 || c == 10 ? json(*text == "t")
                                            : json(*text));
      }
      alarms[cells[0]] = AlarmOfRow(cells);
    }
    return alarms;
  }
  // Reads from the shipped dashboard of docs/examples what it shows of the
  // alarms of `list`; each is of another valve.
  Alarms FromGrafana(const Alarms& list) const {
    storage::PlantDatabase plant(server_->Url("plant"));
    const std::string sql =
        std::regex_replace(RawSql("Active or not acknowledged"),
                           std::regex(R"(\$monitor)"), "'here'");
    const storage::PlantRows rows = plant.Run(
        "SELECT valve_id, strength, severity, priority, alarm_state, "
        "shelved_until_utc IS NOT NULL, unconfirmed_utc IS NOT NULL, "
        "acked_by, ack_comment FROM (" +
        sql + ") AS panel");
    Alarms alarms;
    for (int r = 0; r < rows.size(); ++r) {
      const auto text = [&](int column) {
        const auto cell = rows.Text(r, column);
        return cell ? json(*cell) : json();
      };
      const auto row = std::ranges::find_if(list, [&](const auto& item) {
        return item.second["valve_id"] == text(0);
      });
      const json strength = text(1);
      alarms[row == list.end() ? "none" : row->first] = {
          {"valve_id", text(0)},
          {"strength", strength.is_null()
                           ? json()
                           : json(std::stod(strength.get<std::string>()))},
          {"severity", text(2)},
          {"priority", std::stoi(text(3).get<std::string>())},
          {"alarm_state", text(4)},
          {"shelved", text(5) == "t"},
          {"unconfirmed", text(6) == "t"},
          {"acked_by", text(7)},
          {"ack_comment", text(8)}};
    }
    return alarms;
  }
  static std::string RawSql(const std::string& title) {
    const json dashboard = json::parse(std::ifstream(FDI_DASHBOARD));
    for (const json& panel : dashboard["panels"]) {
      if (panel["title"] == title) {
        return panel["targets"][0]["rawSql"];
      }
    }
    ADD_FAILURE() << "no panel " << title;
    return "";
  }
  // The ids of alarms, as the page sorts what it gets: what stands, then the
  // larger score, then the newer one.
  static std::vector<std::string> ByRank(const Alarms& page) {
    std::vector<std::string> ids;
    for (const auto& [id, row] : page) {
      ids.push_back(id);
    }
    const auto key = [&page](const std::string& id) {
      const json& row = page.at(id);
      return std::tuple(row["stands"] == false, -row["score"].get<double>(),
                        -row["detected_ms"].get<std::int64_t>(),
                        row["valve_id"].get<std::string>(), id);
    };
    std::ranges::sort(ids, {}, key);
    return ids;
  }
  // Shelved alarms may not appear there.
  std::string WorkListDifferences(Alarms list, Alarms page) const {
    Alarms told;
    std::vector<std::string> order;
    const json work = json::parse(Store("worklist --json"));
    for (const json& row : work["rows"]) {
      const json& id = row["episode_id"];
      // Ended and acknowledged alarms are still listed for a time.
      if (id.is_string() && list.contains(id.get<std::string>())) {
        order.push_back(id);
        told[id] = {{"valve_id", row["valve_id"]},
                    {"fault", row["fault"]},
                    {"severity", row["severity"]},
                    {"unconfirmed", !row["unconfirmed_utc"].is_null()},
                    {"certainty", row["certainty"]},
                    {"stands", row["open"]},
                    {"score", row["score"]},
                    {"strength", row["strength"]}};
      }
    }
    for (auto& [id, row] : list) {
      row["score"] = page.contains(id) ? page[id]["score"] : json();
    }
    std::erase_if(
        page, [&told](const auto& item) { return !told.contains(item.first); });
    const std::string ranked =
        ByRank(page) == order ? "" : "the page has another order\n";
    // A finding that is over is done once it is labelled, or the valve
    // repaired.
    std::erase_if(list, [](const auto& item) {
      const json& row = item.second;
      return row["shelved"] == true ||
             ((!row["label"].is_null() || !row["repairs"].empty()) &&
              row["alarm_state"] == "RTN_UNACK");
    });
    return ranked + Differences("work list", list, told);
  }
  // Active alarms, as known to somebody who has heard nothing but the events.
  Alarms FromHook() const {
    Alarms alarms;
    std::ifstream told(directory_.path() / "told");
    for (std::string line; std::getline(told, line);) {
      const json event = json::parse(line);
      const std::string id = event["episode_id"];
      if (event["kind"] == "CLEARED" || event["reason"] == "cleared") {
        alarms.erase(id);
      } else {
        alarms[id] = {{"valve_id", event["valve_id"]},
                      {"fault", event["fault"]},
                      {"fault_name", event["name"]},
                      {"severity", event["severity"]},
                      {"priority", event["priority"]},
                      {"strength", event["strength"]},
                      {"unconfirmed", event["kind"] == "CLOSED"}};
      }
    }
    return alarms;
  }
  // The states as a late reader of the bus hears them. Their strengths are
  // those of the last event.
  Alarms FromBus() const {
    idl::Participant here(participant_->options());
    idl::Subscriber<idl::ValveStateMessage> states(here);
    EXPECT_TRUE(states.WaitForWriters(1, kMonitorPatience));
    std::map<std::string, idl::ValveStateMessage> heard;
    while (states.Take({[&](const idl::ValveStateMessage& state, const auto&) {
                          heard[state.valve_id] = state;
                        },
                        {}},
                       std::chrono::milliseconds(500)) > 0) {
    }
    Alarms alarms;
    for (const auto& [valve, state] : heard) {
      if (state.episode_id != 0) {
        alarms[storage::EpisodeIdText(state.episode_id)] = {
            {"valve_id", valve},
            {"fault", state.fault.empty() ? json() : json(state.fault)},
            {"severity", SeverityName(*SeverityOf(state.priority))},
            {"priority", state.priority},
            {"certainty", state.certainty},
            {"unconfirmed", state.unconfirmed_ns != 0}};
      }
    }
    return alarms;
  }
  std::string Metric(const std::string& name, const char* priority) const {
    const auto page = httplib::Client("127.0.0.1", metrics_).Get("/metrics");
    std::smatch value;
    const std::string text = page ? page->body : "";
    return std::regex_search(
               text, value,
               std::regex(name + R"(\{priority=")" + priority + R"("\} (\d+))"))
               ? value[1].str()
               : "none";
  }

#ifdef FDI_GATEWAY_PROGRAM
  // The messages for MQTT, as lines.
  void StartGateway() {
    gateway_out_ = std::make_unique<ChildProcess>(std::vector<std::string>{
        FDI_GATEWAY_PROGRAM, "--data", data_.string(), "--domain",
        std::to_string(domain_.id()), "--transport", "udp", "out", "--lines",
        (directory_.path() / "lines").string()});
  }
  // The newest state of each valve that a broker would keep.
  Alarms FromGateway() const {
    std::map<std::string, json> states;
    std::ifstream lines(directory_.path() / "lines");
    for (std::string line; std::getline(lines, line);) {
      const json message = json::parse(line, nullptr, false);
      // The last line may be half written.
      if (message.is_object() && message["topic"].is_string() &&
          message["topic"].get<std::string>().ends_with("/state")) {
        states[message["topic"]] = message["payload"];
      }
    }
    Alarms alarms;
    for (const auto& [topic, state] : states) {
      for (const json& alarm : state["alarms"]) {
        alarms[alarm["episode_id"]] = {
            {"valve_id", state["valve_id"]},
            {"fault", alarm["fault"]},
            {"fault_name", alarm["fault"].is_null() ? json() : alarm["name"]},
            {"severity", alarm["severity"]},
            {"alarm_state", alarm["state"]},
            {"shelved", !alarm["shelved_until_utc"].is_null()},
            {"unconfirmed", !alarm["unconfirmed_utc"].is_null()},
            {"acked_by", alarm["acked_by"]},
            {"ack_comment", alarm["ack_comment"]}};
      }
    }
    return alarms;
  }
#endif

  // ---- What they disagree about.
  std::string Disagreement(const Alarms& list) const {
    Alarms active;
    for (const auto& [id, row] : list) {
      if (row["alarm_state"] != "RTN_UNACK") {
        active[id] = row;
      }
    }
    Alarms announced = active;
    Alarms shown;
    for (const auto& [id, row] : list) {
      json& show = shown[id] = json::parse(Store("history show --json " + id));
      if (active.contains(id)) {
        announced[id]["strength"] = AnnouncedStrength(show);
      }
    }
    // The hook is not told of the end of an alarm that ended with its data.
    Alarms hook = FromHook();
    std::erase_if(hook, [&active](const auto& item) {
      return item.second["unconfirmed"] == true && !active.contains(item.first);
    });
    // A fault that ended with its data stays on the bus until the valve is
    // normal again.
    Alarms bus = FromBus();
    std::erase_if(bus, [&active](const auto& item) {
      return item.second["unconfirmed"] == true && !active.contains(item.first);
    });
    // Nor is the hook told that a valve fell silent.
    for (const auto& [id, row] : active) {
      if (row["ended_utc"].is_null() && hook.contains(id)) {
        hook[id].erase("unconfirmed");
      }
    }
    const Alarms page = FromPage();
    std::string text =
        Differences("page", list, page) +
        Differences("tiles", active, FromTiles()) +
        Differences("history show", list, shown) +
        WorkListDifferences(list, page) + Differences("SQL", list, FromSql()) +
        Differences("bus", active, bus) + Differences("hook", announced, hook);
#ifdef FDI_GATEWAY_PROGRAM
    text += Differences("gateway", list, FromGateway());
#endif
    if (server_ != nullptr) {
      text += Differences("PostgreSQL", list, FromPostgres());
      text += Differences("Grafana", list, FromGrafana(list));
    }
    for (const char* priority : {"low", "medium", "high", "critical"}) {
      int open = 0;
      int unacked = 0;
      for (const auto& [id, row] : list) {
        const bool counts = row["severity"] == priority && !row["shelved"];
        open += counts && active.contains(id) ? 1 : 0;
        unacked += counts && row["alarm_state"] != "ACKED" ? 1 : 0;
      }
      for (const auto& [name, expected] :
           {std::pair("fdi_alarms_active", open),
            std::pair("fdi_alarms_unacknowledged", unacked)}) {
        if (const auto value = Metric(name, priority);
            value != std::to_string(expected)) {
          text += std::string(name) + " " + priority + " is " + value +
                  ", the list has " + std::to_string(expected) + '\n';
        }
      }
    }
    return text;
  }
  // A strength moves without an event as long as its priority does not rise.
  static json AnnouncedStrength(const json& shown) {
    json strength;
    for (const json& event : shown["events"]) {
      if (event["who"].is_null() && event["kind"] != "RESUMED") {
        strength = event["faults"].is_null() ? json() : event["strength"];
      }
    }
    return strength;
  }

  struct Expected {
    const char* valve;
    const char* state;
    json fault;
    json severity;
    json strength;  // Now, to 0.05; null: not yet.
    bool shelved{false};
    bool ended{false};  // With its data.
  };
  // The moment is reached, and all say so. No valve sends meanwhile, so that
  // soon nothing confirms what is active.
  void Moment(const char* what, const std::vector<Expected>& expected) {
    SCOPED_TRACE(what);
    const auto deadline = Clock::now() + std::chrono::seconds(60);
    std::string wrong;
    do {
      Take();
      const Alarms list = FromList();
      wrong = Unexpected(list, expected);
      if (wrong.empty()) {
        wrong = Disagreement(list);
      }
    } while (!wrong.empty() && Clock::now() < deadline);
    EXPECT_EQ(wrong, "");
  }
  static std::string Unexpected(const Alarms& list,
                                const std::vector<Expected>& expected) {
    std::string text;
    for (const Expected& e : expected) {
      const auto row = std::ranges::find_if(list, [&e](const auto& item) {
        return item.second["valve_id"] == e.valve;
      });
      if (row == list.end()) {
        text += std::string("no alarm of ") + e.valve + '\n';
        continue;
      }
      const json& is = row->second;
      const bool strong = e.strength.is_null()
                              ? is["strength"].is_null()
                              : is["strength"].is_number() &&
                                    std::abs(is["strength"].get<double>() -
                                             e.strength.get<double>()) < 0.05;
      if (is["alarm_state"] != e.state || is["fault"] != e.fault ||
          (!e.severity.is_null() && is["severity"] != e.severity) || !strong ||
          is["shelved"] != e.shelved ||
          is["unconfirmed"] == (is["alarm_state"] == "RTN_UNACK") ||
          is["ended_utc"].is_null() ==
              (e.ended || is["alarm_state"] == "RTN_UNACK")) {
        text += std::string(e.valve) + " is " + is.dump() + '\n';
      }
    }
    if (list.size() != expected.size()) {
      text += std::to_string(list.size()) + " alarms\n";
    }
    return text;
  }

  static PrivatePostgres* server_;
  std::vector<Valve> valves_;
  std::optional<idl::Publisher<idl::ValveSampleMessage>> gateway_;
  std::unique_ptr<ChildProcess> monitor_;
  std::unique_ptr<ChildProcess> gateway_out_;
  int page_{0};
  int metrics_{0};
  int now_s_{0};
};

PrivatePostgres* ShiftTest::server_ = nullptr;

TEST_F(ShiftTest, EverybodySaysTheSameOfEveryAlarm) {
  Start();
#ifdef FDI_GATEWAY_PROGRAM
  StartGateway();
#endif
  Pass(40);
  Moment("all is well", {});

  Of("FV-01") = {"FV-01", kF1Offset, 0.35};
  Of("FV-06") = {"FV-06", kF7Offset, 0.4};
  Of("FV-09") = {"FV-09", kF1Offset, 0.35, 0.0, false, true};
  Pass(3);
  Moment("detected", {{"FV-01", "UNACK", {}, {}, {}},
                      {"FV-06", "UNACK", {}, {}, {}},
                      {"FV-09", "UNACK", {}, {}, {}}});

  Pass(12);
  Moment("named", {{"FV-01", "UNACK", "f1", "high", 0.75},
                   {"FV-06", "UNACK", "f7", "high", 0.75},
                   {"FV-09", "UNACK", "f1", "high", 0.75}});

  Store("history ack --valve 'FV-0[16]' --by anna --comment 'on my way'");
  Moment("acknowledged", {{"FV-01", "ACKED", "f1", "high", 0.75},
                          {"FV-06", "ACKED", "f7", "high", 0.75},
                          {"FV-09", "UNACK", "f1", "high", 0.75}});

  for (const char* id : {"FV-01", "FV-06"}) {
    Of(id).rate = (0.9 - Of(id).strength) / 300;
  }
  Pass(300);
  for (Valve& valve : valves_) {
    valve.rate = 0.0;
  }
  Pass(500);
  Moment("grown", {{"FV-01", "UNACK", "f1", "critical", 0.9},
                   {"FV-06", "UNACK", "f7", "critical", 0.9},
                   {"FV-09", "UNACK", "f1", "high", 0.75}});

  Store("history shelve FV-06 --for 8h --by jan --comment 'at the next stop'");
  const std::string labelled = [&] {
    for (const auto& [id, row] : FromList()) {
      if (row["valve_id"] == "FV-01") {
        return id;
      }
    }
    return std::string("none");
  }();
  Store("history label " + labelled + " f1 --by jan");
  const std::vector<Expected> shelved = {
      {"FV-01", "UNACK", "f1", "critical", 0.9},
      {"FV-06", "UNACK", "f7", "critical", 0.9, true},
      {"FV-09", "UNACK", "f1", "high", 0.75}};
  Moment("shelved and labelled", shelved);

  for (Valve& valve : valves_) {
    valve.silent = valve.gateway;
    if (valve.gateway) {
      gateway_->Dispose({valve.id, {}});
    }
  }
  std::vector<Expected> dead = shelved;
  dead[2].ended = true;
  Moment("the gateway is dead", dead);

  monitor_->Signal(SIGKILL);
  monitor_->AwaitExit();
  gateway_.emplace(*participant_,
                   idl::PublisherOptions{idl::Profile::kLossless, 100});
  Start();
  Pass(60);
  Moment("restarted", dead);

  // FV-01 is mended, FV-06 goes on.
  Of("FV-01").strength = 0.0;
  Of("FV-06").strength = 0.9;
  Pass(500);
  std::vector<Expected> mended = dead;
  mended[0] = {"FV-01", "RTN_UNACK", "f1", "critical", 0.9};
  mended[1].strength = 0.9;
  Moment("mended", mended);

  // The work list lets go of it, and every view of the episode has the repair.
  Store("valves repaired 'FV-0[1]' recalibrated --by bo");
  Moment("repaired", mended);
  const json work = json::parse(Store("worklist --json"));
  ASSERT_EQ(work["done"].size(), 1U) << work["done"];
  EXPECT_EQ(work["done"][0]["what"], "recalibrated");
  EXPECT_EQ(json::parse(
                Store("history show --json " + labelled))["repairs"][0]["who"],
            "bo");
  EXPECT_EQ(Get("/api/v1/episodes/" + labelled)["repairs"][0]["who"], "bo");
  EXPECT_EQ(Get("/api/v1/valves/FV-01/about")["repairs"].size(), 1U);

  Store("history ack --valve '*' --by anna --comment 'seen'");
  Store("history shelve FV-06 --off --by jan");
  Moment("acknowledged at the end of the shift",
         {{"FV-06", "ACKED", "f7", "critical", 0.9}});
}

}  // namespace
}  // namespace fdi::monitor
