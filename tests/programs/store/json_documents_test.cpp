// docs/json.toml, of which docs/json.md is made, and the programs say the same:
// every key that a verb prints is documented, and every documented key is
// printed by some verb.
#include <cmath>
#include <map>
#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <toml++/toml.h>

#include "storage/models/models.h"
#include "tests/programs/store/store_program_fixture.h"
#include "tests/storage/model_set_fixture.h"
#include "tests/storage/private_postgres.h"

namespace fdi::storage {
namespace {

using testing::IsEmpty;

// A type: a word (text, time, run, ...), or JSON without quotes with such words
// in it: [run], {*: num}. A question mark behind it allows null.
struct Type {
  json shape;
  bool or_null{false};
};

// @param text "TYPE (UNIT); MEANING", of which only the type is needed.
Type ParseType(const std::string& text) {
  std::string type = text.substr(0, std::min(text.find(" ("), text.find(';')));
  const bool or_null = type.ends_with('?');
  if (or_null) {
    type.pop_back();
  }
  static const std::regex word(R"([A-Za-z0-9_*?]+)");
  return {json::parse(std::regex_replace(type, word, "\"$&\"")), or_null};
}

// The kinds of docs/json.toml.
class Page {
 public:
  using Kind = std::map<std::string, Type>;

  explicit Page(const std::string& file) {
    const toml::table tables = toml::parse_file(file);
    for (const auto& [kind, keys] : tables) {
      for (const auto& [key, value] : *keys.as_table()) {
        AddKey(std::string(kind), std::string(key), value.value_or(""),
               tables["common"][key].value_or(""));
      }
    }
  }

  // Notes what `value` does not share with `type` in complaints().
  void Check(const json& value, const Type& type, const std::string& where) {
    if (value.is_null() && type.or_null) {
      return;
    }
    if (type.shape.is_array()) {
      if (!value.is_array()) {
        return Complain(where + " is no list");
      }
      for (const json& item : value) {
        Check(item, {type.shape[0]}, where + "[]");
      }
    } else if (type.shape.is_object()) {
      CheckObject(value, type.shape, where);
    } else {
      CheckWord(value, type.shape, where);
    }
  }

  const std::map<std::string, Type>& verbs() const { return verbs_; }
  std::vector<std::string> complaints() const { return complaints_; }
  // "run.seed": documented in a kind of which `verbs` print something, and
  // printed by none of them.
  // Left out are kinds and keys in `others`, which other programs print, or
  // these for model sets that the test does not make.
  std::vector<std::string> Unseen(const std::set<std::string>& verbs,
                                  const std::set<std::string>& others) const {
    std::set<std::string> kinds;
    for (const std::string& verb : verbs) {
      AddKinds(verbs_.at(verb).shape, kinds);
    }
    std::vector<std::string> unseen;
    for (const std::string& name : kinds) {
      for (const auto& [key, type] : kinds_.at(name)) {
        if (!key.starts_with("...") && !seen_.contains(name + '.' + key) &&
            !others.contains(name) && !others.contains(name + '.' + key)) {
          unseen.push_back(name + '.' + key);
        }
      }
    }
    return unseen;
  }

 private:
  void AddKey(const std::string& kind, const std::string& key,
              const std::string& text, const std::string& common) {
    if (kind == "verbs") {
      verbs_[key] = ParseType(text);
    } else if (key == "...") {
      std::istringstream names(text);
      for (std::string name; names >> name;) {
        kinds_[kind]["..." + name];
      }
    } else {
      kinds_[kind][key] = ParseType(text.empty() ? common : text);
    }
  }

  // All kinds that a type leads to.
  void AddKinds(const json& shape, std::set<std::string>& kinds) const {
    if (shape.is_string()) {
      const auto found = kinds_.find(shape.get<std::string>());
      if (found != kinds_.end() && kinds.insert(found->first).second) {
        for (const auto& [key, type] : found->second) {
          AddKinds(key.starts_with("...") ? json(key.substr(3)) : type.shape,
                   kinds);
        }
      }
    }
    for (const json& part : shape.is_structured() ? shape : json::array()) {
      AddKinds(part, kinds);
    }
  }

  void Complain(const std::string& text) { complaints_.push_back(text); }

  void CheckObject(const json& value, const json& shape,
                   const std::string& where) {
    if (!value.is_object()) {
      return Complain(where + " is no object");
    }
    for (const auto& [key, item] : value.items()) {
      const auto found =
          shape.contains(key) ? shape.find(key) : shape.find("*");
      if (found == shape.end()) {
        Complain(where + "." + key + " is not documented");
      } else {
        Check(item, {*found}, where + "." + key);
      }
    }
  }

  // The kind that documents `key` of `kind`, itself or one that it includes.
  std::string OwnerOf(const std::string& kind, const std::string& key) const {
    for (const auto& [name, type] : kinds_.at(kind)) {
      if (name == key) {
        return kind;
      }
      if (name.starts_with("...")) {
        const std::string owner = OwnerOf(name.substr(3), key);
        if (!owner.empty()) {
          return owner;
        }
      }
    }
    return "";
  }

  void CheckWord(const json& value, std::string word,
                 const std::string& where) {
    if (word.ends_with('?')) {
      if (value.is_null()) {
        return;
      }
      word.pop_back();
    }
    if (kinds_.contains(word)) {
      if (!value.is_object()) {
        return Complain(where + " is no " + word);
      }
      for (const auto& [key, item] : value.items()) {
        const std::string owner = OwnerOf(word, key);
        if (owner.empty()) {
          Complain(where + "." + key + " is not documented in " + word);
          continue;
        }
        seen_.insert(owner + '.' + key);
        Check(item, kinds_.at(owner).at(key), where + "." + key);
      }
      return;
    }
    static const std::regex time(R"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z)");
    const bool fits = word == "any"    ? true
                      : word == "text" ? value.is_string()
                      : word == "bool" ? value.is_boolean()
                      : word == "int"  ? value.is_number_integer()
                      : word == "num"  ? value.is_number()
                      : word == "time"
                          ? value.is_string() &&
                                std::regex_match(value.get<std::string>(), time)
                          : false;
    if (!fits) {
      Complain(where + " = " + value.dump() + " is no " + word);
    }
  }

  std::map<std::string, Kind> kinds_;
  std::map<std::string, Type> verbs_;
  std::set<std::string> seen_;
  std::vector<std::string> complaints_;
};

// A data directory in which every kind of record has something to say.
class JsonDocumentsTest : public FdiStoreTest {
 protected:
  JsonDocumentsTest() {
    Write("a.csv",
          "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h,note\n"
          "0,40,3500,2600,130,41,22,1\n1,40,3500,2600,130,41,22,1\n");
    StoreModels();
    StoreHistory();
  }

  void StoreModels() {
    ModelStore models(directory_.path() / "models.db",
                      Access::kOccasionalWriter);
    const ModelSet parent = models.Save(RandomModelSet("pump", 3, 1));
    Lineage lineage;
    lineage.settings = R"({"seed": 1})";
    lineage.parent = {{parent.name, parent.version, parent.content_hash}};
    lineage.episodes = {{"00c0ffee12345678", "LV-1", "f1", "anna", kDetected, 1,
                         0.5, "0123456789ab", 100}};
    models.Save(RandomModelSet("pump", 3, 2), Activation::kAlways, lineage);
    models.SetBaseline(
        "LV-1",
        {0, "pump", 1, 1.5, {{"kv", 118.25}}, {{"X", 0.25, 0.001, 99.5}}});
    models.SaveTemplate("globe", std::vector<std::byte>(7), "19 faults");
  }

  // One that stands, for what waiting costs.
  void StoreLeak() {
    models_.faults = {1, 5, 19};
    HistoryWriter writer(path_);
    const auto record = [&](TransitionKind kind, double s, FaultSet faults) {
      writer.Record(Event(kind, s, faults, 0.8, EndReason::kNone, "LV-2"),
                    kDetected);
    };
    record(TransitionKind::kDetected, 0, 0);
    record(TransitionKind::kIsolated, 20, 0b010);
    writer.StoreStrength({Id("LV-2"), kDetected + 600 * kSecond, 5, 0.5, 0.4,
                          0.6, Layer::kObservers});
    HealthHour hour;
    hour.valve_id = "LV-2";
    hour.hour = kDetected / (3600 * kSecond) + 1;
    hour.model_hash = 1;
    hour.seen_ms = hour.live_ms = 3'600'000;
    hour.channels = {{Signal::kF, 0}};
    hour.bins[5] = {{3600, 0, 0, 3600 * 100}};
    Checkpoint checkpoint;
    checkpoint.health = {hour};
    writer.CommitCheckpoint(checkpoint);
  }

  void StoreHistory() {
    HistoryWriter writer(path_);
    RecordEpisode(writer, 0b010);
    writer.AppendTrace(Id(), Instants(20, -5));
    EpisodeLook look;
    look.episode_id = Id();
    look.first_ns = kDetected;
    look.period_ns = kSecond;
    look.faults = {{7, 0.5, 0.4, 0.6, kDetected, false}};
    writer.StoreLook(look);
    for (int hour = 0; hour < 3; ++hour) {
      writer.StoreStrength({Id(), kDetected + hour * 3600 * kSecond, 7,
                            0.1 * (hour + 1), 0.1 * hour + 0.09,
                            0.1 * hour + 0.11, Layer::kPhysics});
    }
    CoverageDay day{"LV-1", 20'000, 1.0, {}};
    day.samples.Add(Quality::kLive, 7200);
    std::vector<HealthHour> hours(12);
    for (int i = 0; i < 12; ++i) {
      HealthHour& hour = hours[static_cast<std::size_t>(i)];
      hour.valve_id = "LV-1";
      hour.hour = 480'000 + 24 * i;
      hour.model_hash = 1;
      hour.seen_ms = hour.live_ms = 3'600'000;
      hour.share = 400;
      hour.channels = {{Signal::kX, -10}};
      hour.bins[7] = {{3600, 3600LL * 51 * i, 0, 3600LL * 71'000}};
      hour.strengths = {{1, 3600, 3600LL * 100}};
    }
    Checkpoint checkpoint;
    checkpoint.coverage = {day};
    checkpoint.health = hours;
    writer.CommitCheckpoint(checkpoint);
    writer.EndSession(kDetected, true);
    Database database(path_, HistorySchema(), Access::kOccasionalWriter);
    Transaction transaction(database);
    database.Run(
        "INSERT INTO common_cause VALUES ('00000000000000aa', 'air', ?, NULL)",
        kDetected);
    database.Run(
        "INSERT INTO common_cause_member SELECT '00000000000000aa', "
        "episode_id, "
        "valve_id, 'f7', detected_ns FROM episode");
    transaction.Commit();
  }

  // The document of a verb, compared with what the page says of it.
  json Printed(Page& page, const std::string& verb,
               const std::string& arguments = "",
               const std::string& program = "fdi-store") {
    const auto type = page.verbs().find(program + " " + verb);
    if (type == page.verbs().end()) {
      ADD_FAILURE() << program << " " << verb << " is not on the page";
      return {};
    }
    called_.insert(type->first);
    const auto bin = std::filesystem::path(FDI_STORE_PROGRAM).parent_path();
    const int status =
        std::system(("cd " + directory_.path().string() + " && \"" +
                     (bin / program).string() + "\" --data . " + verb + " " +
                     arguments + " --json >out.txt 2>err.txt")
                        .c_str());
    EXPECT_EQ(status, 0) << verb << ": "
                         << Slurp(directory_.path() / "err.txt");
    const json document =
        json::parse(Slurp(directory_.path() / "out.txt"), nullptr, false);
    page.Check(document, type->second, verb);
    return document;
  }

  std::set<std::string> called_;
};

TEST_F(JsonDocumentsTest, ProgramsAndPageHaveTheSameKeys) {
  Page page(FDI_JSON_KEYS);
  const std::string id =
      Printed(page, "runs import", "a.csv --valve LV-1")["run_id"];
  Printed(page, "runs sniff", "a.csv -o tags.toml");
  // Two loops with one period, and a file that is too short.
  for (const char* loop : {"FIC1.csv", "FIC2.csv"}) {
    std::string text = "t_s,OP,PV,SP,auto\n";
    for (int k = 0; k < 200; ++k) {
      const double wave = std::sin(0.3 * k);
      text += std::to_string(10 * k) + ',' + std::to_string(50.0 + wave) + ',' +
              std::to_string(50.0 + 2.0 * wave) + ",50,1\n";
    }
    Write(loop, text);
  }
  Printed(page, "audit", "a.csv FIC1.csv FIC2.csv");
  Printed(page, "runs label", id + "@0:1 f7");
  Printed(page, "runs list");
  Printed(page, "runs show", id);
  Printed(page, "models list");
  Printed(page, "models activate", "pump@1");
  Printed(page, "models show", "pump@2");
  Printed(page, "models export", "pump@2 -o pump.fdm");
  Printed(page, "models import", "pump.fdm");
  Printed(page, "types list");
  Printed(page, "types show", "globe");
  Printed(page, "valves add", "'PV-*' --type globe");
  Printed(page, "valves repaired", "LV-1 repacked");
  Printed(page, "valves assign", "LV-1 pump@2");
  Write("plant.csv",
        "name,op,pv,group,grade\nFIC1,OP,PV,a,1\nFIC2,OP,PV,a,\n,OP,,,\n");
  Printed(page, "valves add --plant", "plant.csv");
  std::filesystem::create_directory(directory_.path() / "DIR");
  ModelStore(directory_.path() / "DIR" / "models.db",
             Access::kOccasionalWriter);
  Printed(page, "models import DIR");
  Printed(page, "valves list");
  Printed(page, "valves show", "LV-1");
  Printed(page, "valves move", "LV-1 moved");
  Printed(page, "valves remove", "'PV-*'");
  Printed(page, "history shelve", "LV-1 --for 1h --comment ordered");
  Printed(page, "history list --shelved");
  if (FDI_PLANNER) {
    Printed(page, "worklist", "--from 2020-01-01 --html week.html");
  }
  Printed(page, "history list");
  Printed(page, "history ack", "last");
  Printed(page, "history label", "last f7 --comment seen");
  Printed(page, "history show", "last");
  Printed(page, "history shelve", "LV-1 --off");
  Printed(page, "faults");
  if (FDI_PLANNER) {
    Printed(page, "health", "--valve LV-1");
    Printed(page, "health --limit", "X=3 --valve LV-1");
    // A valve that nothing judges, and one that is shelved no longer.
    Printed(page, "valves add", "NV-9");
    Printed(page, "worklist",
            "--from 2020-01-01 --limit X=0.01 --audit-windows 3 "
            "--html week.html");
  } else {
    called_.insert(
        {"fdi-store health", "fdi-store health --limit", "fdi-store worklist"});
  }
  Printed(page, "doctor");
  Printed(page, "backup", "copy");
  Printed(page, "prune", "--history-age 1d --dry-run");
  if (FDI_PLANNER && FDI_PLANT && PrivatePostgres::IsInstalled()) {
    PrivatePostgres server;
    server.Create("plant");
    const std::string to = "--db '" + server.Url("plant") + "'";
    Printed(page, "ship --init", to);
    Printed(page, "ship", to);
    const std::string plant = "'" + server.Url("plant") + "'";
    Printed(page, "history list --db", plant);
    Printed(page, "history show --db", plant + " last");
    Printed(page, "health --db", plant + " --valve LV-1");
    Printed(page, "worklist --db", plant + " --from 2020-01-01 --limit X=0.01");
    Printed(page, "prune --db", plant + " --history-age 36000d");
    Printed(page, "ship --forget");
  } else {
    called_.insert({"fdi-store ship", "fdi-store ship --init",
                    "fdi-store prune --db", "fdi-store ship --forget",
                    "fdi-store history list --db",
                    "fdi-store history show --db", "fdi-store health --db",
                    "fdi-store worklist --db"});
  }
  if (std::system("gnuplot --version >/dev/null 2>&1") == 0) {
    Printed(page, "history plot", "last");
  } else {
    called_.insert("fdi-store history plot");
  }
  Printed(page, "runs delete", id);
  StoreLeak();
  Printed(page, "valves add", "LV-2 --costs '2 EUR/m3'");
  Printed(page, "worklist", "--from 2020-01-01 --stop 2100-01-01");

  EXPECT_THAT(page.complaints(), IsEmpty());
  // The page also has the records of components that are left out.
  if (FDI_PLANNER && FDI_PLANT) {
    EXPECT_THAT(
        page.Unseen(called_, {"channel.regressor_max", "channel.regressor_min",
                              "channel.regressors", "channel.rule_list",
                              "fuzzy_set", "rule", "spender.alarms",
                              "spender.share", "spender.valve_id"}),
        IsEmpty());
  }
  for (const auto& [verb, type] : page.verbs()) {
    EXPECT_TRUE(called_.contains(verb) || !verb.starts_with("fdi-store"))
        << verb;
  }
}

// The verbs of the other programs that need neither minutes (onboard) nor a bus
// (watch).
TEST_F(JsonDocumentsTest, SimulatorAndTrainerAreOnThePage) {
  const auto bin = std::filesystem::path(FDI_STORE_PROGRAM).parent_path();
  if (!exists(bin / "fdi-trainer") || !exists(bin / "fdi-simulator")) {
    GTEST_SKIP() << "fdi-trainer or fdi-simulator is not built";
  }
  Page page(FDI_JSON_KEYS);
  Write("quick.toml",
        "name = \"quick\"\n[training]\nmax_rules = 1\nmax_regressors = 2\n"
        "starts = 1\n[scenario]\nparameters = \"paper-operating-point\"\n"
        "excitation = {name = \"operating-point\", amplitude_pct = 8, "
        "period_s = 80}\nduration_s = 300\nseed = 1\n"
        "[[run]]\nsimulate = {duration_s = 900}\n"
        "[[run]]\nsimulate = {}\nfaults = [\"f19\"]\nstrengths = [0.5]\n");
  const std::string id =
      Printed(page, "run",
              "--valve V --duration 300 --parameters paper-operating-point "
              "--fault f19:abrupt@100:strength=0.5 --no-publish --record",
              "fdi-simulator")["sources"][0]["run_id"];
  Printed(page, "train", "--campaign quick.toml", "fdi-trainer");
  Printed(page, "train", "--campaign quick.toml", "fdi-trainer");
  Printed(page, "show", "quick --rules", "fdi-trainer");
  Printed(page, "evaluate", "--model-set quick@1 --runs " + id, "fdi-trainer");
  Printed(page, "compare", "quick@1 quick@2 --all --runs " + id, "fdi-trainer");

  {
    // As if onboarding had made it for the valve.
    ModelStore models(directory_.path() / "models.db",
                      Access::kOccasionalWriter);
    ModelSet set = models.Load("quick");
    set.name = "U";
    set.preset = "onboard";
    models.Save(set);
  }
  const std::string more =
      Printed(page, "run",
              "--valve U --duration 300 --parameters paper-operating-point "
              "--no-publish --record",
              "fdi-simulator")["sources"][0]["run_id"];
  Printed(page, "relearn", "U --runs " + more, "fdi-trainer");

  EXPECT_THAT(page.complaints(), IsEmpty());
  // A set that learnt from labels has episodes, and taught observers where it
  // was onboarded; one of the preset `extended` has windows; limits are
  // compared here without a label, and no fault shows at another strength. What
  // changes no limit is not stored, so that there is no lineage.
  EXPECT_THAT(
      page.Unseen(called_, {"training_episode", "taught_observer", "window",
                            "learnt_episode", "fault_visibility", "parent",
                            "relearnt_set.lineage"}),
      IsEmpty());
}

}  // namespace
}  // namespace fdi::storage
