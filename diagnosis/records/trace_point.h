#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// A sample as it was received, with what became of it.
struct ReceivedSample {
  std::string valve_id;
  Sample sample;
  Intake intake{Intake::kAccepted};
  bool initialised{false};    ///< The observers were initialised here.
  bool model_swapped{false};  ///< Another model set judged from here on.
  bool ended{false};          ///< No sample: the stream of the valve ended.
};

/// One instant of an episode's evidence: what was read and what was decided.
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
