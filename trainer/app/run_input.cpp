#include "trainer/app/run_input.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

namespace fdi::trainer {
namespace {

std::string Shortest(double value) {
  std::array<char, 32> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

// The signals that most accepted samples have.
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
        !PlausibleRange(signal).Contains(sample.values[i])) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string RunName(const storage::StoredRun& run) {
  if (!run.selector.IsStretch()) {
    return run.info.id;
  }
  const auto bound = [](double seconds) {
    return std::isfinite(seconds) ? Shortest(seconds) : std::string();
  };
  return run.info.id + '@' + bound(run.selector.from_s) + ':' +
         bound(run.selector.to_s);
}

bool HasTruth(const storage::StoredRun& run) {
  return std::any_of(
      run.samples.begin(), run.samples.end(),
      [](const storage::StoredSample& s) { return s.truth.has_value(); });
}

TrainingRun ToTrainingRun(const storage::StoredRun& run, bool assume_normal) {
  TrainingRun result;
  result.id = RunName(run);
  result.period_s = run.info.run.period_s;
  result.flow_unit = run.info.run.flow_unit;
  const SignalMask signals = UsualSignals(run);
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
  return result;
}

}  // namespace fdi::trainer
