#pragma once

#include <cstddef>
#include <vector>

#include "trainer/evaluation.h"

namespace fdi::trainer {

/// 1000 s, settled at 30 s, f6 growing from 700 s on; nothing is indicated.
inline std::vector<Indication> Quiet() {
  std::vector<Indication> all(1000);
  for (std::size_t k = 0; k < all.size(); ++k) {
    all[k].time_s = static_cast<double>(k);
    all[k].settled = k >= 30;
    if (k >= 700) {
      all[k].truth = {6, 0.001 * static_cast<double>(k - 699)};
    }
  }
  return all;
}

inline void Detect(std::vector<Indication>& all, std::size_t from,
                   std::size_t to) {
  for (std::size_t k = from; k < to; ++k) {
    all[k].detected = true;
  }
}

inline void Isolate(std::vector<Indication>& all, std::size_t from,
                    std::size_t to, const std::vector<int>& set) {
  for (std::size_t k = from; k < to; ++k) {
    all[k].isolated = set;
  }
}

}  // namespace fdi::trainer
