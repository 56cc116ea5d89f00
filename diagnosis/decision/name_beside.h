#pragma once

#include <array>
#include <cstddef>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// A name that counts beside the engine's, by a simulation of the valve.
struct NameBeside {
  static constexpr std::size_t kMost = 4;
  struct Fault {
    std::size_t bit{0};
    double strength{0.0};  ///< Signed.
  };

  FaultSet faults{0};                 ///< Empty: there is none.
  std::array<Fault, kMost> likely{};  ///< The same faults, likeliest first.
};

}  // namespace fdi
