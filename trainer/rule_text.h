#pragma once

#include <string>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/ts_model.h"

namespace fdi::trainer {

/// `value` with so many significant digits: "0.25", "1e-05".
std::string Digits(double value, int digits);

/// "m3/h" for a flow in that unit, "%", "kPa", "degC" otherwise.
std::string UnitOf(Signal signal, FlowUnit flow_unit);

/// "CV(k-1)"; "CV(k)" without lag.
std::string RegressorText(const Regressor& regressor);

/// "low [62.1..66.0 %]": the set of a rule on regressor `j`, where its
/// membership is at least one half, within the range of the training data; low,
/// medium and high by its middle in thirds of that. Empty where it is nearly
/// all of the data.
std::string AntecedentWords(const TsModel& model, const TsRule& rule,
                            std::size_t j, FlowUnit flow_unit);

/// The rules of a model in words, one line each:
///
///     if CV(k-1) is low [62.1..66.0 %] and P1(k) is high [...]
///       then X(k) = 0.91 X(k-1) + 0.08 CV(k-1) + 0.7 %   (31 % of the data)
///
/// with AntecedentWords(); a regressor without words is left out.
std::string RulesText(const TsModel& model, FlowUnit flow_unit);

}  // namespace fdi::trainer
