#include "trainer/app/comparison.h"

#include <functional>
#include <limits>

#include "diagnosis/quality_count.h"
#include "storage/cli/text_table.h"
#include "trainer/app/rescore.h"
#include "trainer/parallel_for.h"

namespace fdi::trainer {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kSignificant = 0.05;

EvaluatedRun ScoreOne(const std::shared_ptr<const ModelSet>& models,
                      const ScoredRun& run, bool assume_normal) {
  QualityCount samples;
  const auto indications =
      Rescore(models, run.run, [&](const Sample&, const Verdict& verdict) {
        if (CountsAsTime(verdict)) {
          samples.Add(verdict.quality);
        }
      });
  EvaluatedRun result = Evaluated(run, indications, assume_normal);
  result.seconds.emplace();
  for (std::size_t q = 0; q < kQualityCount; ++q) {
    (*result.seconds)[q] =
        models->sample_period_s *
        static_cast<double>(samples[static_cast<Quality>(q)]);
  }
  return result;
}

// What a run counts for; NaN: nothing. More is better.
using Merit = std::function<double(const EvaluatedRun&)>;

double IfFaulty(const EvaluatedRun& run, double merit) {
  return run.indices.fault != 0 ? merit : kNone;
}

// A delay, −1 without meaning: the shorter the better.
double IfReached(double delay_s) {
  return delay_s < 0.0 ? kNone : -delay_s;
}

// Time in alarm before the fault, or alarms of a run without one.
double FalseAlarms(const EvaluatedRun& run) {
  return run.indices.fault != 0 ? std::max(run.indices.r_fd, 0.0)
                                : run.indices.episodes;
}

const std::vector<std::pair<const char*, Merit>>& Merits() {
  static const std::vector<std::pair<const char*, Merit>> merits = {
      {"detected",
       [](const EvaluatedRun& r) { return IfFaulty(r, IsDetected(r)); }},
      {"detection delay",
       [](const EvaluatedRun& r) {
         return IfFaulty(r, IfReached(r.indices.t_dt));
       }},
      {"isolation delay",
       [](const EvaluatedRun& r) {
         return IfFaulty(r, IfReached(r.indices.t_it));
       }},
      {"final set",
       [](const EvaluatedRun& r) {
         return IfFaulty(r, std::max(r.indices.d_acc, 0.0));
       }},
      {"wrong single faults",
       [](const EvaluatedRun& r) {
         return IfFaulty(r, -r.indices.wrong_isolations);
       }},
      {"false alarms", [](const EvaluatedRun& r) { return -FalseAlarms(r); }}};
  return merits;
}

}  // namespace

std::vector<ComparedRun> CompareRuns(const std::shared_ptr<const ModelSet>& a,
                                     const std::shared_ptr<const ModelSet>& b,
                                     const std::vector<ScoredRun>& runs,
                                     bool assume_normal) {
  std::vector<ComparedRun> compared(runs.size());
  ParallelFor(static_cast<int>(runs.size()), 0, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    compared[r] = {ScoreOne(a, runs[r], assume_normal),
                   ScoreOne(b, runs[r], assume_normal)};
  });
  return compared;
}

std::vector<std::string> DifferencesOf(const ComparedRun& run) {
  const RunIndices& a = run.a.indices;
  const RunIndices& b = run.b.indices;
  std::vector<std::string> differences;
  const auto add = [&](bool differs, const char* name) {
    if (differs) {
      differences.emplace_back(name);
    }
  };
  add(IsDetected(run.a) != IsDetected(run.b), "detected");
  add(a.t_dt != b.t_dt, "delay");
  add(a.t_it != b.t_it, "isolation");
  add(Outcome(run.a) != Outcome(run.b), "final set");
  add(a.wrong_isolations != b.wrong_isolations, "wrong faults");
  add(run.a.has_truth && FalseAlarms(run.a) != FalseAlarms(run.b),
      "false alarms");
  return differences;
}

std::vector<ComparedMeasure> MeasuresOf(const std::vector<ComparedRun>& runs) {
  std::vector<ComparedMeasure> measures;
  for (const auto& [name, merit] : Merits()) {
    std::vector<double> differences;
    for (const ComparedRun& run : runs) {
      if (run.a.has_truth) {
        differences.push_back(merit(run.b) - merit(run.a));
      }
    }
    measures.push_back({name, CountSigns(differences)});
  }
  return measures;
}

std::string JudgementOf(const ComparedMeasure& measure, const std::string& a,
                        const std::string& b) {
  const SignTest& test = measure.better;
  if (test.decided() == 0) {
    return test.ties == 0 ? "no run has it" : "alike";
  }
  if (!measure.enough()) {
    return "too few runs differ (" + std::to_string(test.decided()) +
           ", needed are " + std::to_string(kLeastDecidedPairs) + ")";
  }
  const double p = PValue(test);
  const std::string value =
      p < 1e-4 ? " (p < 0.0001)" : " (p = " + cli::FormatNumber(p, 4) + ")";
  if (p > kSignificant) {
    return "no difference shown" + value;
  }
  return (test.positive > test.negative ? b : a) + " is better" + value;
}

}  // namespace fdi::trainer
