#include "report/findings/finding.h"

#include <cmath>
#include <tuple>

#include "base/time_units.h"
#include "storage/history/certainty.h"
#include "storage/models/models.h"
#include "storage/models/plant_loops.h"

namespace fdi::findings {
namespace {

double TrustIn(const std::string& answer, const RankFacts& facts) {
  const auto found = facts.labels.find(answer);
  if (found == facts.labels.end()) {
    return 1.0;
  }
  const auto right = static_cast<double>(found->second.right);
  const auto wrong = static_cast<double>(found->second.wrong);
  return (right + 1.0) / (right + wrong + 1.0);
}

}  // namespace

double SeverityPoints(Severity severity) {
  return std::ldexp(1.0, static_cast<int>(severity));
}

double CertaintyFactor(Certainty certainty) {
  switch (certainty) {
    case Certainty::kSure:
      return 1.0;
    case Certainty::kLikely:
      return 0.75;
    case Certainty::kOneOf:
    case Certainty::kNotKnown:
      return 0.5;
    case Certainty::kNotYet:
      break;
  }
  return 0.25;
}

double GradeFactor(std::optional<int> grade) {
  return grade == 1 ? 2.0 : grade == 3 ? 0.5 : 1.0;
}

double Finding::score() const {
  return SeverityPoints(words.severity) * GradeFactor(about.grade) * confidence;
}

bool IsWorse(const Finding& a, const Finding& b) {
  if (a.stands() != b.stands()) {
    return a.stands();
  }
  if (a.is_notice() != b.is_notice()) {
    return b.is_notice();
  }
  if (a.score() != b.score()) {
    return a.score() > b.score();
  }
  if (a.since_ns != b.since_ns) {
    return a.since_ns > b.since_ns;  // Nothing is older than any time.
  }
  return std::tie(a.valve_id, a.episode_id) <
         std::tie(b.valve_id, b.episode_id);
}

Identities ReadIdentities(const std::filesystem::path& models) {
  Identities valves;
  if (std::filesystem::exists(models)) {
    for (const storage::PlantLoop& loop : storage::ModelStore(models).Loops()) {
      valves[loop.name] = static_cast<const ValveIdentity&>(loop);
    }
  }
  return valves;
}

ValveIdentity IdentityOf(const Identities& valves,
                         const std::string& valve_id) {
  const auto found = valves.find(valve_id);
  return found == valves.end() ? ValveIdentity{} : found->second;
}

report::Json AboutJson(const ValveIdentity& valve) {
  const auto text = [](const std::string& stated) {
    return stated.empty() ? report::Json() : report::Json(stated);
  };
  ValveIdentity who = valve;
  who.costs.clear();
  if (who == ValveIdentity{}) {
    return nullptr;
  }
  return {{"description", text(valve.description)},
          {"service", text(valve.service)},
          {"location", text(valve.location)},
          {"document", text(valve.document)},
          {"grade", valve.grade ? report::Json(*valve.grade) : report::Json()}};
}

std::string AboutText(const ValveIdentity& valve) {
  std::string text;
  for (const std::string& part :
       {valve.description, valve.location, valve.document}) {
    text += (text.empty() || part.empty() ? "" : ", ") + part;
  }
  return text;
}

RankFacts ReadRankFacts(storage::History& history,
                        const std::filesystem::path& models,
                        std::int64_t now_ns) {
  storage::EpisodeFilter filter;
  filter.since_ns = now_ns - kPeriodDays * kNsPerDay;
  RankFacts facts;
  facts.labels = history.AlarmFigures(filter, now_ns).faults;
  facts.valves = ReadIdentities(models);
  return facts;
}

Finding FindingOf(const storage::Episode& episode,
                  const report::FaultTexts& texts, const RankFacts& facts) {
  Finding finding;
  finding.valve_id = episode.valve_id;
  finding.host = episode.host;
  finding.monitor = episode.monitor;
  finding.kind = episode.notice ? "notice" : "episode";
  finding.fault = episode.fault;
  finding.words = texts.Words(episode.fault.value_or("unknown"),
                              episode.strength, episode.priority);
  if (const auto no_name = storage::NoNameText(episode); !no_name.empty()) {
    finding.words.name = no_name;
  }
  finding.layer = episode.layer;
  finding.certainty = storage::CertaintyOf(episode);
  finding.look_alikes = storage::LookAlikesOf(episode);
  finding.witness = storage::WitnessText(episode);
  if (IsNamed(episode)) {
    finding.strength = episode.strength;
  }
  finding.about = IdentityOf(facts.valves, episode.valve_id);
  finding.since_ns = episode.detected_ns;
  finding.unconfirmed_ns = episode.unconfirmed_ns;
  finding.ended_ns = storage::ReturnedNs(episode);
  finding.last_ns = episode.trace_end_ns.value_or(episode.detected_ns);
  finding.episode_id = episode.episode_id;
  finding.episodes = 1;
  finding.acked_by = episode.acked_by;
  finding.label = episode.label;
  finding.confirmed = episode.label && *episode.label != "false";
  if (finding.confirmed) {
    finding.look_alikes.clear();
  }
  finding.confidence = finding.confirmed
                           ? 1.0
                           : CertaintyFactor(*finding.certainty) *
                                 TrustIn(episode.fault.value_or(""), facts);
  return finding;
}

}  // namespace fdi::findings
