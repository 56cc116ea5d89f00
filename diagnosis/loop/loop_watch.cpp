#include "diagnosis/loop/loop_watch.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "base/usual_period.h"
#include "diagnosis/model/fault_catalogue.h"

namespace fdi {
namespace {

constexpr double kGapIntervals = 3.0;
constexpr double kOpMoves = 1.0;  // Least motion of OP in a telling window [%].
// Factors of a finding that is sure and one that is likely, as CertaintyOf()
// reads them.
constexpr double kSureFactor = 1.0;
constexpr double kLikelyFactor = 0.75;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
// The interval [ms] is in the low half of the hash.
constexpr std::uint64_t kHashBase = 0xA0D2'7000'0000'0000ULL;
constexpr double kMsPerSecond = 1e3;
constexpr double kOtherInterval = 0.2;  // Share by which another one differs.

// The size of a finding according to the evidence, in shares of the span.
Estimate SizeOf(const loop::Audit& audit) {
  const loop::Evidence& e = audit.evidence;
  constexpr double kPerCent = 0.01;
  const auto share = [](double value) { return std::clamp(value, 0.0, 1.0); };
  const auto band = e.band();
  if (audit.verdict == loop::Verdict::kStiction && band) {
    return {share(kPerCent * band->width), share(kPerCent * band->low),
            share(kPerCent * band->high)};
  }
  const double size =
      audit.verdict == loop::Verdict::kSaturated ? share(e.at_limit)
      : audit.verdict == loop::Verdict::kHunting ? share(e.hunts)
                                                 : share(kPerCent * e.op_range);
  return {size, size, size};
}

}  // namespace

std::shared_ptr<const ModelSet> AuditModels(double interval_s) {
  auto models = std::make_shared<ModelSet>();
  models->name = "audit";
  models->version = 1;
  models->content_hash =
      kHashBase +
      static_cast<std::uint64_t>(std::llround(interval_s * kMsPerSecond));
  models->preset = "audit";
  models->sample_period_s = interval_s;
  models->decision.settling_samples = 0;
  for (int finding = kFirstLoopFinding; finding <= kLastFinding; ++finding) {
    if (IsLoopFinding(finding)) {
      models->faults.push_back(finding);
    }
  }
  return models;
}

std::shared_ptr<const ModelSet> AuditModels(std::uint64_t content_hash) {
  constexpr std::uint64_t kLongest = 3'600'000;  // [ms]
  const std::uint64_t interval_ms = content_hash - kHashBase;
  return content_hash > kHashBase && interval_ms <= kLongest
             ? AuditModels(static_cast<double>(interval_ms) / kMsPerSecond)
             : nullptr;
}

int FindingOf(loop::Verdict verdict) {
  switch (verdict) {
    case loop::Verdict::kStiction:
      return kStiction;
    case loop::Verdict::kNoResponse:
      return kNoResponse;
    case loop::Verdict::kFrozen:
      return kReadingFrozen;
    case loop::Verdict::kSaturated:
      return kOutputSaturated;
    case loop::Verdict::kTuning:
      return kOscillationTuning;
    case loop::Verdict::kExternal:
      return kOscillationExternal;
    case loop::Verdict::kHunting:
      return kPositionerHunts;
    case loop::Verdict::kUndetermined:
    case loop::Verdict::kQuantised:
      return 0;
  }
  return 0;
}

LoopWatch::LoopWatch(std::size_t phase,
                     std::shared_ptr<const SeverityCatalogue> severities,
                     char service)
    : phase_(phase), service_(service), severities_(std::move(severities)) {
  verdict_.quality = Quality::kUnassigned;
  verdict_.residuals.fill(kNone);
}

bool LoopWatch::IsInOrder(const Sample& sample) {
  const bool same = seen_ && sample.source_id == last_.source_id;
  if (same && sample.seq <= last_.seq) {
    verdict_.intake = sample.seq == last_.seq ? Intake::kRepeat : Intake::kLate;
    return false;
  }
  verdict_.intake = Intake::kAccepted;
  if (!same || sample.epoch != last_.epoch ||
      sample.stamp_ns <= last_.stamp_ns) {
    Restart();
  }
  return true;
}

const Verdict& LoopWatch::Supersede() {
  verdict_.transition_count = 0;
  at_point_ = false;
  found_normal_ = false;
  verdict_.intake = Intake::kSuperseded;
  return verdict_;
}

const Verdict& LoopWatch::Step(const Sample& sample, double period_s) {
  verdict_.transition_count = 0;
  at_point_ = false;
  found_normal_ = false;
  if (!IsInOrder(sample)) {
    return verdict_;
  }
  verdict_.stamp_ns = sample.stamp_ns;
  verdict_.source_id = sample.source_id;
  verdict_.seq = sample.seq;
  const bool whole = AddPoint(sample, period_s);
  last_ = sample;
  seen_ = true;
  if (answer_ && at_point_) {
    Count(*std::exchange(answer_, std::nullopt));
  }
  if (models_ && at_point_) {
    Tell();
  }
  if (models_) {
    verdict_.quality = sample.mode != ValveMode::kAuto ? Quality::kInhibited
                       : !whole                        ? Quality::kBadInput
                       : ring_.size() < kPoints        ? Quality::kSettling
                                                       : Quality::kLive;
  }
  return verdict_;
}

// @returns whether the readings are there that an audit needs.
bool LoopWatch::AddPoint(const Sample& sample, double period_s) {
  const double cv = GoodReading(sample, Signal::kCv);
  const double f = GoodReading(sample, Signal::kF);
  const double x = GoodReading(sample, Signal::kX);
  const bool whole =
      std::isfinite(cv) && (std::isfinite(f) || std::isfinite(x) ||
                            std::isfinite(GoodReading(sample, Signal::kPv)));
  if (sample.mode != ValveMode::kAuto || !whole) {
    Restart();
    return whole;
  }
  const double interval_s =
      std::max(kInterval_s,
               std::round(UsualPeriod(period_s) * kMsPerSecond) / kMsPerSecond);
  if (ring_.empty()) {
    ring_.reserve(kPoints);
    interval_s_ = interval_s;
    first_ns_ = sample.stamp_ns;
  }
  const double at_s = static_cast<double>(sample.stamp_ns - first_ns_) * 1e-9;
  if (!ring_.empty()) {
    const double since_s =
        at_s - ring_[(added_ - 1) % kPoints].at_ms / kMsPerSecond;
    // Stamps that shiver are not to cost a point.
    if (since_s < interval_s_ - 0.5 * std::min(period_s, interval_s_)) {
      return true;
    }
    // Also before at_ms overflows, after 49 days.
    if (since_s > kGapIntervals * interval_s_ ||
        std::abs(interval_s - interval_s_) > kOtherInterval * interval_s_ ||
        at_s * kMsPerSecond > std::numeric_limits<std::uint32_t>::max()) {
      Restart();
      return AddPoint(sample, period_s);
    }
  }
  const Point point{
      static_cast<std::uint32_t>(std::llround(at_s * kMsPerSecond)),
      static_cast<float>(cv), static_cast<float>(f), static_cast<float>(x)};
  const std::size_t row = added_ % kPoints;
  if (ring_.size() < kPoints) {
    ring_.push_back(point);
  } else {
    ring_[row] = point;
  }
  AddControl(sample, row);
  ++added_;
  at_point_ = true;
  due_ = due_ || (ring_.size() == kPoints && (added_ + phase_) % kHop == 0);
  return true;
}

// Loops without PV, which most are, have no memory for it.
void LoopWatch::AddControl(const Sample& sample, std::size_t row) {
  const double pv = GoodReading(sample, Signal::kPv);
  if (control_.empty() && std::isnan(pv)) {
    return;
  }
  control_.resize(ring_.size(), {kNone, kNone});
  control_[row] = {pv,
                   std::isnan(pv) ? kNone : GoodReading(sample, Signal::kSp)};
}

void LoopWatch::Restart() {
  ring_.clear();
  control_.clear();
  added_ = 0;
  due_ = false;
  taken_ = false;
  answer_.reset();
  vote_ = {};
}

std::optional<loop::Window> LoopWatch::TakeWindow() {
  if (!due_ || taken_) {
    return std::nullopt;
  }
  due_ = false;
  taken_ = true;
  taken_ns_ = verdict_.stamp_ns;
  loop::Window window;
  window.period_s = interval_s_;
  window.open_op = 0.0;  // CV is % of closing.
  for (std::size_t k = 0; k < kPoints; ++k) {
    const Point& point = ring_[(added_ + k) % kPoints];
    window.op.push_back(double{point.cv});
    window.pv.push_back(double{point.f});
    window.x.push_back(double{point.x});
  }
  SetControlled(window);
  if (window.pv.empty()) {  // Now F, now X.
    taken_ = false;
    return std::nullopt;
  }
  return window;
}

// Decides between PV, F (which is in window.pv) and X; one that is missing
// anywhere does not count.
void LoopWatch::SetControlled(loop::Window& window) const {
  const auto has_gap = [](const std::vector<double>& values) {
    return std::ranges::any_of(values, [](double v) { return std::isnan(v); });
  };
  if (has_gap(window.x)) {
    window.x.clear();
  }
  std::vector<double> pv;
  for (std::size_t k = 0; k < control_.size(); ++k) {
    const Control& control = control_[(added_ + k) % kPoints];
    pv.push_back(control.pv);
    window.sp.push_back(control.sp);
  }
  if (!pv.empty() && !has_gap(pv)) {
    // Its sense and whether it is an integral are read off the record.
    window.pv = std::move(pv);
    window.gain_sign = 0;
    loop::SetService(service_, window);
    if (has_gap(window.sp)) {
      window.sp.clear();
    }
    return;
  }
  window.sp.clear();
  // CV is % of closing, so that F falls with it; F over CV is no integral.
  window.gain_sign = -1;
  window.integrating = false;
  if (has_gap(window.pv)) {
    window.pv = window.x;
    window.gain_sign = 1;
  }
}

void LoopWatch::Enter(std::optional<loop::Audit> audit) {
  if (std::exchange(taken_, false)) {
    answer_ = std::move(audit);
  }
}

void LoopWatch::Count(const loop::Audit& audit) {
  if (!models_) {
    models_ = AuditModels(interval_s_);
    verdict_.confidence = 1.0;
    verdict_.normal_factor = 1.0;
  }
  const int finding = FindingOf(audit.verdict);
  // A loop at rest says nothing, but that its position rests, too.
  if (finding == 0 && audit.evidence.op_range < kOpMoves &&
      found_.finding != kPositionerHunts) {
    return;
  }
  if (vote_.times == 0 || finding != vote_.found.finding) {
    vote_ = {{}, 0, taken_ns_};
  }
  vote_.found = {finding, SizeOf(audit),
                 audit.sure ? kSureFactor : kLikelyFactor};
  ++vote_.times;
  if (named_ && finding == found_.finding) {
    Name(vote_.found);
  }
  found_normal_ = finding == 0 && vote_.times == kConfirmations;
}

// Turns the votes into transitions. Detection and name are a point apart: a
// trace restarts with the name, and earlier points belong to the detection.
void LoopWatch::Tell() {
  const bool confirmed = vote_.times >= kConfirmations;
  const int voted = vote_.found.finding;
  if (verdict_.detected && !named_) {
    Name(found_);
    Transit(TransitionKind::kIsolated);
  } else if (!verdict_.detected && confirmed && voted != 0) {
    found_ = vote_.found;
    verdict_.detected = true;
    verdict_.state = State::kDetected;
    verdict_.unknown = Unknown::kTooEarly;
    verdict_.normal_factor = 0.0;
    detection_ns_ = vote_.since_ns;
    Transit(TransitionKind::kDetected);
  } else if (verdict_.detected && confirmed && voted == 0) {
    Transit(TransitionKind::kCleared);
    Transit(TransitionKind::kClosed, EndReason::kCleared);
    Forget();
  } else if (verdict_.detected && confirmed && voted != found_.finding) {
    Name(vote_.found);
    Transit(TransitionKind::kReisolated);
  } else if (named_ && SeverityOf(found_) > told_) {
    Transit(TransitionKind::kChanged);
  }
}

Severity LoopWatch::SeverityOf(const Found& found) const {
  const auto bands = severities_->find(found.finding);
  return bands != severities_->end()
             ? SeverityAt(bands->second, found.size.strength)
             : Severity::kMedium;
}

void LoopWatch::Name(const Found& found) {
  found_ = found;
  named_ = true;
  const auto bit =
      static_cast<std::size_t>(FaultIndex(*models_, found.finding));
  verdict_.fault_factors.fill(0.0);
  verdict_.strengths.fill(0.0);
  verdict_.fault_factors[bit] = found.factor;
  verdict_.strengths[bit] = found.size.strength;
  verdict_.isolated = FaultSet{1} << bit;
  verdict_.state = State::kIsolated;
  verdict_.unknown = Unknown::kNone;
}

// There is no episode any more.
void LoopWatch::Forget() {
  found_ = {};
  named_ = false;
  verdict_.fault_factors.fill(0.0);
  verdict_.strengths.fill(0.0);
  verdict_.isolated = 0;
  verdict_.state = State::kNormal;
  verdict_.unknown = Unknown::kNone;
  verdict_.detected = false;
  verdict_.normal_factor = 1.0;
}

void LoopWatch::Transit(TransitionKind kind, EndReason reason) {
  Transition& transition =
      verdict_.transitions[static_cast<std::size_t>(verdict_.transition_count)];
  ++verdict_.transition_count;
  transition = {};
  transition.kind = kind;
  transition.stamp_ns = verdict_.stamp_ns;
  transition.detection_stamp_ns = detection_ns_;
  transition.faults = verdict_.isolated;
  transition.unknown = verdict_.unknown;
  transition.reason = reason;
  transition.layer = Layer::kAudit;
  transition.factor = found_.factor;
  transition.severity = Severity::kMedium;
  if (named_) {
    transition.strength = found_.size.strength;
    transition.lowest = found_.size.lowest;
    transition.highest = found_.size.highest;
    transition.severity = told_ = SeverityOf(found_);
  }
}

std::optional<Transition> LoopWatch::End(EndReason reason) {
  vote_ = {};
  if (!verdict_.detected) {
    return std::nullopt;
  }
  verdict_.transition_count = 0;
  Transit(TransitionKind::kClosed, reason);
  const Transition closed = verdict_.transitions[0];
  verdict_.transition_count = 0;
  Forget();
  return closed;
}

Sample LoopWatch::Reduced(Sample sample) {
  const unsigned control =
      sample.Has(Signal::kPv)
          ? unsigned{MaskOf(Signal::kPv)} | MaskOf(Signal::kSp)
          : 0U;
  sample.present = static_cast<SignalMask>(
      sample.present & (MaskOf(Signal::kCv) | MaskOf(Signal::kF) |
                        MaskOf(Signal::kX) | control));
  return sample;
}

std::vector<Sample> LoopWatch::Points() const {
  std::vector<Sample> points;
  const std::size_t n = ring_.size();
  for (std::size_t k = 0; k < n; ++k) {
    const Point& point = ring_[(added_ - n + k) % kPoints];
    Sample& sample = points.emplace_back();
    sample.stamp_ns = first_ns_ + std::int64_t{point.at_ms} * 1'000'000;
    sample.source_id = last_.source_id;
    sample.seq = last_.seq;
    sample.epoch = last_.epoch;
    sample.flow_unit = last_.flow_unit;
    sample.present = Reduced(last_).present;
    sample.quality = last_.quality;
    sample.values[Index(Signal::kCv)] = double{point.cv};
    sample.values[Index(Signal::kF)] = double{point.f};
    sample.values[Index(Signal::kX)] = double{point.x};
    if (!control_.empty()) {
      const Control& control = control_[(added_ - n + k) % kPoints];
      sample.values[Index(Signal::kPv)] = control.pv;
      sample.values[Index(Signal::kSp)] = control.sp;
    }
  }
  return points;
}

}  // namespace fdi
