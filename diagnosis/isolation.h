#pragma once

#include <vector>

#include "diagnosis/verdict.h"

namespace fdi {

/// Counts over the last t_k samples of an open episode which faults had a
/// factor of at least T. Faults that had it in at least the isolation fraction
/// of them support a set; those that had it in at least the join fraction join
/// it, so that noise on the factor of one fault does not leave its neighbour
/// alone.
class IsolationWindow {
 public:
  /// @param faults number of faults in the model set.
  IsolationWindow(const DecisionParameters& parameters, std::size_t faults);

  void Restart();
  void Push(FaultSet above_threshold);

  /// The set that the window supports; empty until t_k samples are in it.
  FaultSet Supported() const;

 private:
  int length_;
  int needed_;
  int joining_;
  int filled_{0};
  int next_{0};
  std::vector<FaultSet> ring_;
  std::vector<int> counts_;  // by bit of a fault
};

}  // namespace fdi
