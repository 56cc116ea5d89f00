#include "diagnosis/decision/episode_strengths.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>

#include "base/time_units.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/student.h"

namespace fdi {
namespace {

constexpr std::int64_t kFirstPointAge = 450 * kNsPerSecond;
constexpr std::size_t kMaxMinutes = 7;
constexpr std::size_t kMinMinutes = 3;

}  // namespace

StrengthDue EpisodeStrengths::Step(const Verdict& engine, FaultSet named,
                                   bool observed) {
  for (const Transition& transition : engine.Transitions()) {
    if (transition.kind == TransitionKind::kDetected) {
      detection_ns_ = transition.detection_stamp_ns;
      next_age_ns_ = kFirstPointAge;
      tracks_.clear();
    }
  }
  if (!engine.detected) {
    detection_ns_.reset();
  }
  if (!detection_ns_ || !observed) {
    tracks_.clear();
  }
  if (!detection_ns_ || engine.intake != Intake::kAccepted) {
    return StrengthDue::kNothing;
  }
  stamp_ns_ = engine.stamp_ns;
  const bool minute = observed && UpdateTracks(engine, named);
  const std::int64_t age_ns = stamp_ns_ - *detection_ns_;
  const bool due = age_ns >= next_age_ns_;
  while (age_ns >= next_age_ns_) {
    next_age_ns_ += std::min(next_age_ns_ / 2, kNsPerHour);
  }
  return due      ? StrengthDue::kPoint
         : minute ? StrengthDue::kMinute
                  : StrengthDue::kNothing;
}

// @returns whether a minute of a fault has become complete.
bool EpisodeStrengths::UpdateTracks(const Verdict& engine, FaultSet named) {
  bool complete = false;
  std::erase_if(tracks_,
                [&](const Track& track) { return !Has(named, track.bit); });
  for (FaultSet left = named; left != 0; left &= left - 1) {
    const auto bit = static_cast<std::size_t>(std::countr_zero(left));
    auto track = std::ranges::find(tracks_, bit, &Track::bit);
    if (track == tracks_.end()) {
      track = tracks_.insert(track, Track{bit});
    }
    std::vector<Minute>& minutes = track->minutes;
    if (minutes.empty() ||
        engine.stamp_ns - minutes.back().first_ns >= kNsPerMinute) {
      complete = complete || !minutes.empty();
      minutes.push_back({engine.stamp_ns});
    }
    minutes.back().sum += engine.strengths[bit];
    ++minutes.back().samples;
    if (minutes.size() > kMaxMinutes) {
      minutes.erase(minutes.begin());
    }
  }
  return complete;
}

std::vector<StrengthPoint> EpisodeStrengths::Observed(
    const ModelSet& models) const {
  constexpr double kBothSides = 0.975;
  std::vector<StrengthPoint> points;
  for (const auto& [bit, all] : tracks_) {
    const bool begun = all.size() > kMinMinutes && all.back().samples == 1;
    const std::span minutes(all.begin(), all.size() - (begun ? 1 : 0));
    const auto n = static_cast<double>(minutes.size());
    if (minutes.size() < kMinMinutes || !IsFault(models.faults[bit])) {
      continue;
    }
    double mean = 0.0;
    for (const Minute& m : minutes) {
      mean += m.sum / m.samples / n;
    }
    double square = 0.0;
    for (const Minute& m : minutes) {
      const double away = m.sum / m.samples - mean;
      square += away * away;
    }
    const double half = StudentQuantile(kBothSides, n - 1.0) *
                        std::sqrt(square / (n - 1.0) / n);
    StrengthPoint& p = points.emplace_back();
    p.stamp_ns = std::midpoint(minutes.front().first_ns, stamp_ns_);
    p.fault = models.faults[bit];
    p.strength = mean;
    p.lowest = std::max(-1.0, mean - half);
    p.highest = std::min(1.0, mean + half);
    p.layer = Layer::kObservers;
  }
  return points;
}

}  // namespace fdi
