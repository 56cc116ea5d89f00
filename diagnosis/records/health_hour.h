#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "diagnosis/loop/valve_counters.h"
#include "diagnosis/model/sample.h"

namespace fdi {

/// CV in bins of 10 %; what is beyond 0..100 % counts in the outermost.
inline constexpr int kCommandBins = 10;

/// The bin of `cv_percent`; not finite counts as 0.
int CommandBin(double cv_percent);

/// Sums over samples, in whole quanta q of the channel, so that sums of parts
/// are the sum of the whole to the last bit.
struct ResidualSums {
  std::int64_t samples{0};
  std::int64_t residual{0};  ///< Σ r/q
  std::int64_t square{0};    ///< Σ (r/q)²
  std::int64_t output{0};    ///< Σ y/q

  void Add(const ResidualSums& other);
  bool operator==(const ResidualSums&) const = default;
};

/// A residual channel of the model set.
struct HealthChannel {
  Signal output{Signal::kX};
  int exponent{0};  ///< q = 2^exponent [unit of the output].

  double quantum() const;
  bool operator==(const HealthChannel&) const = default;
};

/// The estimates of a fault while it was isolated, alone or with others.
struct StrengthSums {
  int fault{0};  ///< 1..kLastFault
  std::int64_t samples{0};
  std::int64_t strength{0};  ///< Σ s/kShare

  bool operator==(const StrengthSums&) const = default;
};

/// The health of one valve in one hour, with one model set and one epoch of its
/// equipment: whole numbers all, so that adding is exact in any order. Times in
/// ms. Residuals, d_0 and strengths are of LIVE samples; the rest of all.
struct HealthHour {
  static constexpr double kShare = 1e-3;   ///< Quantum of shares [-].
  static constexpr double kTravel = 1e-3;  ///< Quantum of travel [% of stroke].
  static constexpr double kFullStroke = 100.0;  ///< The full travel [%].

  std::string valve_id;
  std::int64_t hour{0};         ///< UTC, since 1970-01-01.
  std::uint64_t model_hash{0};  ///< 0: none assigned.
  std::uint32_t epoch{0};

  std::string host;  ///< Host of the monitor; plant history only.
  std::string monitor;
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  std::int64_t seen_ms{0};
  std::int64_t live_ms{0};
  std::int64_t alarm_ms{0};  ///< Part of live_ms with an open episode.
  std::int64_t open_ms{0};   ///< X, else CV, at most kStopPercent,
  std::int64_t shut_ms{0};   ///< or at least 100 % − kStopPercent.
  std::int64_t live_samples{0};
  std::int64_t normal_factor{0};  ///< Σ d_0/kShare over live_samples.
  std::int64_t travel{0};         ///< [kTravel]
  std::int64_t reversals{0};
  /// The largest Verdict::share without an open episode [kShare].
  std::int64_t share{0};
  loop::ValveCounts counts;
  std::vector<HealthChannel> channels;
  /// By bin of CV, then by channel; an empty bin has no samples.
  std::array<std::vector<ResidualSums>, kCommandBins> bins;
  std::vector<StrengthSums> strengths;  ///< By fault, ascending.

  /// Within this of an end of its travel a valve is at the stop [%].
  static constexpr double kStopPercent = 1.0;

  bool SameKey(const HealthHour& other) const;

  /// Adds a part of the same valve, hour, model set and epoch.
  /// @throws std::invalid_argument if the channels differ.
  void Add(const HealthHour& part);
  void AddStrength(int fault, std::int64_t samples, std::int64_t strength);

  bool operator==(const HealthHour&) const = default;
};

}  // namespace fdi
