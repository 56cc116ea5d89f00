#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "diagnosis/records/certainty.h"
#include "programs/monitor/bus_view.h"
#include "report/fault_texts.h"
#include "report/report.h"
#include "report/terminal.h"

namespace fdi::monitor {

enum class TopSort { kWorst, kValve, kFactor, kSince };
inline constexpr std::array<std::string_view, 4> kTopSorts{"worst", "valve",
                                                           "factor", "since"};

/// The latest state of every valve as published by monitors: what `top` shows.
class TopBoard {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param silence after which a valve without vectors is marked silent.
  TopBoard(report::FaultTexts texts, std::chrono::milliseconds silence)
      : texts_(std::move(texts)), silence_(silence) {}

  void Add(const idl::ModelSetInfoMessage& info, Clock::time_point now);
  /// @param from when it was sent, which may be long ago: DDS hands the last
  ///   vector of a valve to who comes late.
  void Add(const idl::DecisionMessage& message, Clock::time_point now,
           const idl::Reception& from = {});
  void Add(const FaultEvent& message, Clock::time_point now);
  void Add(const idl::MonitorStatusMessage& message, Clock::time_point now);
  /// To be told of every message: the quickest of a participant says how far
  /// its clock differs from ours.
  void Hear(const idl::Reception& reception);
  /// The monitor disposed of this valve.
  void Remove(const std::string& valve_id);

  /// {"monitor", "valves": [{"valve_id", "state", "quality", "silent", "fault",
  /// "name", "certainty", "factor", "strength", "normal_factor", "factors",
  /// "residuals", "since_utc", "abnormal_s", "stamp_utc", "model_set"}]}, and
  /// its table, which has words instead of factors.
  /// `state` is console::ShownState(), of a silent valve never NORMAL; `fault`
  /// and
  /// `certainty` are null unless a fault is detected, `fault` also until it has
  /// a name ("unknown" where no known one fits); `factor` is
  /// the largest of the isolated set, or of any fault; `strength` is null until
  /// a fault is isolated; `factors` are the three that fit best; `since_utc`
  /// and `abnormal_s` belong to the open episode.
  /// @param filter substring of valve id, faults, state, quality or model set,
  ///   ignoring case; empty: all.
  report::Report Valves(TopSort sort, const std::string& filter,
                        Clock::time_point now) const;

  std::size_t valves() const { return decisions_.size(); }
  /// "OK", "DEGRADED: why", of several monitors "OK, OK"; empty if no status
  /// has arrived recently.
  std::string Health(Clock::time_point now) const;

 private:
  struct LatestVector {
    idl::DecisionMessage message;
    Clock::time_point at;
    std::uint64_t participant_id;
    std::int64_t delay_ns;  // From its sending to `at`, by two clocks.
  };
  bool IsSilent(const LatestVector& latest, Clock::time_point now) const;
  report::Json RowOf(const LatestVector& latest, Clock::time_point now) const;

  report::FaultTexts texts_;
  std::chrono::milliseconds silence_;
  ModelNames names_;
  std::map<std::string, LatestVector> decisions_;
  std::map<std::uint64_t, std::int64_t> least_delay_ns_;  // By participant.
  struct OpenEpisode {
    std::int64_t detection_stamp_ns;  // First abnormal sample.
    std::uint64_t id;
    Certainty unnamed;  // Of its last event, where that has no name.
  };
  std::map<std::string, OpenEpisode> open_;
  std::map<std::string, std::pair<idl::MonitorStatusMessage, Clock::time_point>>
      monitors_;
};

/// What `top` shows of the board, and how.
struct TopView {
  TopSort sort{TopSort::kWorst};
  std::string filter;  ///< See TopBoard::Valves().
  bool utc{false};
};

/// A title and as many rows as fit into `height` lines, each with a newline.
std::string TopScreen(const TopBoard& board, const TopView& view,
                      const report::TextStyle& style, std::size_t height,
                      std::int64_t now_ns, TopBoard::Clock::time_point now);

}  // namespace fdi::monitor
