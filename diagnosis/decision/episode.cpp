#include "diagnosis/decision/episode.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/taught.h"

namespace fdi {
namespace {

constexpr int kMaxFaultSetSize = 4;  // more faults than this are no diagnosis

// In binary, a product such as 0.55 · 100 lies above the whole number; without
// the margin, ceil() would ask for one sample more.
int CountOf(double fraction, int samples) {
  return static_cast<int>(std::ceil(fraction * samples - 1e-9));
}

}  // namespace

IsolationWindow::IsolationWindow(const DecisionParameters& parameters,
                                 std::size_t faults)
    : length_(parameters.isolation_samples),
      needed_(CountOf(parameters.isolation_fraction, length_)),
      joining_(CountOf(parameters.join_fraction, length_)),
      ring_(static_cast<std::size_t>(length_), 0),
      counts_(faults, 0) {}

// counts_[i] is how many of the last filled_ sets contain fault i; a sample
// costs O(faults), however long t_k is. The ring needs no clearing: a slot is
// subtracted only once the ring has been filled again.
void IsolationWindow::Restart() {
  filled_ = 0;
  next_ = 0;
  std::fill(counts_.begin(), counts_.end(), 0);
}

void IsolationWindow::Push(FaultSet above_threshold) {
  FaultSet& slot = ring_[static_cast<std::size_t>(next_)];
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    int& count = counts_[i];
    if (filled_ == length_) {
      count -= static_cast<int>(slot >> i & 1U);
    }
    count += static_cast<int>(above_threshold >> i & 1U);
  }
  slot = above_threshold;
  next_ = (next_ + 1) % length_;
  filled_ = std::min(filled_ + 1, length_);
}

FaultSet IsolationWindow::Supported() const {
  FaultSet supporting = 0;
  FaultSet joining = 0;
  if (filled_ < length_) {
    return 0;
  }
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    const int count = counts_[i];
    supporting |= count >= needed_ ? FaultSet{1} << i : 0;
    joining |= count >= joining_ ? FaultSet{1} << i : 0;
  }
  return supporting != 0 ? joining : 0;
}

namespace {

constexpr double kMeanShare = 0.3;        // of the threshold
constexpr double kExcitationShare = 0.5;  // of the deviation at the detection
// Samples over which the variation of CV is measured: t_c within these bounds,
// because t_c itself may be anything from 1 to 100000.
constexpr int kMinCommands = 60;
constexpr int kMaxCommands = 200;

}  // namespace

void CommandHistory::Push(double cv) {
  ring_[next_] = cv;
  next_ = (next_ + 1) % ring_.size();
  filled_ = std::min(filled_ + 1, ring_.size());
}

// In two passes: for a command that hardly varies, Σ cv²/n − mean² would be the
// difference of two nearly equal numbers.
double CommandHistory::deviation() const {
  const auto count = static_cast<double>(filled_);
  double mean = 0.0;
  for (std::size_t i = 0; i < filled_; ++i) {
    mean += ring_[i] / count;
  }
  double variance = 0.0;
  for (std::size_t i = 0; i < filled_; ++i) {
    variance += (ring_[i] - mean) * (ring_[i] - mean) / count;
  }
  return std::sqrt(variance);
}

double CommandHistory::range() const {
  if (filled_ == 0) {
    return 0.0;
  }
  const auto [lowest, highest] = std::minmax_element(
      ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(filled_));
  return *highest - *lowest;
}

ClearingWindow::ClearingWindow(const ModelSet& models)
    : models_(&models),
      commands_(std::clamp(models.decision.clearing_samples, kMinCommands,
                           kMaxCommands)),
      ring_(static_cast<std::size_t>(models.decision.clearing_samples)) {}

void ClearingWindow::Observe(double cv) {
  cv_ = cv;
  commands_.Push(cv);
}

// The commands so far are those up to the detection: Observe() has already
// taken this sample.
void ClearingWindow::Restart() {
  deviation_then_ = commands_.deviation();
  range_then_ = commands_.range();
  lowest_ = cv_;
  highest_ = cv_;
  quiet_ = 0;
  filled_ = 0;
  next_ = 0;
  normal_count_ = 0;
  sums_.fill(0.0);
}

void ClearingWindow::Push(std::span<const double> residuals,
                          double normal_factor, bool abnormal) {
  quiet_ = abnormal ? 0 : quiet_ + 1;
  lowest_ = abnormal ? cv_ : std::min(lowest_, cv_);
  highest_ = abnormal ? cv_ : std::max(highest_, cv_);
  Entry& entry = ring_[next_];
  const bool full = filled_ == static_cast<int>(ring_.size());
  if (full) {
    normal_count_ -= entry.normal ? 1 : 0;
  }
  for (std::size_t c = 0; c < residuals.size(); ++c) {
    // A residual that abstains counts as 0: a NaN would never leave the sum.
    const double value = std::isfinite(residuals[c]) ? residuals[c] : 0.0;
    sums_[c] += value - (full ? entry.residuals[c] : 0.0);
    entry.residuals[c] = value;
  }
  entry.normal = normal_factor >= models_->decision.isolation_threshold;
  normal_count_ += entry.normal ? 1 : 0;
  next_ = (next_ + 1) % ring_.size();
  filled_ = std::min(filled_ + 1, static_cast<int>(ring_.size()));
}

bool ClearingWindow::Excited() const {
  return highest_ - lowest_ >= range_then_ ||
         commands_.deviation() >= kExcitationShare * deviation_then_;
}

bool ClearingWindow::Cleared() const {
  const int length = static_cast<int>(ring_.size());
  if (quiet_ < length || filled_ < length ||
      normal_count_ < models_->decision.isolation_fraction * length) {
    return false;
  }
  for (std::size_t c = 0; c < models_->channels.size(); ++c) {
    const double mean = sums_[c] / length;
    if (mean < kMeanShare * models_->channels[c].lower_threshold ||
        mean > kMeanShare * models_->channels[c].upper_threshold) {
      return false;
    }
  }
  // Last, because it may pass over all the commands.
  return Excited();
}

namespace {

// An episode that has lasted for a day, and for so many memories of the
// evidence, is long; a fault that is contradicted for so many is refuted.
constexpr double kLongS = 86400.0;
constexpr double kLongMemories = 4.0;
constexpr double kRefutingMemories = 2.0;

// Samples after which a finding that comes and goes is forgotten, at most.
constexpr int kLongestKept = 100000;

struct EpisodeRule {
  Rule rule;
  Stage stage;
};

// The rules of an episode, in the order of kRules.
constexpr auto kEpisodeRules = [] {
  constexpr auto kIs = [](const RuleRow& row) {
    return row.stage >= Stage::kName && row.stage <= Stage::kEnd;
  };
  std::array<EpisodeRule, std::ranges::count_if(kRules, kIs)> rules{};
  std::size_t next = 0;
  for (const RuleRow& row : kRules) {
    if (kIs(row)) {
      rules[next++] = {row.rule, row.stage};
    }
  }
  return rules;
}();

// A stuck transmitter is certain, so observers are not needed.
void ApplyStuckFindings(FaultSet stuck, Verdict& verdict) {
  verdict.normal_factor = 0.0;
  for (std::size_t i = 0; i < verdict.fault_factors.size(); ++i) {
    const bool is = (stuck >> i & 1U) != 0;
    verdict.fault_factors[i] = is ? 1.0 : 0.0;
    verdict.strengths[i] = is ? 1.0 : verdict.strengths[i];
  }
}

}  // namespace

Episode::Episode(std::shared_ptr<const FaultPlan> plan)
    : models_(&plan->models()),
      floor_names_(FindingsOf(*models_)),
      faults_(std::move(plan)),
      isolation_(models_->decision, models_->faults.size()),
      is_taught_(std::ranges::any_of(models_->observers, IsTaught)),
      recognition_(models_->decision, models_->faults.size()),
      clearing_(*models_),
      // A single disturbance, which stays in the window for t_k samples,
      // refutes nothing.
      misfit_counts_(models_->faults.size(),
                     std::max(models_->decision.isolation_samples * 3 / 2,
                              models_->decision.reisolation_samples)),
      names_last_(models_->physics.empty() &&
                  models_->decision.interpolation_allowance > 0.0),
      contradictions_(models_->faults.size(),
                      static_cast<int>(kRefutingMemories *
                                       models_->decision.evidence_window)),
      shares_(models_->faults.size()) {
  left_.reserve(static_cast<std::size_t>(models_->decision.detection_samples) +
                1);
}

void Episode::Score(const ObserverBank& bank, Verdict& verdict) const {
  faults_.Score(bank, verdict);
}

void Episode::Step(const Sample& sample, const ObserverBank& bank,
                   const Findings& findings, Verdict& verdict) {
  // Before any return: at a detection, the commands before it are needed.
  clearing_.Observe(sample.Has(Signal::kCv) ? sample[Signal::kCv] : 0.0);
  const bool begins = verdict.state == State::kNormal;
  if (begins && !findings.detected) {
    return;
  }
  if (begins) {
    clearing_.Restart();
    begun_ = false;
    floor_ = 0;
    over_.fill(0);
    kept_.fill(models_->decision.isolation_samples * 3 / 2);
  }
  // The floor may open an episode before the observers have settled. Until then
  // they show a transient, which would stay in the evidence for the length of
  // its memory, so no fault has a factor yet.
  if (findings.settled && !begun_) {
    faults_.Restart();
    isolation_.Restart();
    recognition_.Restart();
    recognised_ = 0;
    begun_ = true;
  }
  if (begun_ && findings.settled) {
    faults_.PushInputs(sample);
    faults_.Update(bank);
  }
  ApplyEvidence(verdict);
  // Stuck transmitters set every factor, so the floor sets its own after them.
  // The detection follows both, because its transition carries the factors of
  // this sample.
  if (findings.stuck != 0) {
    ApplyStuckFindings(findings.stuck, verdict);
  }
  ApplyFloorFindings(findings, verdict);
  if (begins) {
    Open(*findings.detected, verdict);
  }
  floor_ |= findings.floor;
  Proposal proposal{sample, findings, verdict};
  for (const EpisodeRule& step : kEpisodeRules) {
    const bool acts = step.stage == Stage::kFloor || findings.settled;
    if (acts && !(step.stage == Stage::kName && proposal.over) &&
        Acts(step.rule)) {
      Apply(step.rule, proposal);
    }
  }
}

// One case for each rule of an episode, in any order: kRules has that in which
// they act. These say which faults are supported, and whether any may be.
void Episode::Apply(Rule rule, Proposal& p) {
  Verdict& verdict = p.verdict;
  FaultSet& supported = p.supported;
  switch (rule) {
    case Rule::kSupport:
      isolation_.Push(
          FactorsFrom(models_->decision.isolation_threshold, verdict));
      supported = isolation_.Supported();
      CountSupport(supported);
      break;
    case Rule::kMisfits:
      // A stuck transmitter is certain, whatever its observers say.
      CountMisfits(p.findings.stuck != 0 ? 0 : faults_.misfits(), verdict);
      break;
    case Rule::kSecondHolds:
      HoldName(p);
      break;
    case Rule::kWithdraw:
      Withdraw(verdict);
      break;
    case Rule::kMisfitIsNoName:
      supported = IsAllOf(supported, misfits_) ? 0 : supported;
      break;
    case Rule::kRecognise:
      Recognise();
      // It fits over t_k samples, even if those with its factor are rare.
      supported = supported == 0 ? recognised_ : Recognised(supported);
      break;
    case Rule::kHeld:
      if (isolation_held_) {
        Block(p);
      }
      break;
    case Rule::kDrift:
      if (p.findings.drift) {
        Block(p);
      }
      break;
    case Rule::kNormalGate:
      if (LooksNormal(verdict)) {
        Block(p);
      }
      break;
    case Rule::kProven:
      if (supported == 0) {
        NameEarly(p.sample, p.findings.beginning, verdict);
      }
      break;
    case Rule::kNothingSupported:
      p.over = supported == 0;
      break;
    default:
      ApplyToName(rule, p);
  }
}

// These decide whether the supported faults become the name.
void Episode::ApplyToName(Rule rule, Proposal& p) {
  Verdict& verdict = p.verdict;
  FaultSet& supported = p.supported;
  switch (rule) {
    case Rule::kFourAtMost:
      // A set this large is no diagnosis: its faults remain candidates. Sets
      // without a floor keep their answers.
      if (models_->floor && std::popcount(supported) > kMaxFaultSetSize) {
        supported = floor_;
      }
      break;
    case Rule::kLasting:
      supported = Lasting(supported, verdict);
      break;
    case Rule::kLossBeside:
      supported |= LossBeside(supported, floor_, p.sample, verdict);
      break;
    case Rule::kFirstName:
      NameFirst(p);
      break;
    case Rule::kReisolation:
      Contend(p);
      break;
    case Rule::kMisfitsAreNoCandidates:
      ApplyMisfits(verdict);
      break;
    case Rule::kUnknown:
      JudgeUnknown(verdict);
      break;
    case Rule::kFloorNames:
      NameFloor(verdict);
      break;
    case Rule::kForgetFindings:
      if (p.findings.settled) {
        ForgetFindings(p.findings.floor, verdict);
      }
      DropFindings(verdict);
      break;
    case Rule::kCleared:
      clearing_.Push({verdict.residuals.data(), models_->channels.size()},
                     verdict.normal_factor, p.findings.abnormal);
      if (clearing_.Cleared()) {
        End(verdict);
      }
      break;
    default:
      break;  // Handled at another stage.
  }
}

// Both transitions carry the name of the episode, which is reset then.
void Episode::End(Verdict& verdict) const {
  Emit(TransitionKind::kCleared, verdict.stamp_ns, verdict);
  Emit(TransitionKind::kClosed, verdict.stamp_ns, verdict, EndReason::kCleared);
  verdict.state = State::kNormal;
  verdict.isolated = 0;
  verdict.unknown = Unknown::kNone;
}

void Episode::Hold(Verdict& verdict) const {
  ApplyEvidence(verdict);
  ApplyMisfits(verdict);
}

// Before the gathering has begun, the evidence is that of an earlier episode.
void Episode::ApplyEvidence(Verdict& verdict) const {
  if (begun_) {
    faults_.ApplyEvidence(verdict);
  } else {
    std::ranges::fill(verdict.fault_factors, 0.0);
  }
}

Transition Episode::Close(EndReason reason, std::int64_t stamp_ns,
                          Verdict& verdict) {
  const Transition closed =
      Make(TransitionKind::kClosed, stamp_ns, reason, verdict);
  verdict.state = State::kNormal;
  verdict.isolated = 0;
  verdict.second = {};
  verdict.unknown = Unknown::kNone;
  verdict.detected = false;
  return closed;
}

void Episode::Open(std::int64_t stamp_ns, Verdict& verdict) {
  verdict.state = State::kDetected;
  verdict.isolated = 0;
  verdict.unknown = Unknown::kTooEarly;
  detection_stamp_ns_ = stamp_ns;
  age_ = 0;
  without_fault_ = 0;
  contender_run_ = 0;
  left_.clear();
  early_ = false;
  misfits_ = 0;
  misfit_counts_.Restart();
  contradictions_.Restart();
  std::ranges::fill(shares_, 0.0);
  stood_ = 0;
  Emit(TransitionKind::kDetected, detection_stamp_ns_, verdict);
}

// Sets the factors of the floor's findings beside those of the faults.
void Episode::ApplyFloorFindings(const Findings& findings,
                                 Verdict& verdict) const {
  const auto count = static_cast<std::size_t>(std::popcount(floor_names_));
  const std::size_t first = models_->faults.size() - count;
  for (std::size_t i = 0; i < count; ++i) {
    const bool found = (findings.floor >> (first + i) & 1U) != 0;
    verdict.fault_factors[first + i] = found ? 1.0 : 0.0;
    verdict.strengths[first + i] = found ? findings.sizes[i] : 0.0;
  }
}

// The findings of the floor name the episode until a fault is isolated.
void Episode::NameFloor(Verdict& verdict) {
  const bool named = (verdict.isolated & ~floor_names_) != 0;
  if (isolation_held_ || named || (floor_ & ~verdict.isolated) == 0) {
    return;
  }
  Name(floor_, verdict);
}

// A finding of the floor names the episode for as long as it is present. If it
// has been absent for longer than a fault may misfit, and normal operation does
// not explain the samples either, the episode now shows something else. A
// finding that comes and goes is kept twice as long each time. A valve that
// looks healthy keeps its name.
void Episode::ForgetFindings(FaultSet present, const Verdict& verdict) {
  const DecisionParameters& decision = models_->decision;
  const bool abnormal = verdict.normal_factor < decision.isolation_threshold;
  const std::size_t first =
      models_->faults.size() -
      static_cast<std::size_t>(std::popcount(floor_names_));
  for (std::size_t i = 0; first + i < models_->faults.size(); ++i) {
    const FaultSet bit = FaultSet{1} << (first + i);
    int& over = over_.at(i);
    over = (present & bit) != 0 ? 0 : over + (abnormal ? 1 : 0);
    if ((floor_ & bit) != 0 && over >= kept_.at(i)) {
      floor_ &= ~bit;
      kept_.at(i) *= kept_.at(i) < kLongestKept ? 2 : 1;
    }
  }
}

// Not in a sample that changes the name already.
void Episode::DropFindings(Verdict& verdict) const {
  const FaultSet gone = verdict.isolated & floor_names_ & ~floor_;
  if (gone == 0 || verdict.transition_count > 0) {
    return;
  }
  verdict.isolated &= ~gone;
  if (verdict.isolated == 0) {
    verdict.state = State::kDetected;
    verdict.unknown = Unknown::kTooEarly;
  }
  Emit(TransitionKind::kReisolated, verdict.stamp_ns, verdict);
}

FaultSet Episode::FactorsFrom(double threshold, const Verdict& verdict) const {
  FaultSet from = 0;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    if (verdict.fault_factors[i] >= threshold) {
      from |= FaultSet{1} << i;
    }
  }
  // A finding has the factor 1 while it lasts and would be isolated like a
  // fault.
  return from & ~floor_names_;
}

// Wald's sequential test: before t_k, the few faults that are left once the
// likelihood ratio to every other one and to normal operation is more than m/α,
// with m faults (findings of the floor have none), so that a name without the
// fault has at most the probability α where the models are right. They err most
// in the first moments of a fault, so a fault left in any of more than n_d
// samples counts; an input that has moved with the fault is evidence beside the
// models, and n_d samples are enough.
FaultSet Episode::Proven(const Verdict& verdict) {
  const DecisionParameters& decision = models_->decision;
  if (decision.early_error <= 0.0 || isolation_.full()) {
    return 0;
  }
  const double rivals =
      static_cast<double>(models_->faults.size()) - std::popcount(floor_names_);
  const FaultSet left =
      faults_.Unrefuted(std::log(rivals / decision.early_error));
  if ((left & FactorsFrom(decision.isolation_threshold, verdict)) == 0) {
    left_.clear();
    return 0;
  }
  const auto length = static_cast<std::size_t>(decision.detection_samples);
  if (left_.size() > length) {
    left_.erase(left_.begin());
  }
  left_.push_back(left);
  const std::size_t needed = length + (faults_.ShownByInputs(left) ? 0 : 1);
  if (left_.size() < needed) {
    return 0;
  }
  const FaultSet any =
      std::accumulate(left_.end() - static_cast<std::ptrdiff_t>(needed),
                      left_.end(), FaultSet{0}, std::bit_or<>());
  return std::popcount(any) <= kMaxFaultSetSize ? any : 0;
}

void Episode::Name(FaultSet faults, Verdict& verdict) {
  const bool first = verdict.state == State::kDetected;
  verdict.state = State::kIsolated;
  stood_ = 0;
  verdict.isolated = faults;
  verdict.unknown = Unknown::kNone;
  Emit(first ? TransitionKind::kIsolated : TransitionKind::kReisolated,
       verdict.stamp_ns, verdict);
}

// A taught condition, seen on this valve before and named by a person, stands
// for the faults that look like it: of all explanations that the data leave, it
// is the one that has happened here. It must fit, and be as good an explanation
// as any other, in nearly all of t_k samples; once it is recognised, it
// stays so until the evidence refutes it.
void Episode::Recognise() {
  if (!is_taught_) {
    return;
  }
  const DecisionParameters& decision = models_->decision;
  recognition_.Push(faults_.Recognised(decision.evidence_core, true));
  recognised_ =
      recognition_.Supported() |
      (recognised_ & faults_.Recognised(decision.evidence_support, false));
}

FaultSet Episode::Recognised(FaultSet set) const {
  const FaultSet taught = set & recognised_;
  return taught != 0 ? taught : set;
}

// A line that is lost is lost within minutes. A fault that was the name, and
// fitted, for half the memory of the evidence before the flow was found too low
// has grown, or meets a command that shows it: it explains the loss.
bool Episode::ExplainsLoss(FaultSet set, const Verdict& verdict) const {
  const FaultSet known = set & ~floor_names_;
  return faults_.judges_fit() && known != 0 &&
         (known & ~verdict.isolated) == 0 &&
         (verdict.isolated & floor_names_) == 0 &&
         stood_ >= 0.5 * models_->decision.evidence_window;
}

// Too little flow behind a rod that follows is more likely lost in the line
// than in the valve, so it stands beside a fault of valve or sensor. A flow
// transmitter stands alone while the command stays where it was, for the loop
// would answer a loss of flow, and some flow is read: no flow at all is a dead
// transmitter or a dead line.
FaultSet Episode::LossBeside(FaultSet set, FaultSet floor, const Sample& sample,
                             const Verdict& verdict) const {
  const int index = FaultIndex(*models_, kLowFlow);
  const FaultSet loss = index < 0 ? 0 : floor & FaultSet{1} << index;
  if (!Acts(Rule::kLossBeside) || loss == 0 || ExplainsLoss(set, verdict)) {
    return 0;
  }
  bool of_process = true;
  const double none = models_->floor->flow_margin * models_->floor->flow_high;
  bool of_meter = models_->validity.cv.Contains(sample[Signal::kCv]) &&
                  sample[Signal::kF] > none;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    if (Has(set & ~floor_names_, i)) {
      const FaultFacts& facts = FaultFactsOf(models_->faults[i]);
      of_process =
          of_process && facts.acts_on == ActsOn::kInputs && !facts.transmitter;
      of_meter = of_meter && facts.acts_on == ActsOn::kFlowReading;
    }
  }
  return of_process || of_meter ? 0 : loss;
}

// Samples that normal operation explains count neither way.
void Episode::CountMisfits(FaultSet misfits, const Verdict& verdict) {
  misfits_ = misfits | misfit_counts_.refuted();
  if (verdict.normal_factor >= models_->decision.isolation_threshold) {
    return;
  }
  misfit_counts_.Push(misfits);
  misfits_ |= misfit_counts_.refuted();
  stood_ += IsAllOf(verdict.isolated, misfits_) ? 0 : 1;
}

// Fit does not choose among faults, evidence does. But where the only fault of
// a name is refuted, the name is taken back: the episode is outside all faults
// that are known. A set stays, because its faults look alike however well their
// models fit; only a loss of flow is no longer put down to it.
void Episode::Withdraw(Verdict& verdict) {
  if (!IsAllOf(verdict.isolated, misfit_counts_.refuted())) {
    return;
  }
  stood_ = 0;
  if (std::popcount(verdict.isolated & ~floor_names_) > 1) {
    return;
  }
  early_ = false;
  without_fault_ = models_->decision.isolation_samples;
  verdict.isolated = floor_;
  verdict.state = floor_ != 0 ? State::kIsolated : State::kDetected;
  verdict.unknown = floor_ != 0 ? Unknown::kNone : Unknown::kOutsideKnown;
  Emit(TransitionKind::kReisolated, verdict.stamp_ns, verdict);
}

// Some faults, all of them misfits; findings of the floor do not count.
bool Episode::IsAllOf(FaultSet faults, FaultSet misfits) const {
  const FaultSet known = faults & ~floor_names_;
  return known != 0 && (known & ~misfits) == 0;
}

// While an episode has no name, faults that do not fit are no candidates.
void Episode::ApplyMisfits(Verdict& verdict) const {
  constexpr double kShare = 0.25;  // of T; a candidate has 0.5
  const double most = kShare * models_->decision.isolation_threshold;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    if ((verdict.isolated & ~floor_names_) == 0 && Has(misfits_, i)) {
      verdict.fault_factors[i] = std::min(verdict.fault_factors[i], most);
    }
  }
}

// Before t_k, and whether the line has lost its flow once there is a name. The
// floor takes its time: findings about to come hold back an early name.
void Episode::NameEarly(const Sample& sample, FaultSet beginning,
                        Verdict& verdict) {
  const FaultSet proven = Proven(verdict);
  const FaultSet named = verdict.isolated & ~floor_names_;
  // A set is narrowed to the one fault that is left, and to no other set.
  const bool narrower =
      (proven & ~named) == 0 && std::popcount(proven) == 1 && proven != named;
  const bool early = proven != 0 && ((proven & named) == 0 || narrower);
  const FaultSet name = early ? Recognised(proven) : verdict.isolated;
  const FaultSet loss = LossBeside(name, floor_ | beginning, sample, verdict);
  if ((early && (loss & ~floor_) == 0) || (loss & floor_ & ~name) != 0) {
    early_ = early_ || early;
    Name(name | loss, verdict);
  }
}

bool Episode::IsLong() const {
  return age_ > std::max(kLongS / models_->sample_period_s,
                         kLongMemories * models_->decision.evidence_window);
}

// The memory of a share is half the age. Samples that support no set count
// neither way.
void Episode::CountSupport(FaultSet supported) {
  if (!names_last_) {
    return;
  }
  contradictions_.Push(faults_.Contradicted());
  const double gain = std::min(1.0, 2.0 / std::max(age_, 1));
  for (std::size_t i = 0; supported != 0 && i < shares_.size(); ++i) {
    shares_[i] += gain * ((Has(supported, i) ? 1.0 : 0.0) - shares_[i]);
  }
}

// A fault that grows slowly passes for hours between two trained strengths,
// where a look-alike may be ahead that is just at one of its own. To be ahead
// is not to refute: in a long episode a fault leaves the name once the evidence
// refutes it, or has supported it for next to nothing of the episode, and
// joins it if it is supported for more than a while. A set too large to be a
// diagnosis says nothing against the name.
FaultSet Episode::Lasting(FaultSet supported, const Verdict& verdict) const {
  constexpr double kJoining = 0.5;
  constexpr double kLeaving = 0.25;
  FaultSet standing = verdict.isolated & ~floor_names_;
  FaultSet joining = supported & ~floor_names_;
  if (!names_last_ || standing == 0 || !IsLong()) {
    return supported;
  }
  for (std::size_t i = 0; i < shares_.size(); ++i) {
    const FaultSet fault = FaultSet{1} << i;
    const bool refuted = (contradictions_.refuted() & fault) != 0;
    joining &= refuted || shares_[i] < kJoining ? ~fault : ~FaultSet{0};
    standing &= refuted || shares_[i] < kLeaving ? ~fault : ~FaultSet{0};
  }
  if (standing == 0) {
    return supported;
  }
  const FaultSet both = standing | joining;
  return std::popcount(both) > kMaxFaultSetSize ? joining : both;
}

// Whatever the name does not explain is, or may be, due to a second fault.
void Episode::HoldName(Proposal& proposal) {
  if (hold_ == NameHold::kNone) {
    return;
  }
  Block(proposal);
  if (hold_ == NameHold::kExplained) {
    misfits_ = 0;
    misfit_counts_.Restart();
  }
}

// A contender for the name starts over when the block ends.
void Episode::Block(Proposal& proposal) {
  contender_run_ = 0;
  left_.clear();
  proposal.over = true;
}

bool Episode::LooksNormal(const Verdict& verdict) const {
  return verdict.normal_factor >= models_->decision.isolation_threshold;
}

// The first set of equation (6) replaces findings of the floor and a name from
// before t_k.
void Episode::NameFirst(Proposal& proposal) {
  const FaultSet isolated = proposal.verdict.isolated;
  const bool early =
      std::exchange(early_, false) && proposal.supported != isolated;
  if (!early && (isolated & ~floor_names_) != 0) {
    return;
  }
  if ((proposal.supported & ~floor_names_) != 0) {
    contender_run_ = 0;
    Name(proposal.supported, proposal.verdict);
  }
  proposal.over = true;
}

// A different set must persist before it replaces the isolated one. Samples
// that support no set, as by noise on one factor, count neither way.
void Episode::Contend(Proposal& proposal) {
  const FaultSet supported = proposal.supported;
  Verdict& verdict = proposal.verdict;
  contender_run_ = supported == contender_ ? contender_run_ + 1 : 1;
  contender_ = supported;
  if (supported != verdict.isolated &&
      contender_run_ >= models_->decision.reisolation_samples) {
    stood_ = 0;
    verdict.isolated = supported;
    verdict.state = supported != 0 ? State::kIsolated : State::kDetected;
    // More than four faults explain it, so it is not outside what is known.
    verdict.unknown = supported != 0 ? Unknown::kNone : Unknown::kTooEarly;
    Emit(TransitionKind::kReisolated, verdict.stamp_ns, verdict);
  }
}

// The episode is outside all known faults if no factor reached T/2 in the last
// t_k samples and its age exceeds twice that.
void Episode::JudgeUnknown(Verdict& verdict) {
  const DecisionParameters& decision = models_->decision;
  // A valve that looks normal again needs no fault as explanation.
  const bool explained =
      verdict.normal_factor >= decision.isolation_threshold ||
      FactorsFrom(0.5 * decision.isolation_threshold, verdict) != 0;
  without_fault_ = explained ? 0 : without_fault_ + 1;
  ++age_;
  if (verdict.state == State::kDetected) {
    const bool outside = without_fault_ >= decision.isolation_samples &&
                         age_ > 2 * decision.isolation_samples;
    verdict.unknown = outside ? Unknown::kOutsideKnown : Unknown::kTooEarly;
  }
}

Transition Episode::Make(TransitionKind kind, std::int64_t stamp_ns,
                         EndReason reason, const Verdict& verdict) const {
  Transition transition;
  transition.kind = kind;
  transition.stamp_ns = stamp_ns;
  transition.detection_stamp_ns = detection_stamp_ns_;
  transition.faults = verdict.isolated;
  transition.reason = reason;
  transition.drift = verdict.drift;
  transition.unknown = verdict.unknown;
  for (std::size_t i = 0; i < models_->faults.size(); ++i) {
    const bool counts =
        verdict.isolated == 0 || (verdict.isolated >> i & 1U) != 0;
    if (counts && verdict.fault_factors[i] >= transition.factor) {
      transition.factor = verdict.fault_factors[i];
      transition.strength = verdict.isolated == 0 ? 0.0 : verdict.strengths[i];
    }
  }
  return transition;
}

// Verdict::transitions has room for the most that one sample brings: a
// detection, a name, CLEARED and CLOSED; or, from a new source, the end of the
// former episode, a detection and a name.
void Episode::Emit(TransitionKind kind, std::int64_t stamp_ns, Verdict& verdict,
                   EndReason reason) const {
  verdict.transitions[static_cast<std::size_t>(verdict.transition_count++)] =
      Make(kind, stamp_ns, reason, verdict);
}

}  // namespace fdi
