#include "trainer/campaign/run_input.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "base/csv_cells.h"
#include "diagnosis/model/held_readings.h"

namespace fdi::trainer {
namespace {

// Observers are fitted to a loop under control, so what an operator drives by
// hand is left out as are bad and implausible readings.
bool IsUsable(const Sample& sample, SignalMask signals) {
  if (sample.mode != ValveMode::kAuto ||
      (sample.present & signals) != signals) {
    return false;
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) == 0) {
      continue;
    }
    if (sample.quality[i] == SignalQuality::kBad ||
        !IsPlausible(sample, signal)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string SelectorOf(const std::string& id,
                       const storage::RunSelector& part) {
  if (!part.IsStretch()) {
    return id;
  }
  const auto bound = [](double seconds) {
    return std::isfinite(seconds) ? NumberText(seconds) : std::string();
  };
  return id + '@' + bound(part.from_s) + ':' + bound(part.to_s);
}

std::string RunName(const storage::StoredRun& run) {
  return SelectorOf(run.info.id, run.selector);
}

bool HasTruth(const storage::StoredRun& run) {
  return std::any_of(
      run.samples.begin(), run.samples.end(),
      [](const storage::StoredSample& s) { return s.truth.has_value(); });
}

FaultTruth TruthOf(const storage::StoredSample& stored) {
  FaultTruth truth = stored.truth.value_or(FaultTruth{});
  if (truth.strength == 0.0) {
    truth.fault = 0;
  }
  return truth;
}

int FaultOf(const storage::StoredRun& run) {
  const auto first = std::find_if(
      run.samples.begin(), run.samples.end(),
      [](const storage::StoredSample& s) { return TruthOf(s).fault != 0; });
  return first == run.samples.end() ? 0 : TruthOf(*first).fault;
}

SignalMask UsualSignals(const storage::StoredRun& run) {
  std::map<SignalMask, std::int64_t> counts;
  for (const storage::StoredSample& stored : run.samples) {
    counts[stored.sample.present] += stored.intake == Intake::kAccepted;
  }
  const auto most = std::max_element(
      counts.begin(), counts.end(),
      [](const auto& a, const auto& b) { return a.second < b.second; });
  return most == counts.end() ? SignalMask{0} : most->first;
}

TrainingRun ToTrainingRun(const storage::StoredRun& run, bool assume_normal) {
  TrainingRun result;
  result.id = RunName(run);
  result.period_s = run.info.run.period_s;
  result.flow_unit = run.info.run.flow_unit;
  const SignalMask signals = UsualSignals(run);
  // In a run that is partly labelled, a sample without truth may be anything.
  const bool needs_truth = HasTruth(run) && !assume_normal;
  for (const storage::StoredSample& stored : run.samples) {
    if (stored.intake != Intake::kAccepted ||
        (needs_truth && !stored.truth.has_value()) ||
        !IsUsable(stored.sample, signals)) {
      continue;
    }
    LabelledSample labelled{stored.sample, stored.truth};
    labelled.sample.present = signals;
    result.samples.push_back(std::move(labelled));
  }
  MarkHeld(result.period_s, result.samples.size(),
           [&](std::size_t k) -> Sample& { return result.samples[k].sample; });
  return result;
}

}  // namespace fdi::trainer
