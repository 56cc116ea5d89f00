#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.h"
#include "console/model_facts.h"
#include "monitor/sinks.h"

namespace fdi::console {

inline constexpr std::size_t kTrendInstants = 900;
inline constexpr std::size_t kSparkPoints = 60;

/// A valve as it is now.
struct ValveState {
  std::string id;
  std::shared_ptr<const ModelFacts> models;  ///< Null: none assigned.
  State state{State::kNormal};
  Quality quality{Quality::kSettling};
  monitor::Silence silence{monitor::Silence::kNone};
  CoverageReasons reasons{0};
  SignalMask missing{0};  ///< That the model set needs and the sample lacks.
  Intake intake{Intake::kAccepted};     ///< The newest sample's.
  SignalMask refused{0};                ///< Because of these signals.
  std::vector<std::string> unjudged{};  ///< Channels that abstain now.
  bool contested{false};                ///< See monitor::ValveOutcome.
  std::int64_t unjudged_ns{0};  ///< See monitor::ValveOutcome; 0: judged.
  std::string why{};            ///< WhyUnjudged(), if it is not.
  bool notice{false};           ///< Likewise: shown as if it had no episode.
  bool blind{false};  ///< Every known fault looks normal to the model set.
  FaultSet isolated{0};
  double factor{0.0};    ///< The largest of the isolated set [-].
  double strength{0.0};  ///< Estimated, of that fault; signed [-].
  double d0{0.0};
  std::int64_t stamp_ns{0};
  std::vector<double> spark;  ///< 1 − d_0, each second or slower; last newest.
  std::string monitor;        ///< On the page of a plant: who judges it,
  std::int64_t heard_ns{0};   ///< and, once that is silent, since when.
  std::uint64_t version{0};   ///< Grows with every change.
};

/// A transition of an episode, on the time axis.
struct Mark {
  std::int64_t stamp_ns{0};
  TransitionKind kind{TransitionKind::kDetected};
  std::string text;  ///< Faults, or the reason of an end.
};

/// The last instants of a valve.
struct LiveTrend {
  ValveState now;
  std::vector<TracePoint> points;  ///< Oldest first.
  std::vector<Mark> marks;
  std::vector<DataGap> gaps;  ///< This valve's, in its stream.
  std::uint64_t next{0};      ///< For LiveBoard::Since().
};

/// The last-value cache of the console: the state of each valve and its last
/// 900 instants, packed. That is 91 kB a valve for six signals, two channels
/// and five faults, 116 kB for nineteen: 232 MB for 2000 valves. After a change
/// of the source it is up to three times as much until the new source has sent
/// as many instants. A source whose stamps are earlier begins the trend anew.
///
/// Thread safe. The diagnosis takes two locks per sample, which readers hold
/// for microseconds: no reader does more than copy under them.
class LiveBoard : public monitor::ValveListener {
 public:
  LiveBoard();
  ~LiveBoard() override;
  LiveBoard(const LiveBoard&) = delete;
  LiveBoard& operator=(const LiveBoard&) = delete;

  std::string_view name() const override { return "console"; }
  void OnVerdict(const std::string& valve_id, const Sample& sample,
                 const monitor::ValveOutcome& outcome) override;
  void OnSilence(const std::string& valve_id,
                 monitor::Silence silence) override;
  void OnRemoved(const std::string& valve_id, Checkpoint& last) override;

  /// A valve that ought to be there: it is listed as silent until it sends, and
  /// also after it was evicted. @param last_ns when it was heard last; 0: not
  /// known. Any thread.
  void Expect(const std::string& valve_id, std::int64_t last_ns);

  /// As OnVerdict(), of a verdict that came over the bus without the readings.
  void ShowRemote(const std::string& valve_id, const Verdict& verdict,
                  std::shared_ptr<const ModelFacts> models,
                  const std::string& monitor);
  /// A monitor reports that the valve sends and is not judged since
  /// `since_ns`, because of `why`. @param since_ns 0: it is judged.
  void ShowUnjudged(const std::string& valve_id, std::int64_t since_ns,
                    const std::string& why);
  /// Nothing was heard of the valve's monitor since `heard_ns`.
  void ShowMonitorSilence(const std::string& valve_id, std::int64_t heard_ns);

  /// An event of an episode. Any thread.
  void AddMark(const FaultEvent& event);

  /// By id. @param spark false: of the sparklines only the newest point.
  std::vector<ValveState> Valves(bool spark = true) const;
  /// Nothing if the valve was never seen.
  std::optional<LiveTrend> Trend(std::string_view valve_id,
                                 std::size_t instants = kTrendInstants) const;
  /// Points since `next` of Trend() or of the last call, as far as they are
  /// still there; only points and next are filled.
  std::optional<LiveTrend> Since(std::string_view valve_id,
                                 std::uint64_t next) const;

  /// Gaps that were noticed since the last call, at most 256.
  std::vector<DataGap> TakeGaps();

  std::size_t bytes() const;

 private:
  struct Slot;
  Slot& At(const std::string& valve_id);
  std::shared_ptr<Slot> Find(std::string_view valve_id) const;
  std::shared_ptr<const ModelFacts> Facts(const ModelSet& models);
  void ShowLocked(Slot& slot, const Sample& sample, const Verdict& verdict,
                  std::shared_ptr<const ModelFacts> models);
  void RecordGap(Slot& slot, const Sample& sample);

  mutable SharedMutex slots_mutex_;
  std::map<std::string, std::shared_ptr<Slot>, std::less<>> slots_
      GUARDED_BY(slots_mutex_);
  // By content hash. The diagnosis thread alone uses it.
  std::map<std::uint64_t, std::weak_ptr<const ModelFacts>> facts_;

  Mutex gaps_mutex_;
  std::deque<DataGap> gaps_ GUARDED_BY(gaps_mutex_);
};

}  // namespace fdi::console
