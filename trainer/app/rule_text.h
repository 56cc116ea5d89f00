#pragma once

#include <string>

#include "diagnosis/model_set.h"
#include "diagnosis/ts_model.h"

namespace fdi::trainer {

/// "m3/h" for a flow in that unit, "%", "kPa", "degC" otherwise.
std::string UnitOf(Signal signal, FlowUnit flow_unit);

/// "CV(k-1)"; "CV(k)" without lag.
std::string RegressorText(const Regressor& regressor);

/// The rules of a model in words, one line each:
///
///     if CV(k-1) is low [62.1..66.0 %] and P1(k) is high [...]
///       then X(k) = 0.91 X(k-1) + 0.08 CV(k-1) + 0.7 %   (31 % of the data)
///
/// The range is where the membership is at least one half, within what the
/// training data had; low, medium and high by its middle in thirds of that. A
/// regressor whose range is nearly all of the data is left out.
std::string RulesText(const TsModel& model, FlowUnit flow_unit);

}  // namespace fdi::trainer
