#pragma once

#include <vector>

#include "trainer/evaluation.h"

namespace fdi::trainer::study {

/// The indices of the DAMADICS benchmark beside RunIndices; times in s from the
/// start of the fault, -1 where an index has no meaning (docs/evaluation.md).
struct PaperIndices {
  double t_it_first{-1.0};  ///< First rising edge of PID in the fault zone.
  double t_exact{-1.0};     ///< First instant at which the set is {fault}.
  double r_td{-1.0};        ///< Share of [t_from, t_hor] with DD.
  double r_fi{-1.0};        ///< Share of [t_on, t_from) with a set isolated.
  double r_ti{-1.0};        ///< Share of [t_from, t_hor] with PID.
  double r_mi{-1.0};        ///< Mean number of wrong faults in [t_on, t_hor].
  double fs_d{-1.0};        ///< |strength| at t_dt.
  double fs_i{-1.0};        ///< |strength| at t_it.
};

/// @param indices what ComputeIndices() gave for the same indications and
///   horizon.
PaperIndices ComputePaperIndices(const std::vector<Indication>& indications,
                                 const RunIndices& indices,
                                 double horizon_s = 0.0);

}  // namespace fdi::trainer::study
