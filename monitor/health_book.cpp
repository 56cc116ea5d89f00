#include "monitor/health_book.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/time_units.h"
#include "diagnosis/model/quality_count.h"
#include "monitor/checkpoint.h"
#include "monitor/counters.h"

// All sums of an hour are integers, in quanta of what they count: time in ms,
// travel, shares and residuals in units of their own. Integers add up exactly
// in any order, so an hour that was cut in parts by restarts and checkpoints
// has the same figures as one that was not (docs/planner.md, "Health by
// hours").
namespace fdi::monitor {
namespace {

// A threshold band is cut into so many quanta, noise into some tens: rounding
// does not show in a mean. The limits keep the sums of an hour from overflow.
constexpr double kQuantaPerBand = 512.0;
constexpr double kMaxResidual = 1'048'576.0;        // [quanta]
constexpr double kMaxOutput = 1'099'511'627'776.0;  // [quanta]

std::int64_t HourOf(std::int64_t stamp_ns) {
  return stamp_ns / kNsPerHour - (stamp_ns % kNsPerHour < 0 ? 1 : 0);
}

std::int64_t Quanta(double value, double quantum, double limit) {
  return std::llround(std::clamp(value / quantum, -limit, limit));
}

// The quantum of a channel is a power of two: the largest of which
// kQuantaPerBand fit between the thresholds.
HealthChannel ChannelOf(const ChannelSpec& channel) {
  const double band = channel.upper_threshold - channel.lower_threshold;
  const double exponent =
      band > 0.0 ? std::floor(std::log2(band / kQuantaPerBand)) : -10.0;
  return {channel.output, static_cast<int>(std::clamp(exponent, -30.0, 20.0))};
}

void AddResiduals(const Sample& sample, const Verdict& verdict,
                  HealthHour& hour) {
  auto& bin = hour.bins[static_cast<std::size_t>(
      CommandBin(sample.Has(Signal::kCv) ? sample[Signal::kCv] : 0.0))];
  bin.resize(hour.channels.size());
  for (std::size_t c = 0; c < bin.size(); ++c) {
    if (std::isfinite(verdict.residuals[c])) {
      const double quantum = hour.channels[c].quantum();
      const std::int64_t r =
          Quanta(verdict.residuals[c], quantum, kMaxResidual);
      bin[c].Add(
          {1, r, r * r,
           Quanta(sample[hour.channels[c].output], quantum, kMaxOutput)});
    }
  }
}

void AddDecision(const Verdict& verdict, const ModelSet& models,
                 std::int64_t period_ms, HealthHour& hour) {
  hour.live_ms += period_ms;
  ++hour.live_samples;
  hour.normal_factor +=
      std::llround(verdict.normal_factor / HealthHour::kShare);
  if (verdict.detected) {
    hour.alarm_ms += period_ms;
  }
  for (std::size_t i = 0; i < models.faults.size(); ++i) {
    if ((verdict.isolated >> i & 1U) != 0) {
      hour.AddStrength(
          models.faults[i], 1,
          Quanta(verdict.strengths[i], HealthHour::kShare, kMaxResidual));
    }
  }
}

}  // namespace

StrokeCount::Step StrokeCount::Push(double position) {
  if (!std::exchange(started_, true)) {
    direction_ = 0;
    extreme_ = position;
    return {};
  }
  const double moved = position - extreme_;
  const bool onward = moved * direction_ > 0.0;
  const bool turned = !onward && std::abs(moved) >= kDeadBand;
  if (!onward && !turned) {
    return {};
  }
  const bool reversal = turned && direction_ != 0;
  direction_ = moved > 0.0 ? 1 : -1;
  extreme_ = position;
  return {std::abs(moved), reversal};
}

void HealthBook::Add(const Sample& sample, const Verdict& verdict,
                     const ModelSet* models, double period_s) {
  HealthHour key;
  key.hour = HourOf(sample.stamp_ns);
  key.model_hash = models != nullptr ? models->content_hash : 0;
  key.epoch = sample.epoch;
  HealthHour& hour =
      At(key, sample, models, verdict.intake == Intake::kAccepted);
  const std::int64_t period_ms = std::llround(period_s * 1e3);
  hour.seen_ms += period_ms;
  if (!verdict.detected && hour.SameKey(key)) {
    hour.share = std::max(
        hour.share, Quanta(verdict.share, HealthHour::kShare, kMaxResidual));
  }
  AddCounts(sample, period_s, hour);
  loop::CountSingle(verdict.single, hour.counts);
  AddStroke(sample, period_ms, hour);
  // Where no further row may be begun, At() returns another one. Time counts
  // there, too, but residuals and decisions belong to their own model set.
  if (models != nullptr && verdict.quality == Quality::kLive &&
      hour.SameKey(key)) {
    AddDecision(verdict, *models, period_ms, hour);
    AddResiduals(sample, verdict, hour);
  }
}

void HealthBook::DrainInto(const std::string& valve_id,
                           std::vector<HealthHour>& hours) {
  for (HealthHour& hour : hours_) {
    hour.valve_id = valve_id;
    hours.push_back(std::move(hour));
  }
  hours_.clear();
}

HealthHour& HealthBook::At(const HealthHour& key, const Sample& sample,
                           const ModelSet* models, bool may_open) {
  HealthHour* const row = FindRow(
      hours_, [&key](const HealthHour& other) { return other.SameKey(key); },
      may_open);
  if (row != nullptr) {
    return *row;
  }
  HealthHour& begun = hours_.emplace_back(key);
  begun.flow_unit = sample.flow_unit;
  if (models != nullptr) {
    for (const ChannelSpec& channel : models->channels) {
      begun.channels.push_back(ChannelOf(channel));
    }
  }
  return begun;
}

// Nothing is compared over a gap or with what another source said.
void HealthBook::AddCounts(const Sample& sample, double period_s,
                           HealthHour& hour) {
  const std::int64_t moved_ns =
      sample.stamp_ns - std::exchange(stamp_ns_, sample.stamp_ns);
  if (moved_ns <= 0 || sample.source_id != source_id_ ||
      static_cast<double>(moved_ns) > kGapPeriods * period_s * 1e9) {
    counters_.Restart();
  }
  counters_.Push(
      {GoodReading(sample, Signal::kCv), GoodReading(sample, Signal::kX),
       period_s, sample.mode == ValveMode::kAuto},
      hour.counts);
}

// By X, and by CV while X cannot be used. The step from one to the other, or to
// another source of the samples, is no travel.
void HealthBook::AddStroke(const Sample& sample, std::int64_t period_ms,
                           HealthHour& hour) {
  const double x = GoodReading(sample, Signal::kX);
  const bool by_command = !std::isfinite(x);
  const double position = by_command ? GoodReading(sample, Signal::kCv) : x;
  if (!std::isfinite(position)) {
    return;
  }
  const bool other_source =
      std::exchange(source_id_, sample.source_id) != sample.source_id;
  if (std::exchange(by_command_, by_command) != by_command || other_source) {
    stroke_.Restart();
  }
  const StrokeCount::Step step = stroke_.Push(position);
  hour.travel += std::llround(step.travel / HealthHour::kTravel);
  hour.reversals += step.reversal ? 1 : 0;
  if (position <= HealthHour::kStopPercent) {
    hour.open_ms += period_ms;
  } else if (position >= 100.0 - HealthHour::kStopPercent) {
    hour.shut_ms += period_ms;
  }
}

void HealthBooks::OnVerdict(const std::string& valve_id, const Sample& sample,
                            const ValveOutcome& outcome) {
  if (CountsAsTime(outcome.verdict)) {
    books_[valve_id].Add(sample, outcome.verdict, outcome.models,
                         outcome.period_s);
  }
}

// The counter of strokes is of whole ones: what is left counts the next time.
void HealthBooks::Drain(const std::string& valve_id, HealthBook& book,
                        std::vector<HealthHour>& hours) {
  const std::size_t known = hours.size();
  book.DrainInto(valve_id, hours);
  constexpr auto kStroke =
      static_cast<std::int64_t>(HealthHour::kFullStroke / HealthHour::kTravel);
  for (std::size_t i = known; i < hours.size(); ++i) {
    travel_ += hours[i].travel;
    counters_.Add(Counter::kReversals,
                  static_cast<std::uint64_t>(hours[i].reversals));
    counters_.Add(Counter::kSlipJumps,
                  static_cast<std::uint64_t>(hours[i].counts.slips));
  }
  counters_.Add(Counter::kStrokes,
                static_cast<std::uint64_t>(travel_ / kStroke));
  travel_ %= kStroke;
}

void HealthBooks::OnRemoved(const std::string& valve_id, Checkpoint& last) {
  Drain(valve_id, books_[valve_id], last.health);
  books_.erase(valve_id);
}

void HealthBooks::TakeCheckpoint(Checkpoint& checkpoint, bool urgent) {
  for (auto& [valve_id, book] : books_) {
    if (!urgent || IsFilling(book.rows())) {
      Drain(valve_id, book, checkpoint.health);
    }
  }
}

}  // namespace fdi::monitor
