#include "monitor/console/words.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <vector>

namespace fdi::console {
namespace {

std::string_view PlainName(Signal signal) {
  switch (signal) {
    case Signal::kCv:
      return "command";
    case Signal::kP1:
      return "inlet pressure";
    case Signal::kP2:
      return "outlet pressure";
    case Signal::kT1:
      return "temperature";
    case Signal::kX:
      return "rod position";
    case Signal::kF:
      return "flow";
    case Signal::kSp:
      return "set point";
    case Signal::kCvi:
      return "positioner output";
    case Signal::kPs:
      return "chamber pressure";
    case Signal::kPz:
      return "supply pressure";
  }
  return "reading";
}

// r relative to the threshold on its side; above 1 it is beyond it.
double Excess(const ModelFacts::Channel& channel, double residual) {
  const double threshold = residual < 0.0 ? channel.low : channel.high;
  return threshold != 0.0 ? residual / threshold : 0.0;
}

std::optional<std::size_t> FarthestBeyond(const ModelFacts& models,
                                          const monitor::TracePoint& point) {
  std::optional<std::size_t> farthest;
  double most = 1.0;
  const std::size_t count =
      std::min(models.channels.size(), point.residuals.size());
  for (std::size_t c = 0; c < count; ++c) {
    const double excess = Excess(models.channels[c], point.residuals[c]);
    if (excess > most) {  // Never of NaN.
      most = excess;
      farthest = c;
    }
  }
  return farthest;
}

std::string Fitting(const ModelFacts& models, const monitor::TracePoint& point,
                    const FaultNamer& name) {
  std::vector<std::size_t> fitting;
  for (std::size_t f = 0;
       f < std::min(models.faults.size(), point.factors.size()); ++f) {
    if (point.factors[f] >= 0.5 * models.isolation_threshold) {
      fitting.push_back(f);
    }
  }
  std::stable_sort(fitting.begin(), fitting.end(),
                   [&](std::size_t a, std::size_t b) {
                     return point.factors[a] > point.factors[b];
                   });
  std::string text;
  for (const std::size_t f : fitting) {
    text.append(text.empty() ? "" : ", ").append(name(models.faults[f]));
  }
  return text.empty() ? "no known fault" : text;
}

}  // namespace

std::string TwoDigits(double value) {
  char text[32];
  if (std::abs(value) >= 10.0) {
    std::snprintf(text, sizeof text, "%.0f", value);
  } else {
    std::snprintf(text, sizeof text, "%.2g", value);
  }
  return text;
}

std::string Explain(const ModelFacts& models, const monitor::TracePoint& point,
                    const FaultNamer& name) {
  const std::optional<std::size_t> channel = FarthestBeyond(models, point);
  if (!channel && point.state == State::kNormal) {
    return "as the normal model expects";
  }
  std::string text = "no reading beyond its threshold now";
  if (channel) {
    const ModelFacts::Channel& c = models.channels[*channel];
    const double residual = point.residuals[*channel];
    text = std::string(PlainName(c.output)) + " " +
           TwoDigits(std::abs(residual)) + " " + c.unit +
           (residual < 0.0 ? " below" : " above") +
           " what the normal model expects";
  }
  return text + "; fits: " + Fitting(models, point, name);
}

}  // namespace fdi::console
