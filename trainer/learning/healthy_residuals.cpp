#include "trainer/learning/healthy_residuals.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/error.h"
#include "diagnosis/model/trained_signals.h"
#include "diagnosis/observers/coverage.h"
#include "diagnosis/observers/observer_bank.h"
#include "trainer/campaign/run_input.h"
#include "trainer/floor_fit.h"
#include "trainer/scoring/rescore.h"

namespace fdi::trainer {
namespace {

constexpr double kExcerptS = 900.0;

// Only the normal observer: it needs no time for those of faults.
std::shared_ptr<const ModelSet> NormalObserverOnly(const ModelSet& models) {
  ModelSet normal = models;
  normal.position_as_command = false;  // AddResiduals() has exchanged them.
  normal.observers.resize(1);
  normal.faults.clear();
  normal.groups.clear();
  normal.undetectable.clear();
  AddFindings(normal);
  return std::make_shared<const ModelSet>(std::move(normal));
}

void RequireNoFault(const storage::StoredRun& run) {
  for (const storage::StoredSample& stored : run.samples) {
    if (TruthOf(stored).strength != 0.0) {
      throw DataError("run " + RunName(run) +
                      " has samples with a fault: limits are set by healthy "
                      "ones, select them with ID@from:to");
    }
  }
}

// Follows one run sample by sample.
class Reader {
 public:
  Reader(const std::shared_ptr<const ModelSet>& models, std::string run,
         HealthyResiduals& data)
      : models_(models),
        run_(std::move(run)),
        data_(&data),
        bank_(std::make_shared<const ObserverPlan>(*models)),
        coverage_(*models) {}

  // The verdict of the engine tells whether it took `sample`. This decides if
  // the valve would have been judged without an alarm: during one, the engine
  // judges a valve wherever it is.
  void Take(const Sample& sample, const Verdict& verdict) {
    if (OutOfOrder(verdict.intake)) {
      return;
    }
    if (verdict.intake != Intake::kAccepted) {
      data_->left_out.Add(Quality::kBadInput);
      rejected_ = true;
      return Finish();
    }
    // The engine bridges a signal that is missing once; this bank does not.
    const bool other =
        std::exchange(present_, sample.present) != sample.present;
    if (verdict.initialised || other || std::exchange(rejected_, false)) {
      bank_.Initialise(sample);
      coverage_.StartSettling(sample.stamp_ns);
    }
    bank_.Step(sample);
    const Quality quality = coverage_.Judge(sample, bank_, false);
    if (quality != Quality::kLive) {
      data_->left_out.Add(quality);
      return Finish();
    }
    Add(sample);
  }

  void Finish() {
    if (stretch_.stamps_ns.empty()) {
      return;
    }
    data_->samples += static_cast<std::int64_t>(stretch_.stamps_ns.size());
    stretch_.run = run_;
    data_->stretches.push_back(std::move(stretch_));
    stretch_ = {};
  }

 private:
  void Add(const Sample& sample) {
    const std::size_t channels = models_->channels.size();
    stretch_.residuals.resize(channels);
    for (std::size_t c = 0; c < channels; ++c) {
      const int channel = static_cast<int>(c);
      const double residual =
          bank_.active(channel) ? bank_.residual(0, channel) : std::nan("");
      const double uncertain =
          kExtrapolationError * bank_.extrapolation(0, channel);
      stretch_.residuals[c].push_back(std::copysign(
          std::max(std::abs(residual) - uncertain, 0.0), residual));
    }
    stretch_.stamps_ns.push_back(sample.stamp_ns);
    stretch_.commands.push_back(sample[Signal::kCv]);
  }

  std::shared_ptr<const ModelSet> models_;
  std::string run_;
  HealthyResiduals* data_;
  bool rejected_{false};
  SignalMask present_{
      0};  // of the last sample taken  // The past of the bank lacks a sample.
  ObserverBank bank_;
  Coverage coverage_;
  ResidualStretch stretch_;
};

// The samples of the end of `stretch`.
std::vector<Sample> EndOf(const ResidualStretch& stretch,
                          const storage::StoredRun& run) {
  const auto most = static_cast<std::size_t>(kExcerptS / run.info.run.period_s);
  const std::size_t count = std::min(most, stretch.stamps_ns.size());
  const std::int64_t from_ns =
      *(stretch.stamps_ns.end() - static_cast<std::ptrdiff_t>(count));
  std::vector<Sample> samples;
  for (const storage::StoredSample& stored : run.samples) {
    const std::int64_t stamp_ns = stored.sample.stamp_ns;
    if (stored.intake == Intake::kAccepted && stamp_ns >= from_ns &&
        stamp_ns <= stretch.stamps_ns.back()) {
      samples.push_back(stored.sample);
    }
  }
  return samples;
}

}  // namespace

void AddResiduals(const std::shared_ptr<const ModelSet>& models,
                  const storage::StoredRun& measured, HealthyResiduals& data) {
  RequireNoFault(measured);
  std::optional<storage::StoredRun> at_position;
  if (models->position_as_command) {
    at_position = measured;
    for (storage::StoredSample& stored : at_position->samples) {
      stored.sample = PositionAsCommand(stored.sample);
    }
  }
  const storage::StoredRun& run = at_position ? *at_position : measured;
  const std::shared_ptr<const ModelSet> normal = NormalObserverOnly(*models);
  std::size_t longest = 0;
  for (const ResidualStretch& stretch : data.stretches) {
    longest = std::max(longest, stretch.stamps_ns.size());
  }
  if (models->floor) {
    data.floor = data.floor ? data.floor : models->floor;
    WidenFloor(SplitAtGaps(ToTrainingRun(run, true)), *data.floor);
  }
  const std::size_t before = data.stretches.size();
  Reader reader(normal, RunName(run), data);
  Rescore(normal, run, [&](const Sample& sample, const Verdict& verdict) {
    reader.Take(sample, verdict);
  });
  reader.Finish();
  for (std::size_t i = before; i < data.stretches.size(); ++i) {
    if (data.stretches[i].stamps_ns.size() > longest) {
      longest = data.stretches[i].stamps_ns.size();
      data.excerpt = EndOf(data.stretches[i], run);
    }
  }
}

}  // namespace fdi::trainer
