#include "trainer/dead_bands.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "diagnosis/decision/floor.h"
#include "diagnosis/model/held_readings.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr double kChangeQuantile = 0.1;
constexpr double kFlowQuantile = 0.95;

double DeadBandOf(Signal signal, const std::vector<Stretch>& stretches) {
  std::vector<double> changes;
  for (const Stretch& stretch : stretches) {
    const Sample* last = nullptr;
    for (const Sample& sample : stretch.samples) {
      if ((sample.uncertain() & MaskOf(signal)) == 0) {
        const double change =
            last != nullptr ? std::abs(sample[signal] - (*last)[signal]) : 0.0;
        if (change > 0.0) {
          changes.push_back(change);
        }
        last = &sample;
      }
    }
  }
  std::ranges::sort(changes);
  return changes.empty() ? 0.0 : SortedQuantile(changes, kChangeQuantile);
}

// A change of the position by `band` changes F by at most this, nearly
// everywhere.
double FlowBand(double band, const std::vector<Stretch>& stretches,
                const ModelSet& models) {
  std::vector<double> changes;
  for (const Stretch& stretch : stretches) {
    for (const Sample& sample : stretch.samples) {
      const double x =
          sample[sample.Has(Signal::kX) ? Signal::kX : Signal::kCv];
      const double dp = DpOf(*models.floor, sample);
      changes.push_back(0.5 * (FlowAt(*models.floor, x - band, dp) -
                               FlowAt(*models.floor, x + band, dp)));
    }
  }
  std::ranges::sort(changes);
  return changes.empty() ? 0.0 : SortedQuantile(changes, kFlowQuantile);
}

void Cover(double band, ChannelSpec& channel) {
  channel.lower_threshold = std::min(channel.lower_threshold, -band);
  channel.upper_threshold = std::max(channel.upper_threshold, band);
  for (WindowLimits& window : channel.windows) {
    window.lower_mean = std::min(window.lower_mean, -band);
    window.upper_mean = std::max(window.upper_mean, band);
    window.upper_log_rms = std::max(window.upper_log_rms, std::log(band));
  }
}

}  // namespace

void CoverDeadBands(const Condition& normal, ModelSet& models) {
  const bool x_told = models.every.x == ReadEvery::kOnChange;
  const bool f_told = models.every.f == ReadEvery::kOnChange;
  if (!x_told && !f_told) {
    return;
  }
  const std::vector<Stretch> stretches = WholeStretches(normal);
  if (!stretches.front().samples.front().Has(Signal::kCv)) {
    return;
  }
  const double of_cv =
      std::min(DeadBandOf(Signal::kCv, stretches), kWidestDeadBand);
  const double of_x = x_told ? DeadBandOf(Signal::kX, stretches) : 0.0;
  for (ChannelSpec& channel : models.channels) {
    if (channel.output == Signal::kX && of_cv > 0.0) {
      Cover(of_cv, channel);
    }
    const double of_rod = std::max(of_cv, of_x);
    if (channel.output == Signal::kF && models.floor && of_rod > 0.0) {
      Cover(FlowBand(of_rod, stretches, models), channel);
    }
  }
}

}  // namespace fdi::trainer
