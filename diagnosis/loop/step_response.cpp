#include "diagnosis/loop/step_response.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace fdi::loop {
namespace {

constexpr double kMoved = 0.02;  // Share of the realised step.

// When x has come to `level` from `begin`, 0 to 1 of the way [samples].
double Crossing(std::span<const float> x, double begin, double level) {
  double before = 0.0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double now =
        level != begin ? (double{x[k]} - begin) / (level - begin) : 1.0;
    if (now >= 1.0) {
      return k == 0 ? 0.0
                    : static_cast<double>(k) - (now - 1.0) / (now - before);
    }
    before = now;
  }
  return static_cast<double>(x.size());
}

}  // namespace

StepResponse ResponseOf(std::span<const float> x, double begin) {
  const std::span<const float> rest =
      x.last(std::max<std::size_t>(1, x.size() / 4));
  const double end = std::accumulate(rest.begin(), rest.end(), 0.0) /
                     static_cast<double>(rest.size());
  StepResponse response;
  response.realised = end - begin;
  const auto time = [&](double share) {
    return Crossing(x, begin, begin + share * response.realised);
  };
  response.delay = time(kMoved);
  response.t63 = time(1.0 - std::exp(-1.0));
  response.t86 = time(1.0 - std::exp(-2.0));
  for (const float value : x) {
    if (response.realised != 0.0) {
      response.overshoot = std::max(response.overshoot,
                                    (double{value} - end) / response.realised);
    }
  }
  return response;
}

}  // namespace fdi::loop
