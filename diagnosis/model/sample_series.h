#pragma once

#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi {

/// Direction of a position or command; internally all are in % of closing.
enum class Sense { kClosing, kOpening };

/// Consecutive samples, one sample period apart.
struct SampleSeries {
  std::vector<LabelledSample> samples;
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  double period_s{1.0};
  bool has_truth{false};
  SignalMask signals{0};
};

}  // namespace fdi
