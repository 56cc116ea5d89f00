#include "simulator/random.h"

#include <cmath>

namespace fdi::simulator {
namespace {

// The finalizer of SplitMix64: decorrelates neighbouring seeds and streams.
std::uint64_t Mix(std::uint64_t z) {
  z += 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}

}  // namespace

NormalSource::NormalSource(std::uint64_t seed, std::uint64_t stream)
    : engine_(Mix(Mix(seed) ^ stream)) {}

// In (-1, 1), 53 bits.
double NormalSource::Uniform() {
  return static_cast<double>(engine_() >> 11U) * 0x1p-52 - 1.0;
}

// The polar method gives two numbers at a time; the second waits for the next
// call.
double NormalSource::operator()() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double u = 0.0;
  double v = 0.0;
  double q = 0.0;
  do {
    u = Uniform();
    v = Uniform();
    q = u * u + v * v;
  } while (q >= 1.0 || q == 0.0);
  const double factor = std::sqrt(-2.0 * std::log(q) / q);
  spare_ = v * factor;
  has_spare_ = true;
  return u * factor;
}

DisturbanceProcess::DisturbanceProcess(const Disturbance& disturbance,
                                       NormalSource source)
    : disturbance_(disturbance), source_(source) {}

// v(k) = a v(k-1) + sd sqrt(1 - a^2) e(k), which keeps the standard deviation
// at sd for any correlation a.
double DisturbanceProcess::Next() {
  const double a = disturbance_.correlation;
  const double e = source_();
  value_ = started_ ? a * value_ + disturbance_.sd * std::sqrt(1.0 - a * a) * e
                    : disturbance_.sd * e;
  started_ = true;
  return value_;
}

}  // namespace fdi::simulator
