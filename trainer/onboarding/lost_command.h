#pragma once

#include <vector>

#include "trainer/dataset.h"

namespace fdi::trainer {

/// True if the records are too slow for their command, while the flow follows
/// the position: the command between two samples is missing, so that the rod
/// cannot be judged by it, and the flow can at the position. In
/// order of
///
///     E (c_k - c_{k-1})^2 > E c_k^2           the command is undersampled,
///     E (x_k - c_{k-l})^2 > E x_k^2           and does not predict X at any
///                                             delay l = -1, 0, 1, 2,
///     E (f_k - b x_k)^2   < E f_k^2 / 2, b < 0   but X tells most of F,
///
/// with c, x and f less their means: each prediction is compared with the mean,
/// and has to be worse or better by more than three standard errors, those of
/// the means of 20 parts of the record. A command that is not undersampled, and
/// that X does not follow, is a finding about the valve, and so it is where a
/// sample comes more often than in 5 s, which shows how the rod moves.
bool CommandIsLost(const std::vector<TrainingRun>& runs);

}  // namespace fdi::trainer
