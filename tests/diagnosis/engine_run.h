#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "diagnosis/decision/valve_engine.h"
#include "tests/diagnosis/linear_plant.h"

namespace fdi::tests {

inline constexpr int kSettled = kMaxLag;  ///< Samples before LIVE.

inline void FullF6(Sample& sample) {
  AddF6(sample, 1.0);
}

struct Seen {
  std::vector<Transition> transitions;
  Verdict last;
};

/// Steps samples [begin, end) of the plant with `change` applied to each.
inline Seen StepRange(ValveEngine& engine, int begin, int end,
                      const std::function<void(Sample&)>& change = {}) {
  Seen seen;
  for (int k = begin; k < end; ++k) {
    Sample sample = PlantSample(static_cast<std::uint64_t>(k));
    if (change) {
      change(sample);
    }
    seen.last = engine.Step(sample);
    for (const Transition& transition : seen.last.Transitions()) {
      seen.transitions.push_back(transition);
    }
  }
  return seen;
}

inline std::int64_t StampOf(int k) {
  return PlantSample(static_cast<std::uint64_t>(k)).stamp_ns;
}

}  // namespace fdi::tests
