#include "diagnosis/channel_evidence.h"

#include <algorithm>
#include <numeric>

namespace fdi {

void ChannelEvidence::Clear() {
  std::fill(parts_.begin(), parts_.end(), 0.0);
}

void ChannelEvidence::Fade(const ObserverBank& bank, double memory) {
  for (std::size_t c = 0; c < parts_.size(); ++c) {
    const int channel = static_cast<int>(c);
    const bool speaks = bank.active(channel) && !bank.saturated(channel);
    parts_[c] *= speaks ? memory : 1.0;
  }
}

void ChannelEvidence::RaiseTo(double least) {
  const double lacking = least - total();
  if (lacking > 0.0) {
    *std::min_element(parts_.begin(), parts_.end()) += lacking;
  }
}

double ChannelEvidence::total() const {
  return std::accumulate(parts_.begin(), parts_.end(), 0.0);
}

std::vector<double> ChannelTimes(const ModelSet& models) {
  std::vector<double> times;
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    std::vector<double> all;
    for (const Observer& observer : models.observers) {
      all.push_back(std::max(observer.channels[c].correlation_time, 1.0));
    }
    const auto middle =
        all.begin() + static_cast<std::ptrdiff_t>(all.size() / 2);
    std::nth_element(all.begin(), middle, all.end());
    const auto same =
        std::count_if(models.channels.begin(), models.channels.end(),
                      [&](const ChannelSpec& channel) {
                        return channel.output == models.channels[c].output;
                      });
    times.push_back(*middle * static_cast<double>(same));
  }
  return times;
}

}  // namespace fdi
