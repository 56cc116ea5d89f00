#include "planner/fleet_report.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <string_view>

#include "base/error.h"
#include "base/time_text.h"
#include "diagnosis/model/severity.h"
#include "planner/health_view.h"
#include "planner/work_list.h"
#include "report/text_table.h"
#include "storage/history/certainty.h"
#include "storage/history/history_reader.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

// The report is made in two steps. `Fleet` puts what the history and the caller
// know into one document of JSON, which is also what `report.json` keeps for
// the comparison with the next report. AddViews() then shows parts of that
// document to people and finds nothing new. docs/reports.md explains the score,
// docs/json.md the keys.
namespace fdi::planner {
namespace {

using report::Column;
using report::Format;
using report::Json;
using report::Tone;
using storage::Episode;

// An audit has no decision factor: these are the confidence of its verdicts.
constexpr double kSureAudit = 0.9;
constexpr double kLikelyAudit = 0.5;
// A loop that was judged for a smaller share of the time is listed as such.
constexpr double kMostlyJudged = 0.5;

// The finding of the fault catalogue that a verdict of the audit is, by its
// name; empty: nothing to do.
std::string FindingOf(const std::string& verdict) {
  constexpr std::array<std::pair<std::string_view, const char*>, 6> kFindings{{
      {"no_response", "no_response"},
      {"stiction", "stiction"},
      {"frozen", "reading_frozen"},
      {"saturated", "output_saturated"},
      {"tuning", "oscillation_tuning"},
      {"external", "oscillation_external"},
  }};
  for (const auto& [name, finding] : kFindings) {
    if (verdict == name) {
      return finding;
    }
  }
  return "";
}

// The catalogue has no finding for it: it is a matter of the historian.
constexpr const char* kQuantised = "quantised";
report::FaultWords QuantisedWords() {
  report::FaultWords words;
  words.name = "PV has too few values";
  words.check =
      "Check the range of the transmitter and the compression of the "
      "historian.";
  words.discipline = "instrument";
  return words;
}

// Why a valve was not judged, by QualityName().
std::string QualityText(const std::string& quality) {
  constexpr std::array<std::pair<std::string_view, const char*>, 7> kTexts{{
      {"STALE", "no data came"},
      {"BAD_INPUT",
       "readings were missing, bad, implausible or in another "
       "unit"},
      {"SETTLING", "its observers were settling"},
      {"INHIBITED", "its loop was not in automatic"},
      {"UNCOVERED", "it worked where its model set was not trained"},
      {"MODEL_UNSUITED", "its model set no longer fits it"},
      {"UNASSIGNED",
       "it has no model set, and no window of its loop was judged"},
  }};
  for (const auto& [name, text] : kTexts) {
    if (quality == name) {
      return text;
    }
  }
  return quality;
}

// How much a loop counts by its grade. A loop without one counts as grade 2, so
// a plant that states no grades is ranked by severity and confidence alone.
double GradeFactor(std::optional<int> grade) {
  return grade == 1 ? 2.0 : grade == 3 ? 0.5 : 1.0;
}

// One line of the report: what is wrong with a loop, or with several loops that
// share a cause or a period.
struct Finding {
  std::vector<std::string> valves;
  std::string shares;  // What they have in common; empty: one loop.
  std::string found_by;
  std::string fault;  // Of the catalogue, or a verdict of the audit.
  std::string name;
  Severity severity{Severity::kLow};
  std::optional<int> grade;
  std::string certainty;
  double confidence{0.0};
  std::string who;
  std::string check;
  std::string why;
  bool open{true};
  std::int64_t since_ns{0};
  int episodes{0};
  std::string episode_id;
  std::optional<std::string> acked_by;
  std::optional<std::string> label;

  double score() const {
    return SeverityPoints(severity) * GradeFactor(grade) * confidence;
  }
};

// The order of the report. Equal scores are decided by what is open and then by
// the ids, so that the same facts give the same report line by line.
bool IsWorse(const Finding& a, const Finding& b) {
  if (a.score() != b.score()) {
    return a.score() > b.score();
  }
  if (a.open != b.open) {
    return a.open;
  }
  return a.valves < b.valves;
}

// Time by quality of one valve.
struct JudgedTime {
  double hours{0.0};
  double live_hours{0.0};
  std::string worst;  // The quality other than LIVE that lasted longest.
  double worst_hours{0.0};

  double share() const { return hours > 0.0 ? live_hours / hours : 0.0; }
};

// Everything that the report puts together.
class Fleet {
 public:
  Fleet(storage::History* history, const report::FaultTexts& texts,
        const FleetQuery& query)
      : history_(history), texts_(texts), query_(query) {
    for (const FleetLoop& loop : query.loops) {
      loops_[loop.valve_id] = loop;
    }
    for (const std::string& valve : query.judged_now) {
      Know(valve);
      named_.insert(valve);
    }
    // The order matters. FindAudits() looks for the named fault of its loop,
    // and MergeShared() needs the findings of both. They are sorted when none
    // will be joined with another any more.
    if (history != nullptr) {
      ReadTimes();
      FindFaults();
    }
    for (const auto& [loop, reason] : query.not_audited) {
      Know(loop);
    }
    FindAudits();
    MergeShared();
    std::ranges::stable_sort(findings_, IsWorse);
    for (const Finding& finding : findings_) {
      for (const std::string& valve : finding.valves) {
        Know(valve);
      }
    }
  }

  Json Document() const;

 private:
  // A loop that nobody has listed, but which was heard, recorded or found,
  // counts as one of the plant: the coverage must not leave it out.
  void Know(const std::string& valve) {
    loops_.try_emplace(valve, FleetLoop{valve});
  }
  std::optional<int> GradeOf(const std::string& valve) const {
    const auto loop = loops_.find(valve);
    return loop == loops_.end() ? std::nullopt : loop->second.grade;
  }

  void ReadTimes();
  void FindFaults();
  void FindAudits();
  void MergeShared();
  void Merge(const std::string& shares,
             const std::function<bool(const Finding&)>& belongs);
  std::map<std::string, Episode> Episodes() const;

  bool IsAudited(const std::string& valve) const {
    return std::ranges::find(query_.audits, valve, &FleetAudit::loop) !=
           query_.audits.end();
  }
  bool HasNames(const std::string& valve) const {
    return named_.contains(valve);
  }
  std::string WhyNotJudged(const std::string& valve) const;

  Json FindingsJson(std::size_t from, std::size_t to) const;
  Json SharedJson() const;
  Json UnjudgedJson() const;
  Json ShelvedJson() const;
  Json LoopsJson() const;
  Json CoverageJson() const;

  storage::History* history_;
  const report::FaultTexts& texts_;
  const FleetQuery& query_;
  std::map<std::string, FleetLoop> loops_;
  std::map<std::string, JudgedTime> times_;
  std::set<std::string, std::less<>> named_;  // Judged by a model set.
  std::vector<Finding> findings_;
};

// Adds up the hours of each valve. Of the qualities other than LIVE the one
// that lasted longest is kept, which says why the valve was not judged.
void Fleet::ReadTimes() {
  storage::EpisodeFilter filter;
  filter.since_ns = query_.since_ns;
  for (const storage::CoverageTime& time : history_->Coverage(filter)) {
    Know(time.valve_id);
    JudgedTime& judged = times_[time.valve_id];
    judged.hours += time.hours;
    if (time.quality == QualityName(Quality::kLive)) {
      judged.live_hours += time.hours;
      named_.insert(time.valve_id);
    } else if (time.hours > judged.worst_hours) {
      judged.worst_hours = time.hours;
      judged.worst = time.quality;
    }
  }
}

// Those of the period, and open ones whatever their age.
std::map<std::string, Episode> Fleet::Episodes() const {
  std::map<std::string, Episode> episodes;
  const auto add = [&](const storage::EpisodeFilter& filter) {
    for (Episode& episode : history_->List(filter)) {
      const std::string id = episode.episode_id;
      episodes.insert_or_assign(id, std::move(episode));
    }
  };
  storage::EpisodeFilter filter;
  filter.until_ns = query_.since_ns;
  filter.state = storage::EpisodeState::kOpen;
  add(filter);
  filter = {};
  filter.since_ns = query_.since_ns;
  add(filter);
  return episodes;
}

// A loop has one finding: of its faults the one with the largest product of
// severity and confidence, and of equal ones one that still lasts. Age and
// repetition, which weigh in the work list that the faults are read from, are
// left out: a report says what is worst, not what to open first.
void Fleet::FindFaults() {
  WorkQuery work;
  work.since_ns = query_.since_ns;
  work.options.now_ns = query_.now_ns;
  const std::map<std::string, Episode> episodes = Episodes();
  for (const auto& [id, episode] : episodes) {
    if (episode.layer != LayerName(Layer::kAudit)) {
      named_.insert(episode.valve_id);
    }
  }
  for (const WorkRow& row : ReadWorkList(*history_, texts_, work)) {
    if (row.work.faults.empty()) {
      continue;
    }
    const auto weight = [](const FaultReason& reason) {
      return SeverityPoints(reason.words.severity) * ConfidenceOf(reason);
    };
    const FaultReason& reason = *std::ranges::max_element(
        row.work.faults, [&](const FaultReason& a, const FaultReason& b) {
          return weight(a) != weight(b)
                     ? weight(a) < weight(b)
                     : a.ended_ns.has_value() && !b.ended_ns.has_value();
        });
    Finding finding;
    finding.valves = {row.work.valve_id};
    finding.found_by = "named faults";
    finding.fault = reason.fault;
    finding.name = reason.words.name;
    finding.severity = reason.words.severity;
    finding.grade = GradeOf(row.work.valve_id);
    finding.confidence = ConfidenceOf(reason);
    finding.who = reason.words.discipline;
    finding.check = reason.words.check;
    finding.why = row.why;
    finding.open = !reason.ended_ns;
    finding.since_ns = reason.detected_ns;
    finding.episodes = reason.episodes;
    finding.episode_id = reason.episode_id;
    if (const auto episode = episodes.find(reason.episode_id);
        episode != episodes.end()) {
      finding.certainty = CertaintyName(storage::CertaintyOf(episode->second));
      finding.acked_by = episode->second.acked_by;
      finding.label = episode->second.label;
    }
    findings_.push_back(std::move(finding));
  }
}

// Of each loop the weightiest verdict; for a loop with a named fault, too, the
// weightier of both, and the other as one more reason.
void Fleet::FindAudits() {
  std::map<std::string, Finding> by_loop;
  for (const FleetAudit& audit : query_.audits) {
    Know(audit.loop);
    const std::string name = FindingOf(audit.verdict);
    if (name.empty() && audit.verdict != kQuantised) {
      continue;
    }
    const report::FaultWords words =
        name.empty() ? QuantisedWords()
                     : texts_.Words(name, audit.band_pct.value_or(0.0) / 100.0);
    Finding finding;
    finding.valves = {audit.loop};
    finding.found_by = "audit";
    finding.fault = audit.verdict;
    finding.name = words.name;
    finding.severity = words.severity;
    finding.grade = GradeOf(audit.loop);
    finding.certainty = audit.sure ? "sure" : "likely";
    finding.confidence = audit.sure ? kSureAudit : kLikelyAudit;
    finding.who = words.discipline;
    finding.check = words.check;
    finding.why = audit.reason;
    if (audit.band_pct) {
      finding.why +=
          "; band of " + report::FormatNumber(*audit.band_pct, 1) + " % of OP";
    }
    finding.since_ns = audit.start_ns;
    const auto [place, is_new] = by_loop.try_emplace(audit.loop, finding);
    if (!is_new && IsWorse(finding, place->second)) {
      place->second = finding;
    }
  }
  for (auto& [loop, finding] : by_loop) {
    const auto known = std::ranges::find_if(
        findings_,
        [&loop = loop](const Finding& f) { return f.valves.front() == loop; });
    if (known == findings_.end()) {
      findings_.push_back(std::move(finding));
      continue;
    }
    if (IsWorse(finding, *known)) {
      std::swap(finding, *known);
    }
    known->why += "; " + finding.found_by + ": " + finding.name + " (" +
                  finding.certainty + "), " + finding.why;
  }
}

// The findings that belong together become the worst of them, with the loops
// of all.
void Fleet::Merge(const std::string& shares,
                  const std::function<bool(const Finding&)>& belongs) {
  std::vector<Finding> members;
  std::erase_if(findings_, [&](const Finding& finding) {
    const bool is = finding.shares.empty() && belongs(finding);
    if (is) {
      members.push_back(finding);
    }
    return is;
  });
  if (members.empty()) {
    return;
  }
  std::ranges::stable_sort(members, IsWorse);
  Finding all = members.front();
  std::set<std::string> valves;
  all.episodes = 0;
  for (const Finding& member : members) {
    valves.insert(member.valves.begin(), member.valves.end());
    all.episodes += member.episodes;
    all.open = all.open || member.open;
    all.since_ns = std::min(all.since_ns, member.since_ns);
  }
  if (valves.size() > 1) {
    all.shares = shares;
    all.valves.assign(valves.begin(), valves.end());
  }
  findings_.push_back(std::move(all));
}

// Common causes come first: what was joined has `shares` set and is left alone
// afterwards, so a loop with both a cause and a period is listed by its cause.
void Fleet::MergeShared() {
  for (const storage::CommonCause& cause : query_.causes) {
    // The finding may be a newer episode with the same fault.
    Merge("cause: " + cause.group, [&cause](const Finding& finding) {
      return std::ranges::any_of(cause.members, [&](const auto& member) {
        return member.episode_id == finding.episode_id ||
               (member.valve_id == finding.valves.front() &&
                member.fault == finding.fault);
      });
    });
  }
  for (const FleetPeriod& period : query_.periods) {
    Merge("period: " + report::FormatNumber(period.period_s, 0) + " s",
          [&period](const Finding& finding) {
            return finding.found_by == "audit" &&
                   std::ranges::find(period.loops, finding.valves.front()) !=
                       period.loops.end();
          });
  }
}

// The quality that lasted longest, or else what the plant's table says about
// the record; and, with either, why the audit could not judge the loop.
std::string Fleet::WhyNotJudged(const std::string& valve) const {
  const auto time = times_.find(valve);
  std::string why;
  if (time != times_.end() && !time->second.worst.empty()) {
    why = QualityText(time->second.worst);
  } else {
    const std::string& finding = loops_.at(valve).finding;
    why = finding.empty() ? "no data came" : finding;
  }
  for (const auto& [loop, reason] : query_.not_audited) {
    if (loop == valve) {
      return why + "; audit: " + reason;
    }
  }
  return why;
}

Json OrNull(const std::optional<std::string>& text) {
  return text && !text->empty() ? Json(*text) : Json();
}

Json FindingJson(const Finding& f, std::size_t rank) {
  return {{"rank", rank},
          {"valve_ids", f.valves},
          {"shares", OrNull(f.shares)},
          {"found_by", f.found_by},
          {"fault", f.fault},
          {"name", f.name},
          {"severity", SeverityName(f.severity)},
          {"severity_points", SeverityPoints(f.severity)},
          {"grade", f.grade ? Json(*f.grade) : Json()},
          {"grade_factor", GradeFactor(f.grade)},
          {"certainty", OrNull(f.certainty)},
          {"confidence", SixDigits(f.confidence)},
          {"score", SixDigits(f.score())},
          {"open", f.open},
          {"since_utc", FormatTime(f.since_ns, true)},
          {"episodes", f.episodes},
          {"discipline", f.who},
          {"check", f.check},
          {"why", f.why},
          {"episode_id", OrNull(f.episode_id)},
          {"acked_by", OrNull(f.acked_by)},
          {"label", OrNull(f.label)}};
}

Json Fleet::FindingsJson(std::size_t from, std::size_t to) const {
  Json list = Json::array();
  for (std::size_t i = from; i < std::min(to, findings_.size()); ++i) {
    list.push_back(FindingJson(findings_[i], i + 1));
  }
  return list;
}

Json Fleet::SharedJson() const {
  Json list = Json::array();
  for (const storage::CommonCause& cause : query_.causes) {
    std::set<std::string> valves;
    std::set<std::string> faults;
    for (const storage::CauseMember& member : cause.members) {
      valves.insert(member.valve_id);
      faults.insert(member.fault);
    }
    list.push_back(
        {{"shares", "cause"},
         {"group", cause.group},
         {"period_s", nullptr},
         {"valve_ids", valves},
         {"faults", faults},
         {"since_utc", FormatTime(cause.opened_ns, true)},
         {"ended_utc",
          cause.ended_ns ? Json(FormatTime(*cause.ended_ns, true)) : Json()}});
  }
  for (const FleetPeriod& period : query_.periods) {
    list.push_back({{"shares", "period"},
                    {"group", nullptr},
                    {"period_s", SixDigits(period.period_s)},
                    {"valve_ids", period.loops},
                    {"faults", Json::array()},
                    {"since_utc", nullptr},
                    {"ended_utc", nullptr}});
  }
  return list;
}

// Loops that nothing watched, and loops with named faults that were judged for
// less than half of the time in which they were heard. A loop that is only
// audited has no such share: the audit judges windows, not hours.
Json Fleet::UnjudgedJson() const {
  Json list = Json::array();
  for (const auto& [valve, loop] : loops_) {
    const auto time = times_.find(valve);
    const double share = time == times_.end() ? 0.0 : time->second.share();
    const bool watched = HasNames(valve) || IsAudited(valve);
    const bool partly =
        time != times_.end() && HasNames(valve) && share < kMostlyJudged;
    if (!watched || partly) {
      list.push_back({{"valve_id", valve},
                      {"judged_share", SixDigits(share)},
                      {"reason", WhyNotJudged(valve)}});
    }
  }
  return list;
}

Json Fleet::ShelvedJson() const {
  Json list = Json::array();
  if (history_ == nullptr) {
    return list;
  }
  for (const storage::Shelf& shelf : history_->Shelves(query_.now_ns)) {
    if (!IsActive(shelf, query_.now_ns)) {
      continue;
    }
    list.push_back({{"valve_id", shelf.valve_id},
                    {"fault", OrNull(shelf.fault)},
                    {"until_utc", FormatTime(shelf.until_ns, true)},
                    {"who", shelf.who},
                    {"comment", OrNull(shelf.comment)}});
  }
  return list;
}

Json Fleet::LoopsJson() const {
  Json list = Json::array();
  for (const auto& [valve, loop] : loops_) {
    const bool names = HasNames(valve);
    const bool audit = IsAudited(valve);
    const auto time = times_.find(valve);
    const JudgedTime judged =
        time == times_.end() ? JudgedTime{} : time->second;
    list.push_back({{"valve_id", valve},
                    {"grade", loop.grade ? Json(*loop.grade) : Json()},
                    {"watched_by", names && audit ? "named faults and audit"
                                   : names        ? "named faults"
                                   : audit        ? "audit"
                                                  : "nothing"},
                    {"seen_h", SixDigits(judged.hours)},
                    {"judged_h", SixDigits(judged.live_hours)}});
  }
  return list;
}

// Each loop counts once: one that is both judged for named faults and audited
// counts among the named faults, so the three numbers add up to all loops.
Json Fleet::CoverageJson() const {
  std::size_t names = 0;
  std::size_t audit = 0;
  for (const auto& [valve, loop] : loops_) {
    names += HasNames(valve) ? 1 : 0;
    audit += !HasNames(valve) && IsAudited(valve) ? 1 : 0;
  }
  return {{"loops", loops_.size()},
          {"named_faults", names},
          {"audit", audit},
          {"nothing", loops_.size() - names - audit}};
}

// ---- Changes

// What a report said about one loop.
struct Said {
  std::string fault;
  std::string name;
  std::string severity;
  double points{0.0};
  bool known{false};  // It is among the loops.
  bool unjudged{false};
};

// Reads a document instead of a Fleet, because of the last report there is only
// the document, and both sides of a comparison should be read in the same way.
std::map<std::string, Said> SaidIn(const Json& document) {
  std::map<std::string, Said> said;
  for (const char* part : {"worst", "others"}) {
    for (const Json& finding : document.at(part)) {
      for (const Json& valve : finding.at("valve_ids")) {
        Said& of = said[valve.get<std::string>()];
        of.fault = finding.at("fault");
        of.name = finding.at("name");
        of.severity = finding.at("severity");
        of.points = finding.at("severity_points");
      }
    }
  }
  for (const Json& loop : document.at("loops")) {
    said[loop.at("valve_id").get<std::string>()].known = true;
  }
  for (const Json& loop : document.at("unjudged")) {
    said[loop.at("valve_id").get<std::string>()].unjudged = true;
  }
  return said;
}

std::string SaidText(const Said& said) {
  return said.name.empty() ? "" : said.name + ", " + said.severity;
}

// How a loop has changed; empty: not, or not enough to say. What was found and
// whether the loop was judged are compared one by one, so a loop may have two
// changes. Worse and better are by severity: a change of confidence is none.
std::vector<std::string> ChangesOf(const Said& before, const Said& now) {
  std::vector<std::string> changes;
  if (before.fault.empty() != now.fault.empty()) {
    changes.emplace_back(before.fault.empty() ? "new" : "gone");
  } else if (before.points != now.points) {
    changes.emplace_back(before.points < now.points ? "worse" : "better");
  } else if (before.fault != now.fault) {
    changes.emplace_back("other finding");
  }
  if (!now.known) {
    changes.emplace_back("no longer known");
  } else if (now.unjudged && !before.unjudged) {
    changes.emplace_back(before.known ? "no longer judged"
                                      : "new and not judged");
  } else if (before.unjudged && !now.unjudged) {
    changes.emplace_back("judged again");
  }
  return changes;
}

// Whatever is wrong with the last document ends as one DataError: it may be a
// file of the user that happens to have its name, which must not be replaced.
Json ChangesJson(const Json& last, const std::string& file, const Json& now) {
  if (last.is_null()) {
    return {};
  }
  try {
    std::map<std::string, Said> before = SaidIn(last);
    std::map<std::string, Said> after = SaidIn(now);
    std::set<std::string> valves;
    for (const auto& [valve, said] : before) {
      valves.insert(valve);
    }
    for (const auto& [valve, said] : after) {
      valves.insert(valve);
    }
    Json list = Json::array();
    for (const std::string& valve : valves) {
      for (const std::string& change : ChangesOf(before[valve], after[valve])) {
        list.push_back({{"valve_id", valve},
                        {"change", change},
                        {"before", OrNull(SaidText(before[valve]))},
                        {"now", OrNull(SaidText(after[valve]))}});
      }
    }
    Json coverage;
    for (const char* key : {"loops", "named_faults", "audit", "nothing"}) {
      coverage[key] = last.at("coverage").at(key).get<std::size_t>();
    }
    return {{"last_utc", last.at("made_utc").get<std::string>()},
            {"file", file},
            {"loops", list},
            {"coverage", coverage}};
  } catch (const Json::exception& error) {
    throw DataError(file + " is no report of this program (" + error.what() +
                    "); move it away, or name another --output");
  }
}

Json Fleet::Document() const {
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  Json json = {{"made_utc", FormatTime(query_.now_ns, true)},
               {"since_utc", FormatTime(query_.since_ns, true)},
               {"software", query_.software},
               {"coverage", CoverageJson()},
               {"worst", FindingsJson(0, query_.top)},
               {"others", FindingsJson(query_.top, kAll)},
               {"shared", SharedJson()},
               {"unjudged", UnjudgedJson()},
               {"shelved", ShelvedJson()},
               {"changes", nullptr},
               {"loops", LoopsJson()}};
  json["changes"] =
      ChangesJson(query_.last.value_or(Json()), query_.last_file, json);
  return json;
}

// ---- What people see

Column Text(std::string heading, std::function<std::string(const Json&)> text,
            std::string meaning = "") {
  Column column;
  column.heading = std::move(heading);
  column.text = std::move(text);
  column.meaning = std::move(meaning);
  return column;
}

std::string Or(const Json& value, const char* otherwise) {
  return value.is_null() ? otherwise : value.get<std::string>();
}

Column LoopsColumn() {
  Column column = Text("loops", [](const Json& row) {
    std::string text;
    for (const Json& valve : row["valve_ids"]) {
      text += (text.empty() ? "" : ", ") + valve.get<std::string>();
    }
    // Of a finding; of what is shared, the kind.
    return row.contains("rank") && !row["shares"].is_null()
               ? text + " (" + row["shares"].get<std::string>() + ")"
               : text;
  });
  column.wraps = true;
  return column;
}

Column SeverityColumn() {
  Column column = Text(
      "severity",
      [](const Json& row) {
        return row["severity"].get<std::string>() + " · " +
               report::FormatNumber(row["severity_points"].get<double>(), 0);
      },
      "by the catalogue at the strength of now: low 1, medium 2, high 4, "
      "critical 8");
  column.tone = [](const Json& row) {
    const double points = row["severity_points"];
    return points >= SeverityPoints(Severity::kHigh)     ? Tone::kAlarm
           : points >= SeverityPoints(Severity::kMedium) ? Tone::kWarning
                                                         : Tone::kPlain;
  };
  return column;
}

// The columns of both lists. Each factor of the score stands beside what it was
// made from ("high · 4"), so that a reader can multiply them by hand.
std::vector<Column> FindingColumns() {
  return {{"rank", "rank"},
          LoopsColumn(),
          Text("finding",
               [](const Json& row) {
                 return row["name"].get<std::string>() + " (" +
                        row["fault"].get<std::string>() + ")";
               }),
          SeverityColumn(),
          Text(
              "grade",
              [](const Json& row) {
                const Json& grade = row["grade"];
                return (grade.is_null() ? "- · " : grade.dump() + " · ") +
                       report::FormatNumber(row["grade_factor"].get<double>(),
                                            1);
              },
              "how much the plant depends on the loop: grade 1 counts 2, grade "
              "2 or none 1, grade 3 a half"),
          Text(
              "confidence",
              [](const Json& row) {
                return Or(row["certainty"], "-") + " · " +
                       report::FormatNumber(row["confidence"].get<double>(), 2);
              },
              "1 if a label confirms it, else the largest decision factor, "
              "lessened where labels called this answer wrong; of an audit 0.9 "
              "if sure, 0.5 if likely"),
          {.heading = "score",
           .key = "score",
           .decimals = 2,
           .meaning = "severity times grade times confidence"},
          Text("state", [](const Json& row) {
            return std::string(row["found_by"] == "audit" ? "audit"
                               : row["open"].get<bool>()  ? "open"
                                                          : "ended");
          })};
}

std::vector<Column> WorstColumns() {
  std::vector<Column> columns = FindingColumns();
  const auto wide = [](Column column, int spare) {
    column.wraps = true;
    column.spare = spare;
    return column;
  };
  columns.push_back(wide(Text("what to do",
                              [](const Json& row) {
                                return row["discipline"].get<std::string>() +
                                       ": " + row["check"].get<std::string>();
                              }),
                         4));
  columns.push_back(wide(Text("seen by, label",
                              [](const Json& row) {
                                return Or(row["acked_by"], "-") + ", " +
                                       Or(row["label"], "-");
                              }),
                         1));
  columns.push_back(wide(Text("why",
                              [](const Json& row) {
                                return row["why"].get<std::string>() +
                                       (row["episode_id"].is_null()
                                            ? ""
                                            : "; episode " +
                                                  Or(row["episode_id"], ""));
                              }),
                         3));
  for (Column& column : columns) {
    column.wraps = column.wraps || column.heading == "finding";
  }
  return columns;
}

std::string CoverageText(const Json& coverage) {
  const auto count = [&coverage](const char* key) {
    return coverage[key].get<std::size_t>();
  };
  const std::size_t loops = count("loops");
  if (loops == 0) {
    return "No loop is known: neither valves with a model set, nor a plant's "
           "table, nor a history, nor runs.";
  }
  return std::to_string(loops - count("nothing")) + " of " +
         std::to_string(loops) + (loops == 1 ? " loop is" : " loops are") +
         " watched: " + std::to_string(count("named_faults")) +
         " for named faults, " + std::to_string(count("audit")) +
         " by the audit only, " + std::to_string(count("nothing")) +
         " by nothing.";
}

// A bar of three parts, the colours of which can be told apart by the
// colour-blind, in light and dark.
std::string CoverageBar(const Json& coverage) {
  constexpr double kWidth = 600.0;
  const double loops = coverage["loops"];
  std::ostringstream svg;
  svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"600\" "
         "height=\"22\" viewBox=\"0 0 600 22\" role=\"img\" "
         "aria-label=\"named faults, audit, nothing\">";
  double x = 0.0;
  for (const auto& [key, colour] : {std::pair("named_faults", "#0072b2"),
                                    {"audit", "#56b4e9"},
                                    {"nothing", "#8c8c8c"}}) {
    const double width = kWidth * coverage[key].get<double>() / loops;
    svg << "<rect x=\"" << x << "\" y=\"0\" width=\"" << width
        << "\" height=\"22\" fill=\"" << colour << "\"/>";
    x += width;
  }
  svg << "</svg>\n";
  return svg.str();
}

void AddChanges(report::Report& page) {
  const Json& changes = page.document["changes"];
  page.Heading("Changes since the last report");
  if (changes.is_null()) {
    page.Line("There is no earlier report in the output folder.");
    return;
  }
  page.Line("The last report is of " + changes["last_utc"].get<std::string>() +
            " (" + changes["file"].get<std::string>() +
            "). Then: " + CoverageText(changes["coverage"]));
  page.Table("changes/loops",
             {{"loop", "valve_id"},
              {"change", "change"},
              {.heading = "before", .key = "before", .wraps = true},
              {.heading = "now", .key = "now", .wraps = true}},
             "Nothing has changed.");
}

void AddViews(report::Report& page) {
  const Json& document = page.document;
  page.Fields("", {{"made", "made_utc", Format::kTime},
                   {"period from", "since_utc", Format::kTime},
                   {"software", "software"}});
  page.Line(CoverageText(document["coverage"]));
  if (document["coverage"]["loops"] != 0) {
    page.Picture("coverage",
                 "What watches the loops: named faults (dark blue), audit "
                 "(light blue), nothing (grey)",
                 CoverageBar(document["coverage"]));
  }
  page.Heading("The worst first");
  page.Table("worst", WorstColumns(), "Nothing was found.");
  if (!document["others"].empty()) {
    page.Heading("The other findings");
    page.Table("others", FindingColumns());
  }
  page.Heading("Loops that share a cause or a period");
  page.Table("shared",
             {{"share", "shares"},
              {"group", "group"},
              {"period [s]", "period_s", Format::kPlain, 0},
              {"faults", "faults"},
              {"since", "since_utc", Format::kTime},
              {"ended", "ended_utc", Format::kTime},
              LoopsColumn()},
             "None.");
  AddChanges(page);
  page.Heading("What could not be judged, and why");
  page.Table("unjudged",
             {{"loop", "valve_id"},
              {"judged", "judged_share", Format::kPercent},
              {.heading = "mostly because", .key = "reason", .wraps = true}},
             "Every loop was judged for at least half of the time.");
  if (!document["shelved"].empty()) {
    page.Heading("Shelved, and therefore not among the findings");
    page.Table("shelved",
               {{"loop", "valve_id"},
                {"fault", "fault"},
                {"until", "until_utc", Format::kTime},
                {"by", "who"},
                {.heading = "comment", .key = "comment", .wraps = true}});
  }
  page.Csv("worst", {"rank", "valve_ids", "fault", "name", "severity",
                     "severity_points", "grade", "grade_factor", "certainty",
                     "confidence", "score", "open", "since_utc", "discipline",
                     "check", "acked_by", "label", "episode_id"});
}

}  // namespace

std::vector<FleetLoop> LoopsOf(const std::filesystem::path& models) {
  std::vector<FleetLoop> loops;
  if (!std::filesystem::exists(models)) {
    return loops;
  }
  storage::ModelStore store(models);
  for (const storage::PlantLoop& row : store.Loops()) {
    FleetLoop& loop = loops.emplace_back();
    loop.valve_id = row.name;
    loop.grade = row.grade;
    // Of other rows the finding is a verdict, or how the set was made.
    if (row.state == storage::LoopState::kRefused ||
        row.finding.starts_with("not judged")) {
      loop.finding = row.finding;
    }
  }
  for (const storage::ValveEntry& entry : store.Valves()) {
    const bool known = std::ranges::find(loops, entry.pattern,
                                         &FleetLoop::valve_id) != loops.end();
    if (!known && entry.pattern.find_first_of("*?[") == std::string::npos) {
      loops.push_back({entry.pattern});
    }
  }
  return loops;
}

std::vector<storage::CommonCause> CausesOf(const std::filesystem::path& history,
                                           std::int64_t since_ns) {
  storage::HistoryReader reader(history);
  storage::CauseFilter filter;
  // Open causes count however old they are. `until_ns` keeps this query to
  // those from before the period, so that none is read twice.
  filter.open_only = true;
  filter.until_ns = since_ns;
  std::vector<storage::CommonCause> causes =
      storage::ReadCommonCauses(reader.database(), filter);
  filter = {};
  filter.since_ns = since_ns;
  std::ranges::move(storage::ReadCommonCauses(reader.database(), filter),
                    std::back_inserter(causes));
  return causes;
}

report::Report FleetReport(storage::History* history,
                           const report::FaultTexts& texts,
                           const FleetQuery& query) {
  report::Report page;
  page.document = Fleet(history, texts, query).Document();
  AddViews(page);
  return page;
}

}  // namespace fdi::planner
