#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/tail.h"

namespace fdi {

/// The hours of one valve without a fault, with its present model set.
struct HealthyHours {
  struct Hour {
    std::int64_t hour{0};  ///< Since the epoch, of any one clock.
    double share{0.0};     ///< The largest Verdict::share.
    int lasted{0};  ///< Whole hours that an episode lasted, which is over.
    /// The share is this or more: 1 of an episode that nobody has judged. It
    /// may have been a fault, so all that counts is that it reached a limit.
    /// One that a label calls false has its own share.
    bool at_least{false};
  };

  std::string valve_id;
  std::uint64_t model_hash{0};  ///< Of the present model set,
  std::uint32_t epoch{0};       ///< and the present equipment.
  std::vector<Hour> hours{};
  int days{0};  ///< UTC days that the hours are of.
  /// Episodes that began beyond no limit (looks, stuck transmitters, ...), and
  /// the whole hours that they lasted. No label calls them a fault, nor the
  /// alarms.
  int others{0};
  int others_lasted{0};
  int alarms{0};        ///< Episodes that were alarms.
  bool damaged{false};  ///< There are no hours, since one cannot be read.
};

/// How rarely a healthy valve shows what an episode shows, from the hours of
/// all valves. An hour's largest share of a limit covers all tests of the
/// observers and the floor, so nothing is multiplied by their number.
///
/// Above the level u that a fifth of a valve's hours exceed, excesses are
/// measured in units of their mean m; in these units all valves have one tail,
///
///     P(share of an hour > z) = 0.2 (1 + ξ y/σ)^(−1/ξ),  y = (z − u)/m, ξ ≥ 0,
///
/// with σ at its upper 95 % bound (FitPareto). The return period is 1/P hours.
/// A share of which only "this or more" is known counts for m as in an
/// exponential tail: m is the sum of all excesses by the number of those that
/// are known, and what is missing of the others is m in the mean.
/// This assumes that hours are alike and that what comes is like what was.
///
/// It grows with each hour that a deviation lasts. Of the hours above u, q is
/// the upper 95 % bound of the part that the next hour followed likewise, again
/// of all valves; of k whole hours the return period is 1/(P q^k). So what q
/// measures is how dependent hours are. This assumes that q is the same after
/// one hour as after ten, and for large shares as for small ones.
///
/// A valve has return periods once it has 72 hours on 3 days, and at least two
/// others with as many have 500 hours together. None is longer than ten times
/// the hours of all. Episodes beyond no limit are counted: the hours by the 95
/// % bound of their number, at most by that of none. Their q is that of the
/// whole hours that they lasted.
class ShareTails {
 public:
  explicit ShareTails(const std::vector<HealthyHours>& valves);

  /// @param lasted whole hours.
  /// @returns [h]; nothing: the valve has none yet.
  std::optional<double> ReturnHours(std::string_view valve_id, double share,
                                    int lasted = 0) const;
  /// True if it has return periods with these models and this equipment.
  bool Covers(std::string_view valve_id, std::uint64_t model_hash,
              std::uint32_t epoch) const;
  /// Hours of all valves that have return periods.
  double pooled_hours() const { return pooled_hours_; }
  /// The longest return period of an episode beyond a limit; 0: there is none.
  double longest_hours() const;
  /// The same of an episode with this share.
  double LongestHours(double share) const;
  std::size_t valves() const { return places_.size(); }
  /// q, by which a return period is divided for each whole hour.
  double goes_on() const { return goes_on_; }

 private:
  struct Place {
    double level;
    double scale;
    std::uint64_t model_hash;
    std::uint32_t epoch;
  };

  std::map<std::string, Place, std::less<>> places_;
  ParetoTail tail_;
  double pooled_hours_{0.0};
  double goes_on_{1.0};  // q
  double other_hours_{0.0};
  double longest_other_hours_{0.0};
  double other_goes_on_{1.0};
};

/// Hours between two false alarms: of "1/day", "2/week", "1/month", "1/year".
/// @throws ConfigError
double ParseAlarmBudget(const std::string& text);

/// A budget for all valves together. An episode is an alarm once its return
/// period is at least the number of valves times the hours between two false
/// alarms of the budget, or the longest one that the hours support.
class AlarmBudget {
 public:
  /// @param between_hours ParseAlarmBudget().
  /// @param valves those that are judged, each of them once.
  AlarmBudget(double between_hours, const std::vector<HealthyHours>& valves);

  /// Weighs an episode by its largest share and its whole hours so far.
  struct Weight {
    std::optional<double> return_hours;
    bool notice{false};  ///< Never where the return period is not known.
  };
  Weight Weigh(std::string_view valve_id, double share, int lasted = 0) const;
  /// The hours that Weigh() goes by are of these models and this equipment. If
  /// not, every episode is an alarm.
  bool Covers(std::string_view valve_id, std::uint64_t model_hash,
              std::uint32_t epoch) const {
    return tails_.Covers(valve_id, model_hash, epoch);
  }

  /// The promise that the hours so far support.
  struct Promise {
    double needed_hours{0.0};   ///< Return period that the budget takes.
    double longest_hours{0.0};  ///< ShareTails::longest_hours()
    /// Hours of operation until it is kept; nothing: fewer than three valves,
    /// of which no number of hours says enough. 0: it is kept.
    std::optional<double> wait_hours{};
    /// Valves that have return periods.
    std::size_t ready{0};
    std::size_t valves{0};
  };
  Promise Now() const { return promise_; }

  /// A valve whose alarms that no label calls a fault are more than its share
  /// of the budget explains with a probability of 5 %.
  struct Spender {
    std::string valve_id;
    int alarms{0};
    double share{0.0};  ///< Alarms of its hours that the budget has for it.
  };
  const std::vector<Spender>& spenders() const { return spenders_; }

 private:
  ShareTails tails_;
  Promise promise_;
  std::vector<Spender> spenders_;
};

/// "not yet: 13 h more" or the like; for lists and the log.
std::string PromiseText(const AlarmBudget::Promise& promise);

}  // namespace fdi
