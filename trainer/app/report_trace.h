#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/model_set.h"
#include "storage/cli/envelope.h"
#include "trainer/evaluation.h"

namespace fdi::trainer {

/// Columns that the traces of a run are reduced to, one per pixel.
inline constexpr int kTraceColumns = 720;

/// An outcome that held for a while [s from the start of the run].
struct TimeBand {
  double from_s{0.0};
  double to_s{0.0};
  std::vector<int> faults;  ///< Empty: detected, no fault named.
};

/// What the diagnosis said in the course of a run, small whatever its length.
struct RunTrace {
  double duration_s{0.0};
  std::vector<cli::Envelope> residuals;      ///< Per channel [its unit].
  std::vector<SignalRange> live_residuals;   ///< Extremes outside SETTLING.
  cli::Envelope normal_factor;               ///< d_0
  std::vector<cli::Envelope> fault_factors;  ///< By fault index.
  std::vector<double> peak_factors;  ///< Largest while an episode was open.
  cli::Envelope strength;            ///< Of the truth; signed.
  double fault_start_s{-1.0};  ///< First sample with the fault; −1: none.
  std::vector<TimeBand> detected;
  std::vector<TimeBand> isolated;
};

/// Collects a RunTrace sample by sample.
class RunTraceRecorder {
 public:
  RunTraceRecorder(const ModelSet& models, double duration_s);

  /// In the order of the engine; only accepted samples are drawn.
  void Add(const Verdict& verdict);
  /// @param indications of the same run, with the detections dated back.
  RunTrace Finish(const std::vector<Indication>& indications);

 private:
  void AddBands(const std::vector<Indication>& indications);

  const ModelSet& models_;
  RunTrace trace_;
  std::int64_t first_stamp_ns_{0};
  std::int64_t last_stamp_ns_{0};
  bool started_{false};
};

/// Indices of the faults that mattered: `truth` first, then those of an
/// isolated set, then those whose factor reached T in an episode.
std::vector<std::size_t> FaultsThatMattered(const ModelSet& models,
                                            const RunTrace& trace, int truth);

}  // namespace fdi::trainer
