#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "diagnosis/model/verdict.h"

namespace fdi {

inline constexpr std::size_t kQualityCount =
    static_cast<std::size_t>(Quality::kUnassigned) + 1;

/// Samples by quality; times the sample period, this is the time for which a
/// valve was judged or not, and why.
class QualityCount {
 public:
  void Add(Quality quality, std::uint64_t samples = 1) {
    samples_[static_cast<std::size_t>(quality)] += samples;
  }
  void Add(const QualityCount& other) {
    for (std::size_t i = 0; i < kQualityCount; ++i) {
      samples_[i] += other.samples_[i];
    }
  }
  std::uint64_t operator[](Quality quality) const {
    return samples_[static_cast<std::size_t>(quality)];
  }

 private:
  std::array<std::uint64_t, kQualityCount> samples_{};
};

/// True if `verdict` counts as time: repeated, late and superseded samples do
/// not.
inline bool CountsAsTime(const Verdict& verdict) {
  return !OutOfOrder(verdict.intake);
}

}  // namespace fdi
