#include "diagnosis/valve_engine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "diagnosis/clearing.h"
#include "diagnosis/detection.h"
#include "diagnosis/error.h"
#include "diagnosis/fault_bank.h"
#include "diagnosis/isolation.h"
#include "diagnosis/observer_bank.h"
#include "diagnosis/snapshot.h"
#include "diagnosis/source_order.h"

namespace fdi {
namespace {

constexpr std::uint32_t kSnapshotFormat = 1;
constexpr std::int64_t kSnapshotLifeNs = 600'000'000'000;

std::shared_ptr<const ModelSet> Checked(
    std::shared_ptr<const ModelSet> models) {
  Require(models != nullptr, "the engine needs a model set");
  Validate(*models);
  return models;
}

// The first reason why the required signals of `sample` are unusable.
Intake CheckValues(const ModelSet& models, SignalMask required,
                   const Sample& sample) {
  if ((required & MaskOf(Signal::kF)) != 0 && sample.Has(Signal::kF) &&
      sample.flow_unit != models.flow_unit) {
    return Intake::kUnit;
  }
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((required & MaskOf(signal)) == 0 || !sample.Has(signal)) {
      continue;
    }
    if (sample.quality[i] == SignalQuality::kBad) {
      return Intake::kBadQuality;
    }
    if (!std::isfinite(sample.values[i])) {
      return Intake::kNotFinite;
    }
    const SignalRange range = PlausibleRange(signal);
    if (sample.values[i] < range.minimum || sample.values[i] > range.maximum) {
      return Intake::kRange;
    }
  }
  return Intake::kAccepted;
}

}  // namespace

// Accumulators of a snapshot that wait for the next sample.
struct Resumed {
  std::int64_t stamp_ns;
  Detection detection;
};

// What depends on the model set; replaced as a whole by Adopt().
struct Diagnosis {
  explicit Diagnosis(std::shared_ptr<const ModelSet> set)
      : models(Checked(std::move(set))),
        required(RequiredSignals(*models)),
        bank(*models),
        faults(*models),
        detection(*models),
        isolation(models->decision),
        clearing(*models) {}

  std::shared_ptr<const ModelSet> models;
  SignalMask required;
  ObserverBank bank;
  FaultBank faults;
  Detection detection;
  IsolationWindow isolation;
  ClearingWindow clearing;
  std::unique_ptr<Resumed> resumed;
};

class ValveEngine::Impl {
 public:
  explicit Impl(std::shared_ptr<const ModelSet> models)
      : diagnosis_(std::make_unique<Diagnosis>(std::move(models))),
        order_(diagnosis_->models->sample_period_s) {
    ClearVerdict();
  }

  const Verdict& Step(const Sample& sample);
  std::optional<Transition> EndEpisode(EndReason reason);
  std::optional<Transition> Adopt(std::shared_ptr<const ModelSet> models);
  std::vector<std::byte> Save() const;
  bool Restore(std::span<const std::byte> bytes);

  const ModelSet& models() const { return *diagnosis_->models; }
  bool episode_open() const { return verdict_.state != State::kNormal; }

 private:
  void ClearVerdict();
  void Reject(Intake intake);
  void Initialise(const Sample& sample);
  void Resume(std::int64_t stamp_ns);
  void ReadResiduals();
  Quality Judge(const Sample& sample);
  void Decide();
  void Detect(std::int64_t stamp_ns);
  void Isolate();
  FaultSet WithGroups(FaultSet set) const;
  void Emit(TransitionKind kind, std::int64_t stamp_ns,
            EndReason reason = EndReason::kNone);
  Transition Make(TransitionKind kind, std::int64_t stamp_ns,
                  EndReason reason) const;

  std::unique_ptr<Diagnosis> diagnosis_;
  SourceOrder order_;
  Verdict verdict_;
  bool needs_initialisation_{true};
  int settling_{0};
  SignalMask present_{0};
  std::int64_t detection_stamp_ns_{0};
  FaultSet contender_{0};  // another set than the isolated one
  int contender_run_{0};
};

void ValveEngine::Impl::ClearVerdict() {
  verdict_ = Verdict{};
  verdict_.residuals.fill(std::numeric_limits<double>::quiet_NaN());
}

const Verdict& ValveEngine::Impl::Step(const Sample& sample) {
  verdict_.stamp_ns = sample.stamp_ns;
  verdict_.source_id = sample.source_id;
  verdict_.seq = sample.seq;
  verdict_.initialised = false;
  verdict_.transition_count = 0;
  const SourceOrder::Placement placement = order_.Place(sample);
  verdict_.intake = placement.intake;
  if (placement.intake == Intake::kRepeat ||
      placement.intake == Intake::kLate ||
      placement.intake == Intake::kSuperseded) {
    return verdict_;
  }
  if (placement.new_source) {
    if (episode_open()) {
      Emit(TransitionKind::kClosed, sample.stamp_ns, EndReason::kSuperseded);
      verdict_.state = State::kNormal;
    }
    needs_initialisation_ = true;
  }
  if (placement.intake != Intake::kAccepted) {
    Reject(placement.intake);
    return verdict_;
  }
  const Intake values = CheckValues(models(), diagnosis_->required, sample);
  if (values != Intake::kAccepted) {
    Reject(values);
    return verdict_;
  }
  if (needs_initialisation_ || placement.gap || sample.present != present_) {
    Initialise(sample);
  }
  diagnosis_->bank.Step(sample);
  ReadResiduals();
  diagnosis_->faults.Score(diagnosis_->bank, verdict_);
  verdict_.quality = Judge(sample);
  if (verdict_.quality == Quality::kLive) {
    Decide();
  } else if (episode_open()) {
    diagnosis_->faults.Compete(verdict_);
  }
  verdict_.detected = episode_open();
  return verdict_;
}

void ValveEngine::Impl::Reject(Intake intake) {
  verdict_.intake = intake;
  verdict_.quality = Quality::kBadInput;
  verdict_.detected = episode_open();
  needs_initialisation_ = true;
}

void ValveEngine::Impl::Initialise(const Sample& sample) {
  diagnosis_->bank.Initialise(sample);
  present_ = sample.present;
  needs_initialisation_ = false;
  diagnosis_->detection.Restart();
  Resume(sample.stamp_ns);
  settling_ = std::max(models().decision.settling_samples, kMaxLag);
  verdict_.initialised = true;
}

void ValveEngine::Impl::ReadResiduals() {
  const int channels = static_cast<int>(models().channels.size());
  for (int c = 0; c < channels; ++c) {
    verdict_.residuals[static_cast<std::size_t>(c)] =
        diagnosis_->bank.active(c) ? diagnosis_->bank.residual(0, c)
                                   : std::numeric_limits<double>::quiet_NaN();
  }
  verdict_.confidence =
      static_cast<double>(diagnosis_->bank.active_channels()) / channels;
}

Quality ValveEngine::Impl::Judge(const Sample& sample) {
  if (diagnosis_->bank.active_channels() == 0) {
    return Quality::kBadInput;
  }
  if (sample.mode != ValveMode::kAuto) {
    settling_ = models().decision.settling_samples;
    return Quality::kInhibited;
  }
  if (settling_ > 0) {
    --settling_;
    return Quality::kSettling;
  }
  const double cv = sample[Signal::kCv];
  if (sample.Has(Signal::kCv) &&
      (cv < models().trained_cv.minimum || cv > models().trained_cv.maximum)) {
    return Quality::kUncovered;
  }
  return Quality::kLive;
}

void ValveEngine::Impl::Decide() {
  const bool abnormal =
      diagnosis_->detection.Push(diagnosis_->bank, verdict_.stamp_ns);
  const std::optional<std::int64_t> stamp = diagnosis_->detection.stamp_ns();
  const bool begins = !episode_open() && stamp.has_value();
  if (!episode_open() && !begins) {
    return;
  }
  if (begins) {
    diagnosis_->faults.Restart();
    diagnosis_->isolation.Restart();
    diagnosis_->clearing.Restart();
  }
  diagnosis_->faults.Follow(diagnosis_->bank);
  diagnosis_->faults.Compete(verdict_);
  if (begins) {
    Detect(*stamp);
  }
  Isolate();
  diagnosis_->clearing.Push(
      {verdict_.residuals.data(), models().channels.size()},
      verdict_.normal_factor, abnormal);
  if (diagnosis_->clearing.Cleared()) {
    Emit(TransitionKind::kCleared, verdict_.stamp_ns);
    Emit(TransitionKind::kClosed, verdict_.stamp_ns, EndReason::kCleared);
    verdict_.state = State::kNormal;
    verdict_.isolated = 0;
    diagnosis_->detection.Restart();
  }
}

void ValveEngine::Impl::Detect(std::int64_t stamp_ns) {
  verdict_.state = State::kDetected;
  verdict_.isolated = 0;
  detection_stamp_ns_ = stamp_ns;
  contender_ = 0;
  contender_run_ = 0;
  Emit(TransitionKind::kDetected, detection_stamp_ns_);
}

FaultSet ValveEngine::Impl::WithGroups(FaultSet set) const {
  FaultSet joined = set;
  const double half = 0.5 * models().decision.isolation_threshold;
  for (const std::vector<int>& group : models().groups) {
    FaultSet members = 0;
    FaultSet close = 0;
    for (const int fault : group) {
      const auto i = static_cast<std::size_t>(FaultIndex(models(), fault));
      members |= FaultSet{1} << i;
      if (verdict_.fault_factors[i] >= half) {
        close |= FaultSet{1} << i;
      }
    }
    if ((members & set) != 0) {
      joined |= close;
    }
  }
  return joined;
}

void ValveEngine::Impl::Isolate() {
  const double threshold = models().decision.isolation_threshold;
  FaultSet above = 0;
  for (std::size_t i = 0; i < models().faults.size(); ++i) {
    if (verdict_.fault_factors[i] >= threshold) {
      above |= FaultSet{1} << i;
    }
  }
  diagnosis_->isolation.Push(above);
  FaultSet supported = diagnosis_->isolation.Supported();
  if (supported == 0 || verdict_.normal_factor >= threshold) {
    return;
  }
  supported = WithGroups(supported);
  if (verdict_.state == State::kDetected) {
    verdict_.state = State::kIsolated;
    verdict_.isolated = supported;
    Emit(TransitionKind::kIsolated, verdict_.stamp_ns);
    return;
  }
  // Another set has to hold for a while before it replaces this one.
  contender_run_ = supported == contender_ ? contender_run_ + 1 : 1;
  contender_ = supported;
  if (supported != verdict_.isolated &&
      contender_run_ >= models().decision.reisolation_samples) {
    verdict_.isolated = supported;
    Emit(TransitionKind::kReisolated, verdict_.stamp_ns);
  }
}

Transition ValveEngine::Impl::Make(TransitionKind kind, std::int64_t stamp_ns,
                                   EndReason reason) const {
  Transition transition;
  transition.kind = kind;
  transition.stamp_ns = stamp_ns;
  transition.detection_stamp_ns = detection_stamp_ns_;
  transition.faults = verdict_.isolated;
  transition.reason = reason;
  for (std::size_t i = 0; i < models().faults.size(); ++i) {
    const bool counts =
        verdict_.isolated == 0 || (verdict_.isolated >> i & 1U) != 0;
    if (counts && verdict_.fault_factors[i] >= transition.factor) {
      transition.factor = verdict_.fault_factors[i];
      transition.strength =
          verdict_.isolated == 0 ? 0.0 : verdict_.strengths[i];
    }
  }
  return transition;
}

void ValveEngine::Impl::Emit(TransitionKind kind, std::int64_t stamp_ns,
                             EndReason reason) {
  verdict_.transitions[static_cast<std::size_t>(verdict_.transition_count++)] =
      Make(kind, stamp_ns, reason);
}

std::optional<Transition> ValveEngine::Impl::EndEpisode(EndReason reason) {
  needs_initialisation_ = true;
  if (!episode_open()) {
    return std::nullopt;
  }
  const Transition closed =
      Make(TransitionKind::kClosed, verdict_.stamp_ns, reason);
  verdict_.state = State::kNormal;
  verdict_.isolated = 0;
  verdict_.detected = false;
  return closed;
}

std::optional<Transition> ValveEngine::Impl::Adopt(
    std::shared_ptr<const ModelSet> models) {
  auto replacement = std::make_unique<Diagnosis>(std::move(models));
  std::optional<Transition> closed = EndEpisode(EndReason::kModelChanged);
  diagnosis_ = std::move(replacement);
  order_.SetPeriod(diagnosis_->models->sample_period_s);
  ClearVerdict();
  return closed;
}

std::vector<std::byte> ValveEngine::Impl::Save() const {
  SnapshotWriter writer;
  writer.Put(kSnapshotFormat, models().content_hash, verdict_.stamp_ns);
  diagnosis_->detection.Save(writer);
  return writer.Take();
}

bool ValveEngine::Impl::Restore(std::span<const std::byte> bytes) {
  SnapshotReader reader(bytes);
  std::uint32_t format = 0;
  std::uint64_t content_hash = 0;
  Resumed resumed{0, Detection(models())};
  if (!reader.Get(format, content_hash, resumed.stamp_ns) ||
      format != kSnapshotFormat || content_hash != models().content_hash ||
      !resumed.detection.Restore(reader) || !reader.AtEnd()) {
    return false;
  }
  diagnosis_->resumed = std::make_unique<Resumed>(std::move(resumed));
  return true;
}

// Takes up a snapshot that is recent at `stamp_ns`; it serves once.
void ValveEngine::Impl::Resume(std::int64_t stamp_ns) {
  const std::unique_ptr<Resumed> resumed = std::move(diagnosis_->resumed);
  if (resumed && stamp_ns > resumed->stamp_ns &&
      stamp_ns - resumed->stamp_ns <= kSnapshotLifeNs) {
    diagnosis_->detection = std::move(resumed->detection);
  }
}

ValveEngine::ValveEngine(std::shared_ptr<const ModelSet> models)
    : impl_(std::make_unique<Impl>(std::move(models))) {}
ValveEngine::~ValveEngine() = default;
ValveEngine::ValveEngine(ValveEngine&&) noexcept = default;
ValveEngine& ValveEngine::operator=(ValveEngine&&) noexcept = default;

const Verdict& ValveEngine::Step(const Sample& sample) {
  return impl_->Step(sample);
}

std::optional<Transition> ValveEngine::EndEpisode(EndReason reason) {
  return impl_->EndEpisode(reason);
}

std::optional<Transition> ValveEngine::Adopt(
    std::shared_ptr<const ModelSet> models) {
  return impl_->Adopt(std::move(models));
}

std::vector<std::byte> ValveEngine::Save() const {
  return impl_->Save();
}

bool ValveEngine::Restore(std::span<const std::byte> bytes) {
  return impl_->Restore(bytes);
}

const ModelSet& ValveEngine::models() const {
  return impl_->models();
}

bool ValveEngine::episode_open() const {
  return impl_->episode_open();
}

}  // namespace fdi
