#include "bench/study/studies.h"

#include <algorithm>
#include <sstream>

#include "base/error.h"
#include "base/mutex.h"
#include "base/parallel_for.h"
#include "bench/study/evaluation_report.h"
#include "bench/study/wilson_interval.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/progress.h"
#include "report/stop_signals.h"
#include "report/text_table.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/campaign/file_runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/statistics.h"

namespace fdi::trainer::study {
namespace {

using report::Align;
using report::FormatNumber;
using report::Json;

Json JsonOf(const LeftOutFault& f) {
  return {{"runs", f.runs},
          {"detected", f.detected},
          {"unknown", f.unknown},
          {"wrongly_named", f.wrongly_named},
          {"as_look_alike", f.as_look_alike}};
}

// "f6|f18 x2, f3"
std::string NamedText(const Json& left_out) {
  std::string text;
  for (const auto& [set, count] : left_out.at("named").items()) {
    text += (text.empty() ? "" : ", ") + set;
    text += count > 1 ? " x" + count.dump() : "";
  }
  return text;
}

// The scenarios of one repetition have a seed each, from that of the campaign
// upwards, so the seeds of the next repetition begin at a multiple of 100 that
// lies beyond them.
std::uint64_t SeedStep(std::size_t runs) {
  constexpr std::uint64_t kMinSeedStep = 100;
  return (runs + kMinSeedStep - 1) / kMinSeedStep * kMinSeedStep;
}

std::vector<CampaignRun> SimulatedScenarios(
    const std::filesystem::path& campaign, std::uint64_t offset) {
  std::vector<CampaignRun> runs = ValidationRuns(campaign, offset);
  for (const CampaignRun& run : runs) {
    if (!std::holds_alternative<SimulatedRun>(run.source)) {
      throw ConfigError("seeds repeats simulated runs; " + RunLabel(run) +
                        " of " + campaign.string() + " is not simulated");
    }
  }
  return runs;
}

// "0.98 [0.95, 0.99]"
std::string ShareText(int count, int runs) {
  const Interval interval = WilsonInterval(count, runs);
  return runs == 0 ? "-"
                   : FormatNumber(static_cast<double>(count) / runs, 3) + " [" +
                         FormatNumber(interval.low, 3) + ", " +
                         FormatNumber(interval.high, 3) + "]";
}

// "36.6 (36 to 37)": mean and range over the seeds.
std::string PerSeed(const SeedStudy& study, int SeedCounts::*field) {
  double sum = 0.0;
  int least = study.repetitions.front().*field;
  int most = least;
  for (const SeedCounts& counts : study.repetitions) {
    sum += counts.*field;
    least = std::min(least, counts.*field);
    most = std::max(most, counts.*field);
  }
  return FormatNumber(sum / static_cast<double>(study.repetitions.size()), 2) +
         " (" + std::to_string(least) + " to " + std::to_string(most) + ")";
}

std::string SharesTable(const SeedStudy& study) {
  report::TextTable table({{"fault"},
                           {"runs", Align::kRight},
                           {"detected [95 %]"},
                           {"set has the fault [95 %]"},
                           {"set is the fault [95 %]"}});
  const auto add = [&](const std::string& name, const SeedCounts& counts) {
    table.AddRow({name, std::to_string(counts.runs),
                  ShareText(counts.detected, counts.runs),
                  ShareText(counts.contained, counts.runs),
                  ShareText(counts.exact, counts.runs)});
  };
  for (const SeedCounts& counts : study.faults) {
    add(FaultName(counts.fault), counts);
  }
  add("all", study.total);
  table.AddRow({"per seed", std::to_string(study.repetitions.front().runs),
                PerSeed(study, &SeedCounts::detected),
                PerSeed(study, &SeedCounts::contained),
                PerSeed(study, &SeedCounts::exact)});
  return table.Text();
}

Json JsonOf(const SeedCounts& counts) {
  Json json{{"runs", counts.runs}};
  for (const auto& [key, count] : {std::pair("detected", counts.detected),
                                   std::pair("contained", counts.contained),
                                   std::pair("exact", counts.exact)}) {
    const Interval interval = WilsonInterval(count, counts.runs);
    json[key] = {
        {"count", count}, {"low", interval.low}, {"high", interval.high}};
  }
  return json;
}

}  // namespace

LeftOutFault CountLeftOut(int fault, const FaultGroup& group,
                          const std::vector<EvaluatedRun>& runs) {
  LeftOutFault result;
  result.fault = fault;
  for (const EvaluatedRun& run : runs) {
    // The true fault is not in the set, so that every name is a wrong one.
    const std::vector<int>& set = run.indices.final_set;
    ++result.runs;
    result.detected += run.indices.detected;
    if (set.empty()) {
      result.unknown += run.indices.detected;
      continue;
    }
    ++result.wrongly_named;
    ++result.named[set];
    result.as_look_alike +=
        std::includes(group.begin(), group.end(), set.begin(), set.end());
  }
  return result;
}

LeftOutFault SumOf(const std::vector<LeftOutFault>& faults) {
  LeftOutFault sum;
  for (const LeftOutFault& left_out : faults) {
    sum.runs += left_out.runs;
    sum.detected += left_out.detected;
    sum.unknown += left_out.unknown;
    sum.wrongly_named += left_out.wrongly_named;
    sum.as_look_alike += left_out.as_look_alike;
  }
  return sum;
}

report::Report LeaveOneOut(const ModelSet& models, std::vector<ScoredRun> runs,
                           const EvaluationSettings& settings) {
  std::erase_if(runs, [](const ScoredRun& r) { return FaultOf(r.run) == 0; });
  const Detector detector = LeaveOneOutDetector(models);
  const std::vector<EvaluatedRun> scored =
      Evaluate(detector, runs, settings).runs;
  std::map<int, std::vector<EvaluatedRun>> by_fault;
  // Evaluate() keeps the order of the runs.
  for (std::size_t r = 0; r < runs.size(); ++r) {
    by_fault[FaultOf(runs[r].run)].push_back(scored[r]);
  }
  report::Report report;
  report.document = DetectorJson(detector);
  report.document["left_out"] = Json::array();
  std::vector<LeftOutFault> faults;
  for (const auto& [fault, its_runs] : by_fault) {
    faults.push_back(
        CountLeftOut(fault, GroupOf(fault, models.groups), its_runs));
    Json row{{"fault", FaultName(fault)}};
    row.update(JsonOf(faults.back()));
    row["named"] = Json::object();
    for (const auto& [set, count] : faults.back().named) {
      row["named"][SetText(set)] = count;
    }
    report.document["left_out"].push_back(std::move(row));
  }
  report.document["total"] = JsonOf(SumOf(faults));
  const std::vector<report::Column> counts{
      {"runs", "runs"},
      {"detected", "detected"},
      {"unknown", "unknown"},
      {"wrongly named", "wrongly_named"},
      {"look-alike of its group", "as_look_alike"}};
  std::vector<report::Column> columns{{"left out", "fault"}};
  columns.insert(columns.end(), counts.begin(), counts.end());
  columns.push_back({.heading = "named", .key = "named", .text = NamedText});
  return report.Table("left_out", std::move(columns), "no run has a fault")
      .Line("\ntotal")
      .Fields("total", counts);
}

SeedStudy StudySeeds(
    const std::vector<std::vector<EvaluatedRun>>& repetitions) {
  SeedStudy study;
  std::map<int, SeedCounts> faults;
  for (const std::vector<EvaluatedRun>& runs : repetitions) {
    SeedCounts& repetition = study.repetitions.emplace_back();
    for (const EvaluatedRun& run : runs) {
      const RunIndices& indices = run.indices;
      // An r_fd of −1 has no meaning for the run, and −1 remains if no run has
      // one.
      study.max_r_fd = std::max(study.max_r_fd, indices.r_fd);
      if (indices.fault == 0) {
        study.fault_free_episodes += indices.episodes;
        study.fault_free_hours += run.duration_s / 3600.0;
        continue;
      }
      study.runs_with_false_alarm += indices.r_fd > 0.0;
      faults[indices.fault].fault = indices.fault;
      for (SeedCounts* counts :
           {&faults[indices.fault], &repetition, &study.total}) {
        ++counts->runs;
        counts->detected += indices.detected;
        counts->contained += indices.d_acc > 0.0;
        // d_acc is 1/n for a set of n faults, so that the comparison with 1 is
        // exact.
        counts->exact += indices.d_acc == 1.0;
      }
    }
  }
  for (const auto& [fault, counts] : faults) {
    study.faults.push_back(counts);
  }
  return study;
}

SeedStudy RepeatWithSeeds(const Detector& detector,
                          const StudySelection& selection, int seeds) {
  const std::uint64_t first = selection.seed_offset;
  std::vector<std::vector<CampaignRun>> scenarios{
      SimulatedScenarios(selection.campaign, first)};
  const std::size_t count = scenarios.front().size();
  for (int s = 1; s < seeds; ++s) {
    scenarios.push_back(SimulatedScenarios(
        selection.campaign,
        first + static_cast<std::uint64_t>(s) * SeedStep(count)));
  }
  // Each task writes only its own element, which exists already, so the results
  // need no lock and do not depend on the order in which the tasks end.
  std::vector<std::vector<EvaluatedRun>> results(
      scenarios.size(), std::vector<EvaluatedRun>(count));
  const report::StopSignals signals;
  report::Progress progress("simulate");
  Mutex mutex;  // Guards the progress.
  int done = 0;
  const int total = static_cast<int>(scenarios.size() * count);
  ParallelFor(total, 0, [&](int i) {
    // Checked before each run, because ParallelFor() waits for the runs that
    // have begun.
    if (signals.stop_requested()) {
      throw Interrupted("interrupted");
    }
    const std::size_t s = static_cast<std::size_t>(i) / count;
    const std::size_t r = static_cast<std::size_t>(i) % count;
    const CampaignRun& run = scenarios[s][r];
    // A run is simulated where it is scored, so that only as many are in
    // memory as there are threads.
    storage::StoredRun simulated =
        SimulateRun(std::get<SimulatedRun>(run.source));
    ConvertFlow(simulated,
                detector.flow.value_or(
                    simulator::FlowTarget{simulated.info.run.flow_unit}),
                {});
    results[s][r] =
        Evaluate(detector, {std::move(simulated), RunLabel(run), run.horizon_s,
                            static_cast<std::size_t>(i)});
    const MutexLock lock(mutex);
    progress.Update(static_cast<double>(++done) / total, RunLabel(run));
  });
  progress.Finish();
  return StudySeeds(results);
}

report::Report SeedReport(const Detector& detector, const SeedStudy& study) {
  report::Report report;
  Json& json = report.document;
  json = DetectorJson(detector);
  json["seeds"] = study.repetitions.size();
  json["faults"] = Json::object();
  for (const SeedCounts& counts : study.faults) {
    json["faults"][FaultName(counts.fault)] = JsonOf(counts);
  }
  json["total"] = JsonOf(study.total);
  json["runs_with_false_alarm"] = study.runs_with_false_alarm;
  json["max_r_fd"] = study.max_r_fd;
  json["fault_free_episodes"] = study.fault_free_episodes;
  json["fault_free_hours"] = study.fault_free_hours;

  std::ostringstream text;
  text << SharesTable(study)
       << "\nalarms before the fault: " << study.runs_with_false_alarm << " of "
       << study.total.runs << " runs, largest r_fd "
       << FormatNumber(std::max(0.0, study.max_r_fd), 4)
       << "\nepisodes without fault: " << study.fault_free_episodes << " in "
       << FormatNumber(study.fault_free_hours, 2) << " h";
  if (study.fault_free_hours > 0.0) {
    text << "; per valve-year below "
         << FormatNumber(
                RateOf(study.fault_free_episodes, study.fault_free_hours).upper,
                1)
         << " (95 %)";
  }
  report.Line(text.str());
  return report;
}

}  // namespace fdi::trainer::study
