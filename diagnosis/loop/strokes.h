#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

/// Stroke and partial-stroke tests in the record of a valve with position.
namespace fdi::loop {

/// N samples of one valve without gaps.
struct StrokeRecord {
  double period_s{1.0};
  std::vector<double> cv;       ///< Command [%].
  std::vector<double> x;        ///< Position [%], in the sense of cv.
  std::vector<double> ps;       ///< Actuator pressure [kPa]; empty: none.
  std::vector<bool> automatic;  ///< Empty: the mode is not known.
};

/// How the rod answered the moves of one direction; means over them.
struct StrokeWay {
  int moves{0};       ///< Of 5 % of CV and more.
  int unanswered{0};  ///< Of these, X went less than a quarter of the way.
  /// Of the moves that are steps (CV is there within two samples) and were
  /// answered. Times good to a sample period [s]; overshoot [% of the step].
  std::optional<double> delay_s;
  std::optional<double> t63_s;
  std::optional<double> t86_s;
  std::optional<double> overshoot_pct;
  /// Until X had moved by 0.5 %: what CV had moved, of ramps [%], and how much
  /// Ps had changed [kPa].
  std::optional<double> breakaway_pct;
  std::optional<double> breakaway_kpa;

  bool operator==(const StrokeWay&) const = default;
};

/// Ps over X in a test that takes X both ways over half of its travel or more;
/// in service, so that the force of the flow is in it.
struct Signature {
  /// Median of half the distance of the two ways at equal X, over 20 to 80 % of
  /// the way: half the friction band, F = A·friction with the area A.
  double friction_kpa{0.0};
  double spring_kpa_per_pct{0.0};  ///< Slope of the mean of both ways.
  double at_0_kpa{0.0};            ///< The same line at X = 0 and at 100 %.
  double at_100_kpa{0.0};

  bool operator==(const Signature&) const = default;
};

/// One test: CV leaves a level that it held and, in moves of 5 % and more
/// between levels held for 10 s, comes back to it, or does so outside AUTO.
struct Stroke {
  std::size_t begin{0};  ///< The last sample before the first move.
  std::size_t end{0};    ///< Behind the last level.
  double cv_low{0.0};    ///< Range of the levels [%].
  double cv_high{0.0};
  double x_low{0.0};  ///< Range of X [%].
  double x_high{0.0};
  StrokeWay rising;  ///< CV rises.
  StrokeWay falling;
  std::optional<Signature> signature;

  double travel() const { return cv_high - cv_low; }
  /// Else it is a partial stroke.
  bool full() const { return travel() >= 90.0; }
  bool operator==(const Stroke&) const = default;
};

/// The tests of a record, in order of time. In AUTO, and where the mode is not
/// known, only CV in steps that returns to its level counts as a test: the
/// controller does not do that.
///
/// @throws std::invalid_argument if the series differ in length or the period
///   is not positive.
///
/// Source: terms and limits of the usual positioners and of ISA-75.25.01
/// (docs/loops.md).
std::vector<Stroke> FindStrokes(const StrokeRecord& record);

/// CV stands from sample `begin` to before `end`.
struct StrokeLevel {
  std::size_t begin;
  std::size_t end;
  double cv;
};

/// A test, and when it began.
struct TimedStroke {
  std::int64_t start_ns{0};
  Stroke stroke;  ///< `begin` is 0, so that `end` is its length.
};

/// Finds the tests of FindStrokes() while the samples come. Keeps them only
/// from the last level on that a test may begin with: some tens while CV rests
/// or a controller moves it, those of the test while there is one.
class StrokeFinder {
 public:
  struct Reading {
    std::int64_t stamp_ns{0};
    double cv{0.0};
    double x{0.0};
    double ps{std::numeric_limits<double>::quiet_NaN()};  ///< NaN: none.
    bool automatic{true};
  };

  /// @param max_samples of a test; a longer one is cut there.
  StrokeFinder(double period_s, std::size_t max_samples);

  /// Takes the next sample, one period after the last, and appends the tests
  /// that are over: nothing that comes can belong to them.
  void Push(const Reading& reading, std::vector<TimedStroke>& found);
  /// The samples end here.
  void Finish(std::vector<TimedStroke>& found);

  double period_s() const { return record_.period_s; }
  std::size_t kept() const { return stamps_.size(); }

 private:
  void EnterLevel(std::vector<TimedStroke>& found);
  void StayInLevel(std::vector<TimedStroke>& found);
  void Evaluate(std::vector<TimedStroke>& found) const;
  void Drop(std::size_t from, std::size_t to);

  std::size_t max_samples_;
  std::size_t shortest_;  // Level,
  std::size_t longest_;   // and hold or move within a test [samples].
  StrokeRecord record_;
  std::vector<std::int64_t> stamps_;
  std::size_t run_{0};                // Since then CV stands.
  std::optional<StrokeLevel> level_;  // The last one a test may go on from.
  bool in_level_{false};
  int moves_{0};            // Of that test.
  bool automatic_{false};   // In AUTO since that level,
  bool before_run_{false};  // before run_.
};

/// What is worse than in `last`, a test of about the same travel, in words;
/// empty: nothing. Times count as longer from 1.5 times on, friction and
/// breakaway from twice on, ends of a full stroke as shifted from 1 % on.
std::vector<std::string> Worse(const Stroke& last, const Stroke& now,
                               double period_s);

/// Whether the two can be compared: levels within 5 % of one another.
bool AreAlike(const Stroke& a, const Stroke& b);

}  // namespace fdi::loop
