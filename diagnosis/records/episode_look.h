#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace fdi {

/// A fault as it explains an episode best, with a second look by physics.
struct LookFault {
  int fault{0};
  double strength{0.0};       ///< Most likely; signed [-].
  double lowest{0.0};         ///< Ends of its 95 % interval [-].
  double highest{0.0};        ///<
  std::int64_t begins_ns{0};  ///< Not before the first row.
  bool growing{false};        ///< From 0 there to `strength` at the last row.

  bool operator==(const LookFault&) const = default;
};

/// The best explanation by a fault that a look does not name.
struct LookRival {
  int fault{0};
  /// Its mean square error over that of the best explanation.
  double times{1.0};

  bool operator==(const LookRival&) const = default;
};

/// The result of the last second look at an episode: the answer that counts,
/// and how the valve would have moved under the fault that explains it best.
struct EpisodeLook {
  std::uint64_t episode_id{0};
  std::int64_t first_ns{0};   ///< Stamp of the first simulated row,
  std::int64_t period_ns{0};  ///< from one to the next.
  /// Mean square of the errors in units of the healthy ones; far above 1 where
  /// nothing fits.
  double misfit{0.0};
  std::vector<LookFault> faults;     ///< Best first; none: no fault fits.
  std::optional<LookRival> rival{};  ///< Nothing: all faults are named.
  std::vector<int> observers{};      ///< Faults named by the observers then.
  std::vector<double> x_pct;         ///< Simulated position, a row each [%].
  std::vector<double> flow;          ///< Simulated flow, in the unit of F.

  bool operator==(const EpisodeLook&) const = default;

  /// The row that is simulated for a sample, if any.
  std::optional<std::size_t> RowAt(std::int64_t stamp_ns) const {
    const std::int64_t row = (stamp_ns - first_ns + period_ns / 2) / period_ns;
    return stamp_ns + period_ns / 2 >= first_ns &&
                   row < static_cast<std::int64_t>(x_pct.size())
               ? std::optional(static_cast<std::size_t>(row))
               : std::nullopt;
  }
};

}  // namespace fdi
