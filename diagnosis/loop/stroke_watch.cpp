#include "diagnosis/loop/stroke_watch.h"

#include <cmath>
#include <utility>

namespace fdi {
namespace {

constexpr double kGapPeriods = 1.5;

void Append(double period_s, std::vector<loop::TimedStroke> strokes,
            std::vector<StrokeTest>& found) {
  for (loop::TimedStroke& one : strokes) {
    found.push_back({one.start_ns, period_s, std::move(one.stroke), {}, 0});
  }
}

}  // namespace

std::vector<std::string> StrokeTest::Worse() const {
  return last ? loop::Worse(*last, stroke, period_s)
              : std::vector<std::string>();
}

void StrokeWatch::Push(const Sample& sample, double period_s,
                       std::vector<StrokeTest>& found) {
  const loop::StrokeFinder::Reading reading{
      sample.stamp_ns, GoodReading(sample, Signal::kCv),
      GoodReading(sample, Signal::kX), GoodReading(sample, Signal::kPs),
      sample.mode == ValveMode::kAuto};
  const bool measured = std::isfinite(reading.cv) && std::isfinite(reading.x);
  const auto moved_ns = static_cast<double>(sample.stamp_ns - stamp_ns_);
  if (finder_ &&
      (!measured || moved_ns > kGapPeriods * period_s * 1e9 ||
       sample.source_id != source_id_ || period_s != finder_->period_s())) {
    Finish(found);
  }
  if (!measured) {
    return;
  }
  if (!finder_) {
    finder_.emplace(period_s, max_samples_);
  }
  stamp_ns_ = sample.stamp_ns;
  source_id_ = sample.source_id;
  std::vector<loop::TimedStroke> strokes;
  finder_->Push(reading, strokes);
  Append(period_s, std::move(strokes), found);
}

void StrokeWatch::Finish(std::vector<StrokeTest>& found) {
  if (finder_) {
    std::vector<loop::TimedStroke> strokes;
    finder_->Finish(strokes);
    Append(finder_->period_s(), std::move(strokes), found);
    finder_.reset();
  }
}

}  // namespace fdi
