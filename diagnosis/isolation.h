#pragma once

#include <vector>

#include "diagnosis/verdict.h"

namespace fdi {

/// Counts over the last samples of an open episode which faults kept a factor
/// of at least T, and holds the isolated set: the faults that did so in at
/// least the isolation fraction of the last t_k samples.
class IsolationWindow {
 public:
  explicit IsolationWindow(const DecisionParameters& parameters);

  void Restart();
  void Push(FaultSet above_threshold);

  /// The set that the window supports; empty until t_k samples are in it.
  FaultSet Supported() const;

 private:
  int length_;
  int needed_;
  int filled_{0};
  int next_{0};
  std::vector<FaultSet> ring_;
  std::vector<int> counts_;  // one per fault bit
};

}  // namespace fdi
