#include "bench/study/study_detectors.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "base/parallel_for.h"
#include "bench/study/csv_rows.h"
#include "bench/study/model_reduction.h"
#include "diagnosis/model/fault_catalogue.h"
#include "report/text_table.h"
#include "simulator/second_look/valve_physics.h"
#include "trainer/campaign/run_input.h"

namespace fdi::trainer::study {
namespace {

Answer FollowBaseline(const Baseline& baseline, const storage::StoredRun& run) {
  const double period_s = run.info.run.period_s;
  if (std::abs(period_s - baseline.period_s) > 1e-6 * baseline.period_s) {
    throw DataError("run " + RunName(run) + " has a sample period of " +
                    std::to_string(period_s) + " s, baseline " + baseline.name +
                    " was fitted for " + std::to_string(baseline.period_s) +
                    " s");
  }
  BaselineDetector detector(baseline);
  std::vector<Indication> all;
  const std::int64_t period_ns = std::llround(period_s * 1e9);
  std::int64_t start_ns = 0;
  std::int64_t last_ns = 0;
  for (const storage::StoredSample& stored : run.samples) {
    if (OutOfOrder(stored.intake)) {
      continue;
    }
    const std::int64_t stamp_ns = stored.sample.stamp_ns;
    start_ns = all.empty() ? stamp_ns : start_ns;
    // A gap is a step of more than 1.5 periods.
    if (stored.intake != Intake::kAccepted ||
        (!all.empty() && 2 * (stamp_ns - last_ns) > 3 * period_ns)) {
      detector.Reset();
    }
    last_ns = stamp_ns;
    Indication indication = detector.Step(stored.sample);
    indication.time_s = static_cast<double>(stamp_ns - start_ns) * 1e-9;
    indication.truth = TruthOf(stored);
    all.push_back(std::move(indication));
  }
  return {std::move(all)};
}

// Columns of a file of verdicts.
enum VerdictColumn : std::size_t {
  kVerdictTime,
  kVerdictDetected,
  kVerdictFaults
};

// A row belongs to a sample within this share of the period: t_s is decimal
// text and has been rounded.
constexpr double kTimeTolerance = 0.01;

std::vector<int> FaultsIn(const CsvRows& rows, std::size_t row) {
  std::vector<int> faults;
  std::string rest = rows.Cell(row, kVerdictFaults);
  while (!rest.empty()) {
    const std::size_t bar = rest.find('|');
    const std::string name = rest.substr(0, bar);
    const auto fault = ParseFault(name);
    if (!fault) {
      rows.Refuse(
          row, "fault '" + name + "' is none of " + std::string(kFaultNames));
    }
    faults.push_back(*fault);
    rest = bar == std::string::npos ? "" : rest.substr(bar + 1);
  }
  std::sort(faults.begin(), faults.end());
  if (std::adjacent_find(faults.begin(), faults.end()) != faults.end()) {
    rows.Refuse(row,
                "a fault is there twice: " + rows.Cell(row, kVerdictFaults));
  }
  return faults;
}

Indication IndicationIn(const CsvRows& rows, std::size_t row) {
  Indication indication;
  indication.settled = true;
  const double detected = rows.Number(row, kVerdictDetected);
  if (detected != 0.0 && detected != 1.0) {
    rows.Refuse(row, "detected is " + rows.Cell(row, kVerdictDetected) +
                         ", expected 0 or 1");
  }
  indication.detected = detected == 1.0;
  indication.isolated = FaultsIn(rows, row);
  if (!indication.detected && !indication.isolated.empty()) {
    rows.Refuse(row, "faults without detected = 1");
  }
  return indication;
}

// Walks through rows and samples side by side; both rise in time.
Answer ReadVerdicts(const std::string& file, const storage::StoredRun& run) {
  const CsvRows rows(file, {"t_s", "detected"}, {"faults"});
  for (std::size_t i = 1; i < rows.size(); ++i) {
    if (!(rows.Number(i, kVerdictTime) > rows.Number(i - 1, kVerdictTime))) {
      rows.Refuse(i, "t_s does not rise");
    }
  }
  const double tolerance = kTimeTolerance * run.info.run.period_s;
  std::vector<Indication> all;
  std::size_t row = 0;
  double first_s = 0.0;
  for (const storage::StoredSample& stored : run.samples) {
    if (OutOfOrder(stored.intake)) {
      continue;
    }
    const double t_s =
        static_cast<double>(stored.sample.stamp_ns - run.info.run.start_ns) *
        1e-9;
    while (row < rows.size() &&
           rows.Number(row, kVerdictTime) < t_s - tolerance) {
      ++row;
    }
    if (row == rows.size() ||
        rows.Number(row, kVerdictTime) > t_s + tolerance) {
      throw DataError(file + ": no row for t_s = " +
                      report::FormatNumber(t_s, 3) + " of " + RunName(run));
    }
    first_s = all.empty() ? t_s : first_s;
    Indication indication = IndicationIn(rows, row);
    indication.time_s = t_s - first_s;
    indication.truth = TruthOf(stored);
    all.push_back(std::move(indication));
  }
  return {std::move(all)};
}

EvaluatedRun Score(const Answer& answer, const ScoredRun& run,
                   bool assume_normal) {
  EvaluatedRun result =
      ScoreAnswer(answer, run.run, assume_normal, run.horizon_s);
  result.indices.run_id = run.name;
  return result;
}

}  // namespace

EvaluatedRun Evaluate(const Detector& detector, const ScoredRun& run,
                      const EvaluationSettings& settings) {
  return Score(detector.follow(run, {}), run, settings.assume_normal);
}

Scores Evaluate(const Detector& detector, const std::vector<ScoredRun>& runs,
                const EvaluationSettings& settings) {
  Scores scores{std::vector<EvaluatedRun>(runs.size()),
                std::vector<PaperIndices>(runs.size())};
  ParallelFor(static_cast<int>(runs.size()), settings.threads, [&](int i) {
    const auto r = static_cast<std::size_t>(i);
    const ScoredRun& run = runs[r];
    const Answer answer = detector.follow(
        run, settings.watch ? settings.watch(run) : VerdictSink{});
    scores.runs[r] = Score(answer, run, settings.assume_normal);
    scores.paper[r] = ComputePaperIndices(
        answer.indications, scores.runs[r].indices, run.horizon_s);
    if (settings.scored) {
      settings.scored(run, scores.runs[r], answer.indications);
    }
  });
  return scores;
}

Detector EngineDetector(const std::shared_ptr<const ModelSet>& models) {
  return {models->name,
          models->version,
          models->groups,
          RequiredSignals(*models),
          [models](const ScoredRun& run, const VerdictSink& sink) {
            return AnswerOf(models, run.run, sink);
          },
          simulator::FlowTargetOf(*models)};
}

Detector LeaveOneOutDetector(const ModelSet& models) {
  // Indexed by fault; 0 is the whole set, which also answers for faults that it
  // does not know.
  std::map<int, Detector> reduced;
  reduced[0] = EngineDetector(std::make_shared<const ModelSet>(models));
  for (const int fault : models.faults) {
    reduced[fault] = EngineDetector(
        std::make_shared<const ModelSet>(WithoutFaults(models, {fault})));
  }
  Detector detector = reduced[0];
  detector.follow = [reduced](const ScoredRun& run, const VerdictSink& sink) {
    const auto found = reduced.find(FaultOf(run.run));
    return (found == reduced.end() ? reduced.at(0) : found->second)
        .follow(run, sink);
  };
  return detector;
}

std::string SignatureTable(const Baseline& baseline) {
  if (baseline.table.empty()) {
    return {};
  }
  std::vector<report::TextTable::Column> columns;
  for (const LinearModel& model : baseline.models) {
    columns.push_back({model.name});
  }
  columns.push_back({"faults"});
  report::TextTable table(std::move(columns));
  for (const auto& [signature, faults] : baseline.table) {
    std::vector<std::string> row;
    for (const int sign : signature) {
      row.emplace_back(sign > 0 ? "+" : sign < 0 ? "-" : "0");
    }
    row.push_back(SetText(faults));
    table.AddRow(std::move(row));
  }
  return table.Text();
}

Detector FittedBaseline(Baseline baseline, FlowUnit flow_unit) {
  Detector detector;
  detector.name = baseline.name;
  detector.required = kBasicSignals;
  detector.flow = simulator::FlowTarget{flow_unit};
  detector.follow = [baseline = std::move(baseline)](const ScoredRun& run,
                                                     const VerdictSink&) {
    return FollowBaseline(baseline, run.run);
  };
  return detector;
}

Detector VerdictFiles(const std::vector<std::string>& files) {
  Detector detector;
  detector.name = files.front();
  detector.follow = [files](const ScoredRun& run, const VerdictSink&) {
    return ReadVerdicts(files.at(run.position), run.run);
  };
  return detector;
}

}  // namespace fdi::trainer::study
