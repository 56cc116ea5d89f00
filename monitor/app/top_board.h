#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "idl/wire.h"

namespace fdi::monitor {

enum class TopSort { kWorst, kValve, kFactor, kSince };
std::string_view TopSortName(TopSort sort);  ///< "worst first", ...
TopSort NextSort(TopSort sort);

/// What is known of a valve.
struct TopRow {
  std::string valve_id;
  State state{State::kNormal};
  Quality quality{Quality::kUnassigned};
  bool silent{false};    ///< No vector has come for a while.
  std::string faults;    ///< "f3|f6"; "unknown" while none is isolated.
  double factor{0.0};    ///< Largest of the isolated set, or of any fault.
  double strength{0.0};  ///< Of the fault with that factor; 0 until isolated.
  double normal_factor{0.0};  ///< d_0
  /// The faults that fit best, largest factor first, without zeros.
  std::vector<std::pair<std::string, double>> factors;
  /// By channel of the model set, NaN where it abstains.
  std::vector<std::pair<std::string, double>> residuals;
  std::optional<std::int64_t> since_ns;  ///< First abnormal sample.
  std::int64_t stamp_ns{0};              ///< Of the newest sample.
  std::string model_set;                 ///< NAME@VERSION, or empty.
};

/// The newest word of the monitors on every valve: what `top` shows.
class TopBoard {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param silence how long a valve may be without a vector.
  explicit TopBoard(std::chrono::milliseconds silence) : silence_(silence) {}

  void Learn(const idl::ModelSetInfoMessage& info);
  void Update(const idl::DecisionMessage& message, Clock::time_point now);
  void Update(const idl::FaultEventMessage& message);
  void Update(const idl::MonitorStatusMessage& message, Clock::time_point now);
  /// The monitor ended this valve.
  void Remove(const std::string& valve_id);

  /// @param filter part of the valve id, of the faults, state or quality, in
  ///   any case; empty: all.
  std::vector<TopRow> Rows(TopSort sort, const std::string& filter,
                           Clock::time_point now) const;

  std::size_t valves() const { return decisions_.size(); }
  /// "OK", "DEGRADED: why"; empty if no monitor has spoken lately.
  std::string Health(Clock::time_point now) const;

 private:
  struct Heard {
    idl::DecisionMessage message;
    Clock::time_point at;
  };
  const idl::ModelSetInfoMessage* InfoOf(std::uint64_t hash) const;
  TopRow RowOf(const Heard& heard, Clock::time_point now) const;

  std::chrono::milliseconds silence_;
  std::map<std::uint64_t, idl::ModelSetInfoMessage> infos_;
  std::map<std::string, Heard> decisions_;
  /// First abnormal sample of the open episode, and its id.
  std::map<std::string, std::pair<std::int64_t, std::uint64_t>> open_;
  std::map<std::string, std::pair<idl::MonitorStatusMessage, Clock::time_point>>
      monitors_;
};

}  // namespace fdi::monitor
