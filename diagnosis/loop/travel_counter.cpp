#include "diagnosis/loop/travel_counter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/error.h"

namespace fdi::loop {

void TravelCounter::Push(double command, double position, bool automatic,
                         double period_s) {
  Require(std::isfinite(command) && std::isfinite(position),
          "command and position are finite");
  Require(period_s > 0.0, "the sample period is positive");
  counts_.time_s += period_s;
  counts_.auto_s += automatic ? period_s : 0.0;
  counts_.low_end_s += position <= options_.end ? period_s : 0.0;
  counts_.high_end_s += position >= 100.0 - options_.end ? period_s : 0.0;
  if (!last_) {
    last_ = Last{command, position, position};
    direction_ = 0;
    return;
  }
  const double step = position - last_->position;
  counts_.travel += std::abs(step);
  if (std::abs(step) >= options_.jump &&
      std::abs(command - last_->command) < options_.quiet) {
    ++counts_.slip_jumps;
    counts_.largest_jump = std::max(counts_.largest_jump, std::abs(step));
  }
  last_->command = command;
  last_->position = position;
  const double left = position - last_->reference;
  if (std::abs(left) <= options_.dead_band) {
    return;
  }
  const int direction = left > 0.0 ? 1 : -1;
  counts_.dead_band_travel += std::abs(left);
  counts_.reversals += direction_ == -direction ? 1 : 0;
  direction_ = direction;
  last_->reference = position;
}

StepFinder::StepFinder(double smallest, double hold_s)
    : smallest_(smallest), hold_s_(hold_s) {
  Require(smallest > 0.0 && hold_s > 0.0, "step and hold are positive");
}

std::optional<StepResponse> StepFinder::Push(double command, double position,
                                             double period_s) {
  Require(std::isfinite(command) && std::isfinite(position),
          "command and position are finite");
  Require(period_s > 0.0, "the sample period is positive");
  std::optional<StepResponse> response;
  const double step = command_ ? command - *command_ : 0.0;
  const double quiet = 0.1 * smallest_;
  if (std::abs(step) >= smallest_ && still_s_ >= hold_s_) {
    in_step_ = true;
    from_command_ = *command_;
    from_position_ = position_;
    period_s_ = period_s;
    count_ = 0;
    still_s_ = 0.0;
    command_ = command;
  } else if (!command_ || std::abs(step) > quiet) {
    in_step_ = false;
    still_s_ = 0.0;
    command_ = command;
  } else {
    still_s_ += period_s;
  }
  position_ = position;
  if (in_step_) {
    if (count_ == kMaxSamples) {
      in_step_ = false;
    } else {
      positions_[count_++] = position;
      if (still_s_ >= hold_s_) {
        response = Response();
        in_step_ = false;
      }
    }
  }
  return response;
}

std::optional<StepResponse> StepFinder::Response() const {
  const int third = std::max(1, count_ / 3);
  const double* end = positions_ + count_;
  const double reached = std::accumulate(end - third, end, 0.0) / third;
  const double realised = reached - from_position_;
  StepResponse response;
  response.size = *command_ - from_command_;
  response.gain = realised / response.size;
  // A stem that hardly moved has no times.
  if (std::abs(realised) < 0.1 * std::abs(response.size)) {
    return response;
  }
  const auto time_to = [&](double share) {
    const double* at = std::find_if(positions_, end, [&](double x) {
      return (x - from_position_) / realised >= share;
    });
    return period_s_ * static_cast<double>(at - positions_);
  };
  response.t63_s = time_to(0.63);
  response.t86_s = time_to(0.865);
  double beyond = 0.0;
  for (const double* x = positions_; x != end; ++x) {
    beyond = std::max(beyond, (*x - reached) / realised);
  }
  response.overshoot = 100.0 * beyond;
  return response;
}

}  // namespace fdi::loop
