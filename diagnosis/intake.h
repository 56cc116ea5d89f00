#pragma once

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// The first reason why a signal of `required` is unusable in `sample`, or
/// kAccepted; signals that are not present are no reason.
Intake CheckValues(const ModelSet& models, SignalMask required,
                   const Sample& sample);

}  // namespace fdi
