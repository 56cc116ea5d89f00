#include "trainer/observer_calibration.h"

#include <algorithm>
#include <cmath>

#include "trainer/regression.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kFewResiduals = 20;

}  // namespace

ChannelObserver CalibrateChannel(TsModel model,
                                 std::span<const double> residuals,
                                 std::span<const double> outputs,
                                 double least) {
  ChannelObserver channel;
  channel.validation = Figures(residuals, outputs);
  channel.model = std::move(model);
  if (residuals.empty()) {  // always at the limit of the transmitter
    channel.residual_sd = least;
    channel.membership = {-4.0 * least, -2.0 * least, 2.0 * least, 4.0 * least};
    return channel;
  }
  channel.membership = FitMembership(residuals);
  channel.membership.a = std::min(channel.membership.a, -4.0 * least);
  channel.membership.b = std::min(channel.membership.b, -2.0 * least);
  channel.membership.c = std::max(channel.membership.c, 2.0 * least);
  channel.membership.d = std::max(channel.membership.d, 4.0 * least);
  channel.residual_sd = std::max(std::sqrt(channel.validation.mse), least);
  channel.correlation_time = CorrelationTime(residuals);
  return channel;
}

ChannelObserver CalibrateOn(TsModel model, const Condition& condition,
                            int settling, double least) {
  std::vector<double> residuals;
  std::vector<double> outputs;
  const auto add = [&](std::span<const Stretch> stretches) {
    for (const Stretch& stretch : stretches) {
      const std::vector<double> r = RunResiduals(model, stretch, settling);
      const std::vector<double> y = RunOutputs(model, stretch, settling);
      residuals.insert(residuals.end(), r.begin(), r.end());
      outputs.insert(outputs.end(), y.begin(), y.end());
    }
  };
  add(condition.validation);
  if (residuals.size() < kFewResiduals) {
    add(condition.training);
  }
  return CalibrateChannel(std::move(model), residuals, outputs, least);
}

void CalibrateNormal(const std::vector<ResidualSeries>& series,
                     Observer& normal) {
  for (std::size_t c = 0; c < series.size(); ++c) {
    const std::vector<double> residuals = Joined(series[c]);
    ChannelObserver& channel = normal.channels[c];
    double square = 0.0;
    for (const double r : residuals) {
      square += r * r;
    }
    channel.membership = FitMembership(residuals);
    channel.residual_sd = std::max(
        std::sqrt(square / static_cast<double>(residuals.size())), kLeastSd);
    channel.correlation_time = CorrelationTime(residuals);
  }
}

}  // namespace fdi::trainer
