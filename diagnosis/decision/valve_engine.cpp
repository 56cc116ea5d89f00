#include "diagnosis/decision/valve_engine.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "diagnosis/decision/episode.h"
#include "diagnosis/decision/floor.h"
#include "diagnosis/decision/rules.h"
#include "diagnosis/decision/second_fault.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/snapshot.h"
#include "diagnosis/model/trained_signals.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/coverage.h"
#include "diagnosis/observers/detection.h"
#include "diagnosis/observers/drift_watch.h"
#include "diagnosis/observers/intake.h"
#include "diagnosis/observers/lone_readings.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {
namespace {

// Pa, mbar, bar and MPa in kPa, and a decimal point in another place.
constexpr std::array kPressureFactors{0.001, 0.01, 0.1, 10.0, 100.0, 1000.0};
constexpr double kFarOff = 3.0;    // from the usual readings, as a factor
constexpr double kFlowLost = 0.5;  // of the flow before
constexpr double kZeroCelsiusK = 273.15;
constexpr double kFullTravel = 100.0;  // [%]

// True if a pressure or temperature is not what the set was trained on, but
// would be in another unit. A transmitter that fails hardly ever ends there,
// but medium that gets hot (f7) may: T1 only where a stream `begins`.
bool IsInOtherUnit(const ModelSet& models, Signal signal, double value,
                   bool begins) {
  const ValidityRegion& region = models.validity;
  if (signal == Signal::kT1) {
    return begins && !region.t1.Contains(value) &&
           region.t1.Contains(value - kZeroCelsiusK);
  }
  if (signal != Signal::kP1 && signal != Signal::kP2) {
    return false;
  }
  const SignalRange& usual = signal == Signal::kP1 ? region.p1 : region.p2;
  const bool far =
      value * kFarOff < usual.minimum || value > kFarOff * usual.maximum;
  return usual.minimum > 0.0 && far &&
         std::ranges::any_of(kPressureFactors, [&](double factor) {
           return usual.Contains(value * factor);
         });
}

// Why the reading of `signal` is unusable, or kAccepted. While an episode is
// open, a pressure or temperature may pass any value.
Intake CheckValue(const ModelSet& models, const Sample& sample, Signal signal,
                  bool episode_open, bool begins) {
  const std::size_t i = Index(signal);
  if (signal == Signal::kF && sample.flow_unit != models.flow_unit) {
    return Intake::kUnit;
  }
  if (sample.quality[i] == SignalQuality::kBad) {
    return Intake::kBadQuality;
  }
  // Before the range, which does not contain NaN either: the reason differs.
  if (!std::isfinite(sample.values[i])) {
    return Intake::kNotFinite;
  }
  if (!IsPlausible(sample, signal)) {
    return Intake::kRange;
  }
  return !episode_open &&
                 IsInOtherUnit(models, signal, sample.values[i], begins)
             ? Intake::kUnit
             : Intake::kAccepted;
}

struct Checked {
  Intake intake{Intake::kAccepted};  // the first reason
  SignalMask unusable{0};
};

// Checks the signals of `required` that are present.
Checked CheckValues(const ModelSet& models, SignalMask required,
                    const Sample& sample, bool episode_open, bool begins) {
  Checked checked;
  const SignalMask read = required & sample.present;
  for (unsigned left = read; left != 0; left &= left - 1) {
    const auto signal = static_cast<Signal>(std::countr_zero(left));
    const Intake intake =
        CheckValue(models, sample, signal, episode_open, begins);
    if (intake != Intake::kAccepted) {
      checked.intake = checked.unusable == 0 ? intake : checked.intake;
      checked.unusable =
          static_cast<SignalMask>(checked.unusable | MaskOf(signal));
    }
  }
  return checked;
}

// Save() writes and Restore() reads this, little endian and without padding:
//
//     snapshot = format:u32 content_hash:u64 coverage windows drift doubt
//     coverage = stamped:u8 last_stamp_ns:i64 armed:u8
//     windows  = (window window)*  residual and CV, by channel and length
//     window   = length:i32 count:i32 mean:f64 variance:f64
//     drift    = (count:i64 sum:f64 blocks:u64 mean:f64*)*  by span
//     doubt    = until_ns:i64*  by channel
//
// There are as many windows as the model set has, which content_hash
// identifies. A change to any part, also in the Save() of ResidualWindow, needs
// another format number.
constexpr std::uint32_t kSnapshotFormat = 6;
// Samples in a row, until nothing is known.
constexpr int kMaxUncertainRun = 60;

// True if the limits are so wide that every known fault looks normal.
bool SeesNoFault(const ModelSet& models) {
  const auto known = std::ranges::count_if(models.faults, [](int fault) {
    return IsFault(fault) && !FaultFactsOf(fault).simulation_only;
  });
  return known > 0 && std::ssize(models.undetectable) >= known;
}

}  // namespace

// The part that depends on the model set; Adopt() replaces it as a whole.
struct Diagnosis {
  explicit Diagnosis(EngineParts parts)
      : plan(std::move(parts.plan)),
        trained(TrainedSignals(plan->models())),
        bank(plan->observers(), std::move(parts.outputs), parts.instructions),
        lone(plan->models()),
        coverage(plan->models()),
        detection(plan->models()),
        drift(plan->models()),
        stuck(plan->models()),
        floor(plan->models()),
        episode(plan->faults()),
        second(plan, parts.instructions),
        sees_no_fault(SeesNoFault(plan->models())) {}

  std::shared_ptr<const EnginePlan> plan;
  TrainedSignals trained;
  ObserverBank bank;
  LoneReadings lone;
  Coverage coverage;
  Detection detection;
  DriftWatch drift;
  StuckReadings stuck;
  Floor floor;
  Episode episode;
  SecondFaultWatch second;
  bool sees_no_fault;
};

class ValveEngine::Impl {
 public:
  explicit Impl(EngineParts parts)
      : diagnosis_(std::make_unique<Diagnosis>(std::move(parts))),
        order_(models().sample_period_s) {
    ClearVerdict();
  }

  const Verdict& Step(const Sample& measured);
  std::optional<Transition> EndEpisode(EndReason reason);
  std::optional<Transition> Adopt(EngineParts parts);
  void HoldIsolation(bool hold);
  void ForgetSuperseded() { order_.ForgetSuperseded(); }
  void Suspect(bool suspected) { suspected_ = suspected; }
  void TakeName(const NameBeside& name) { beside_ = name; }
  void Allow(const Unseen& unseen) { unseen_ = unseen; }
  std::vector<std::byte> Save() const;
  bool Restore(std::span<const std::byte> bytes);

  const ModelSet& models() const { return diagnosis_->plan->models(); }
  const Verdict& verdict() const { return verdict_; }
  const Sample* judged() const {
    return judged_ ? &diagnosis_->lone.judged() : nullptr;
  }
  bool episode_open() const { return verdict_.state != State::kNormal; }

 private:
  void ClearVerdict();
  Checked CheckSample(const Sample& measured, bool begins);
  void TakeSilence(SignalMask silent, Sample& trained) const;
  void AllowUnseen(const Sample& trained);
  bool IsUnknown() const;
  bool Mend(const Checked& checked, bool begins, Sample& trained);
  SignalMask Single(const Checked& checked) const;
  void TakeSource(const Sample& sample);
  void Reject(Intake intake);
  void Initialise(const Sample& sample);
  void ReadResiduals();
  Quality Judge(const Sample& sample);
  void Decide(const Sample& sample);
  void FindDrift(Findings& findings);
  void StepEpisode(const Sample& sample, const Findings& findings);

  std::unique_ptr<Diagnosis> diagnosis_;
  SourceOrder order_;
  Bridge bridge_;
  Verdict verdict_;
  bool isolation_held_{false};
  bool suspected_{false};
  NameBeside beside_;
  Unseen unseen_{};
  bool has_source_{false};
  bool judged_{false};  // The last sample has reached the observers.
  bool needs_initialisation_{true};
  bool lost_pressure_{false};  // what looks like another unit is none
  double flow_before_{0.0};
  std::int64_t stamp_ns_{0};  // of the last sample in order
  SignalMask present_{0};
  int uncertain_{0};  // samples in a row of which no channel was measured
};

void ValveEngine::Impl::ClearVerdict() {
  verdict_ = Verdict{};
  verdict_.residuals.fill(std::numeric_limits<double>::quiet_NaN());
}

const Verdict& ValveEngine::Impl::Step(const Sample& measured) {
  Sample trained = diagnosis_->trained.Of(measured);
  verdict_.stamp_ns = trained.stamp_ns;
  verdict_.source_id = trained.source_id;
  verdict_.seq = trained.seq;
  verdict_.initialised = false;
  verdict_.share = 0.0;
  verdict_.transition_count = 0;
  verdict_.single = 0;
  judged_ = false;
  const SourceOrder::Placement placement = order_.Place(trained);
  verdict_.intake = placement.intake;
  if (OutOfOrder(placement.intake)) {
    return verdict_;
  }
  stamp_ns_ = trained.stamp_ns;
  // A newer source takes over by its first sample, even if its values are then
  // rejected.
  if (placement.new_source) {
    TakeSource(trained);
  }
  if (placement.intake != Intake::kAccepted) {
    Reject(placement.intake);
    return verdict_;
  }
  const bool begins = needs_initialisation_ || placement.gap;
  const Checked checked = CheckSample(measured, begins);
  const SignalMask silent = trained.uncertain();
  TakeSilence(silent, trained);
  if (!Mend(checked, begins, trained)) {
    Reject(checked.intake);
    return verdict_;
  }
  verdict_.intake = checked.intake;
  // The bank chooses the channels that it can evaluate when it is initialised,
  // so other signals than before need that as much as a gap does.
  if (begins || trained.present != present_) {
    Initialise(trained);
  }
  AllowUnseen(trained);
  const Sample& sample = diagnosis_->lone.Step(diagnosis_->bank, trained);
  judged_ = true;
  verdict_.single = Single(checked);
  diagnosis_->stuck.Push(sample);
  diagnosis_->floor.Push(sample, silent);
  ReadResiduals();
  const ObserverBank& bank = diagnosis_->bank;
  const bool unread =
      bank.active_channels() > 0 && bank.measured_channels() == 0;
  const bool uncertain = unread && !diagnosis_->lone.holds();
  uncertain_ = uncertain ? std::min(uncertain_ + 1, kMaxUncertainRun + 1) : 0;
  // With nothing measured, Score() would set every factor to 0, as if each
  // fault and normal operation were refuted. So the last factors stand.
  if (!unread) {
    diagnosis_->episode.Score(bank, verdict_);
  }
  verdict_.quality = Judge(sample);
  // The floor, and the episode that it may have opened, do not wait.
  const bool settles = verdict_.quality == Quality::kSettling &&
                       models().floor && sample.mode == ValveMode::kAuto;
  if (verdict_.quality == Quality::kLive || settles) {
    Decide(sample);
  } else if (episode_open() && !uncertain) {
    diagnosis_->episode.Hold(verdict_);
  }
  verdict_.detected = episode_open();
  return verdict_;
}

// A pump that stops may leave a tenth of the pressure, as another unit would,
// but takes the flow with it at that sample.
Checked ValveEngine::Impl::CheckSample(const Sample& measured, bool begins) {
  const auto check = [&](bool any_pressure) {
    return CheckValues(models(), diagnosis_->plan->required(), measured,
                       any_pressure, begins);
  };
  Checked values = check(episode_open());
  if (values.intake != Intake::kUnit) {
    lost_pressure_ = lost_pressure_ && episode_open();
  } else if (lost_pressure_ ||
             (!begins && measured.Has(Signal::kF) &&
              measured[Signal::kF] < kFlowLost * flow_before_)) {
    values = check(true);
    lost_pressure_ = true;
  }
  if (values.intake == Intake::kAccepted) {
    flow_before_ = measured.Has(Signal::kF) ? measured[Signal::kF] : 0.0;
  }
  return values;
}

// Where a reading was due and none came, the valve is still where it was.
void ValveEngine::Impl::TakeSilence(SignalMask silent, Sample& trained) const {
  for (unsigned left = silent & diagnosis_->floor.stuck(); left != 0;
       left &= left - 1) {
    trained.quality[static_cast<std::size_t>(std::countr_zero(left))] =
        SignalQuality::kGood;
  }
}

// A rod follows its command, and the flow what the observers read of both.
void ValveEngine::Impl::AllowUnseen(const Sample& trained) {
  const bool any = unseen_.any();
  if (!any && !diagnosis_->bank.allows()) {
    return;
  }
  const auto of = [&](Signal signal) { return unseen_.changes[Index(signal)]; };
  for (std::size_t c = 0; c < models().channels.size(); ++c) {
    double error = 0.0;
    const Signal output = models().channels[c].output;
    if (any && output == Signal::kX) {
      error = of(Signal::kCv);
    } else if (any && output == Signal::kF && models().floor) {
      const TsModel& model = models().observers[0].channels[c].model;
      const Signal at = (RequiredSignals(model) & MaskOf(Signal::kX)) != 0
                            ? Signal::kX
                            : Signal::kCv;
      const double dp = DpOf(*models().floor, trained);
      const double dp_error = of(Signal::kP1) + of(Signal::kP2);
      error =
          0.5 * (FlowAt(*models().floor, trained[at] - of(at), dp + dp_error) -
                 FlowAt(*models().floor, trained[at] + of(at), dp - dp_error));
    }
    if ((unseen_.within & MaskOf(output)) != 0) {
      error += of(output);
    }
    diagnosis_->bank.Allow(static_cast<int>(c), error);
  }
}

// A reading that stands while it should have moved is known to.
bool ValveEngine::Impl::IsUnknown() const {
  return unseen_.unknown && diagnosis_->floor.stuck() == 0;
}

// @returns whether the sample can be judged; what is unusable is then bridged.
bool ValveEngine::Impl::Mend(const Checked& checked, bool begins,
                             Sample& trained) {
  if (begins) {
    bridge_.Restart();
    return checked.unusable == 0;
  }
  unsigned unusable = checked.unusable;
  if (models().position_as_command && (unusable & MaskOf(Signal::kX)) != 0) {
    unusable = (unusable & ~MaskOf(Signal::kX)) | MaskOf(Signal::kCv);
  }
  // A signal that the last sample did not have has no reading to be held.
  trained.present =
      static_cast<SignalMask>(trained.present & ~(unusable & ~present_));
  unusable = (unusable & present_) | (present_ & ~trained.present);
  if (unusable == present_) {
    return checked.unusable == 0;  // Nothing is left that would support it.
  }
  return bridge_.Mend(static_cast<SignalMask>(unusable),
                      diagnosis_->lone.judged(), trained) ||
         checked.unusable == 0;
}

// A missing reading belongs to the transport, and is not counted.
SignalMask ValveEngine::Impl::Single(const Checked& checked) const {
  const SignalMask unusable =
      bridge_.begins() ? checked.unusable : SignalMask{0};
  unsigned wrong = diagnosis_->lone.wrong();
  if (models().position_as_command && (wrong & MaskOf(Signal::kCv)) != 0) {
    wrong = (wrong & ~MaskOf(Signal::kCv)) | MaskOf(Signal::kX);
  }
  return static_cast<SignalMask>(unusable | wrong);
}

// Knowledge about another source says nothing about this one and is dropped; a
// snapshot restored before the first source is kept.
void ValveEngine::Impl::TakeSource(const Sample& sample) {
  if (episode_open()) {
    verdict_.transitions[0] = diagnosis_->episode.Close(
        EndReason::kSuperseded, sample.stamp_ns, verdict_);
    verdict_.transition_count = 1;
  }
  if (has_source_) {
    diagnosis_->coverage.Restart();
    diagnosis_->stuck.Restart();
  }
  has_source_ = true;
  needs_initialisation_ = true;
  lost_pressure_ = false;
}

void ValveEngine::Impl::Reject(Intake intake) {
  verdict_.intake = intake;
  verdict_.quality = Quality::kBadInput;
  verdict_.uncovered = 0;
  verdict_.detected = episode_open();
  // The past of the observers has to be consecutive, and lacks this sample.
  needs_initialisation_ = true;
}

void ValveEngine::Impl::Initialise(const Sample& sample) {
  diagnosis_->bank.Initialise(sample);
  diagnosis_->lone.Restart();
  present_ = sample.present;
  needs_initialisation_ = false;
  // Windows outlast a short interruption; runs of consecutive samples do not.
  if (diagnosis_->coverage.StartSettling(sample.stamp_ns)) {
    diagnosis_->detection.Interrupt();
    diagnosis_->second.Interrupt();
  } else {
    diagnosis_->detection.Restart();
    diagnosis_->second.Restart();
    diagnosis_->drift.Restart();
  }
  diagnosis_->floor.Restart();
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
      diagnosis_->sees_no_fault
          ? 0.0
          : static_cast<double>(diagnosis_->bank.active_channels()) / channels;
}

Quality ValveEngine::Impl::Judge(const Sample& sample) {
  verdict_.uncovered = 0;
  const Floor& floor = diagnosis_->floor;
  if (diagnosis_->bank.active_channels() == 0 ||
      (uncertain_ > kMaxUncertainRun && floor.stuck() == 0)) {
    return Quality::kBadInput;
  }
  // A fault moves the command, so whether the valve is abnormal has to be known
  // before its command may disarm it (docs/method.md): the floor has taken
  // this sample, and pending() is that of the last judged one.
  const Quality quality = diagnosis_->coverage.Judge(
      sample, diagnosis_->bank, episode_open(), floor.findings() != 0,
      diagnosis_->detection.pending());
  verdict_.uncovered = diagnosis_->coverage.reasons();
  return quality == Quality::kLive && IsUnknown() ? Quality::kSettling
                                                  : quality;
}

void ValveEngine::Impl::Decide(const Sample& sample) {
  Detection& detection = diagnosis_->detection;
  const Floor& floor = diagnosis_->floor;
  // Anything that the windows hold dates from before the valve was disarmed.
  if (diagnosis_->coverage.armed_now()) {
    detection.Restart();
  }
  // Nothing is measured, so all stays as it is. Silence opens an episode, and
  // is a reading from the next sample on (TakeSilence()).
  if (uncertain_ > 0 && (floor.stuck() == 0 || episode_open())) {
    return;
  }
  Findings findings;
  findings.settled =
      diagnosis_->coverage.settled() && uncertain_ == 0 && !IsUnknown();
  findings.floor = floor.findings();
  findings.beginning = floor.beginning();
  findings.abnormal = findings.floor != 0;
  findings.detected = floor.stamp_ns();
  for (std::size_t i = 0; i < Floor::kTests; ++i) {
    findings.sizes[i] = floor.size(i);
  }
  verdict_.share = floor.share();
  if (findings.settled) {
    findings.stuck = diagnosis_->stuck.faults();
    // Push() comes first: after another operand, || could skip it and the
    // windows would miss the sample.
    findings.abnormal = detection.Push(diagnosis_->bank, sample, {},
                                       diagnosis_->lone.residuals()) ||
                        findings.stuck != 0 || findings.abnormal || suspected_;
    verdict_.share = std::max(verdict_.share, detection.share());
    const auto suspicion =
        suspected_ ? std::optional(sample.stamp_ns) : std::nullopt;
    for (const auto& stamp :
         {detection.stamp_ns(), diagnosis_->stuck.stamp_ns(), suspicion}) {
      findings.detected = findings.detected ? findings.detected : stamp;
    }
  }
  const bool was_open = episode_open();
  verdict_.drift = {};
  if (findings.settled) {
    FindDrift(findings);
  }
  beside_ = was_open ? beside_ : NameBeside{};
  StepEpisode(sample, findings);
  diagnosis_->drift.Follow(verdict_);
  // After an episode the windows still contain its fault, which would open the
  // next one at once.
  if (was_open && !episode_open()) {
    detection.Restart();
  }
}

// A finding beside those of the floor, which do not come slowly.
void ValveEngine::Impl::FindDrift(Findings& findings) {
  DriftWatch& drift = diagnosis_->drift;
  if (!Acts(Rule::kDrift) || !drift.watches()) {
    return;
  }
  const std::uint32_t beyond = diagnosis_->detection.beyond();
  drift.Push(verdict_, beyond);
  findings.abnormal = findings.abnormal || drift.present();
  if (findings.floor != 0 || findings.stuck != 0) {
    return;
  }
  if (!episode_open() && findings.detected) {
    drift.Begin(beyond);
  } else if (!episode_open() && drift.Emerges()) {
    findings.detected = verdict_.stamp_ns;
  }
  if (!drift.drift()) {
    return;
  }
  const auto bit =
      static_cast<std::size_t>(FaultIndex(models(), kPositionDrift));
  const auto first =
      static_cast<std::size_t>(FaultIndex(models(), kFirstFinding));
  findings.drift = true;
  verdict_.drift = *drift.drift();
  findings.floor |= FaultSet{1} << bit;
  findings.sizes.at(bit - first) = drift.drift()->now / kFullTravel;
}

// A fault on top of another one is told apart before the episode takes the
// sample, because the name of the episode then stays.
void ValveEngine::Impl::StepEpisode(const Sample& sample,
                                    const Findings& findings) {
  Episode& episode = diagnosis_->episode;
  SecondFaultWatch& second = diagnosis_->second;
  const bool watched = Acts(Rule::kSecondHolds) && episode_open() &&
                       findings.settled && findings.stuck == 0;
  if (watched) {
    second.Judge(sample, diagnosis_->bank);
  } else {
    second.Restart();
  }
  episode.HoldName(second.hold());
  episode.Step(sample, diagnosis_->bank, findings, verdict_);
  if (episode_open() && second.outlived()) {
    // The fault that is left opens an episode of its own.
    episode.End(verdict_);
  }
  if (watched && episode_open()) {
    second.Follow(episode, beside_, verdict_);
  } else {
    second.Restart();
    verdict_.second = {};
  }
}

std::optional<Transition> ValveEngine::Impl::EndEpisode(EndReason reason) {
  needs_initialisation_ = true;
  suspected_ = false;
  beside_ = {};
  if (!episode_open()) {
    return std::nullopt;
  }
  return diagnosis_->episode.Close(reason, stamp_ns_, verdict_);
}

std::optional<Transition> ValveEngine::Impl::Adopt(EngineParts parts) {
  // If this throws, nothing has changed yet. The episode ends before the
  // exchange, because the bits of its faults belong to the old set.
  auto replacement = std::make_unique<Diagnosis>(std::move(parts));
  replacement->episode.HoldIsolation(isolation_held_);
  std::optional<Transition> closed = EndEpisode(EndReason::kModelChanged);
  diagnosis_ = std::move(replacement);
  order_.SetPeriod(models().sample_period_s);
  ClearVerdict();
  return closed;
}

void ValveEngine::Impl::HoldIsolation(bool hold) {
  isolation_held_ = hold;
  diagnosis_->episode.HoldIsolation(hold);
}

std::vector<std::byte> ValveEngine::Impl::Save() const {
  SnapshotWriter writer;
  writer.Put(kSnapshotFormat, models().content_hash);
  diagnosis_->coverage.Save(writer);
  diagnosis_->detection.Save(writer);
  diagnosis_->drift.Save(writer);
  diagnosis_->lone.Save(writer);
  return writer.Take();
}

bool ValveEngine::Impl::Restore(std::span<const std::byte> bytes) {
  SnapshotReader reader(bytes);
  std::uint32_t format = 0;
  std::uint64_t content_hash = 0;
  // Into copies, so that damaged bytes change nothing.
  Coverage coverage(models());
  Detection detection(models());
  DriftWatch drift(models());
  LoneReadings lone(models());
  if (!reader.Get(format, content_hash) || format != kSnapshotFormat ||
      content_hash != models().content_hash || !coverage.Restore(reader) ||
      !detection.Restore(reader) || !drift.Restore(reader) ||
      !lone.Restore(reader) || !reader.AtEnd()) {
    return false;
  }
  diagnosis_->coverage = coverage;
  diagnosis_->detection = std::move(detection);
  diagnosis_->drift = std::move(drift);
  diagnosis_->lone = lone;
  // The initialisation compares the next stamp with the restored one, and
  // discards all of this if too much time has passed.
  needs_initialisation_ = true;
  return true;
}

ValveEngine::ValveEngine(std::shared_ptr<const ModelSet> models)
    : ValveEngine(EngineParts(std::move(models))) {}
ValveEngine::ValveEngine(EngineParts parts)
    : impl_(std::make_unique<Impl>(std::move(parts))) {}
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
  return Adopt(EngineParts(std::move(models)));
}

std::optional<Transition> ValveEngine::Adopt(EngineParts parts) {
  return impl_->Adopt(std::move(parts));
}

void ValveEngine::HoldIsolation(bool hold) {
  impl_->HoldIsolation(hold);
}

void ValveEngine::ForgetSuperseded() {
  impl_->ForgetSuperseded();
}

void ValveEngine::Allow(const Unseen& unseen) {
  impl_->Allow(unseen);
}

void ValveEngine::TakeName(const NameBeside& name) {
  impl_->TakeName(name);
}

void ValveEngine::Suspect(bool suspected) {
  impl_->Suspect(suspected);
}

std::vector<std::byte> ValveEngine::Save() const {
  return impl_->Save();
}

bool ValveEngine::Restore(std::span<const std::byte> bytes) {
  return impl_->Restore(bytes);
}

const Verdict& ValveEngine::verdict() const {
  return impl_->verdict();
}

const Sample* ValveEngine::judged() const {
  return impl_->judged();
}

const ModelSet& ValveEngine::models() const {
  return impl_->models();
}

bool ValveEngine::episode_open() const {
  return impl_->episode_open();
}

}  // namespace fdi
