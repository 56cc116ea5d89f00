#pragma once

#include "diagnosis/model/model_set.h"
#include "trainer/dataset.h"

namespace fdi::trainer {

/// Moves limits of the normal residual to where a dead band ends. A signal that
/// is told on change (ModelSet::every) may be anywhere within its dead band for
/// as long as the valve rests, while the hours of a record show mostly how it
/// moves. So no limit on X is closer than the dead band of CV, none on F closer
/// than what those of CV and X make of the flow (FlowAt()).
///
/// A dead band is the 10 % quantile of the changes in the record: values that
/// are reported after a time limit, though they have hardly changed, lie below.
/// An operator may move CV in steps: its dead band is at most kWidestDeadBand.
void CoverDeadBands(const Condition& normal, ModelSet& models);

}  // namespace fdi::trainer
