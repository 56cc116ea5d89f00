#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// A sample as received, with the outcome of its intake.
struct ReceivedSample {
  std::string valve_id;
  Sample sample;
  Intake intake{Intake::kAccepted};
  bool initialised{false};    ///< The observers were initialised here.
  bool model_swapped{false};  ///< First sample judged by another model set.
  bool ended{false};          ///< Not a sample: the stream of the valve ended.
};

/// One instant of an episode's evidence: readings and verdict.
struct TracePoint {
  Sample sample;  ///< As received, bit for bit.
  Intake intake{Intake::kAccepted};
  bool initialised{false};
  Quality quality{Quality::kLive};
  State state{State::kNormal};
  FaultSet isolated{0};
  std::vector<double> residuals;  ///< By channel; NaN where it abstains.
  double normal_factor{0.0};      ///< d_0 [-]
  std::vector<double> factors;    ///< d by fault index [-].
};

}  // namespace fdi
