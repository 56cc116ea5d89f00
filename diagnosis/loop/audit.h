#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/loop/oscillation.h"
#include "diagnosis/loop/play_fit.h"
#include "diagnosis/loop/standing.h"

/// The audit of a control loop from its ordinary records: no model, no position
/// needed. docs/loops.md says how to read its verdicts.
namespace fdi::loop {

/// Windows with fewer samples are not judged.
inline constexpr std::size_t kMinSamples = 60;

/// One stretch of one loop in automatic, without gaps: N samples each.
struct Window {
  double period_s{1.0};
  std::vector<double> op;  ///< Controller output [% of its span].
  std::vector<double> pv;  ///< Controlled variable [its own unit].
  std::vector<double> sp;  ///< Set point [as pv]; empty: it stood still.
  std::vector<double> x;   ///< Position [% of travel]; empty: not measured.
  /// Sign of the process gain; 0: taken from what the controller does.
  int gain_sign{0};
  /// True if PV is a level or another integral of the flow; empty: not known.
  std::optional<bool> integrating;
  /// PV follows OP late, as a temperature does.
  bool lags{false};
  /// OP that asks for the open valve [%]; NaN: not known.
  double open_op{100.0};
};

enum class Verdict : std::uint8_t {
  kUndetermined,
  kStiction,
  kNoResponse,  ///< OP winds up and PV does not follow.
  kFrozen,      ///< The reading of PV repeats.
  kSaturated,   ///< OP is at an end of its range.
  kQuantised,   ///< PV has too few values.
  kTuning,      ///< The controller makes the oscillation.
  kExternal,    ///< The oscillation comes from outside the loop.
  kHunting,     ///< X oscillates while OP rests.
};
inline constexpr std::size_t kVerdictCount = 9;

/// "undetermined", "stiction", "no_response", ...
std::string_view VerdictName(Verdict verdict);

/// A dead band [% of OP span], with its interval.
struct Band {
  double width{0.0};
  double low{0.0};
  double high{0.0};
};

/// Evidence from a window. Shares are of its samples.
struct Evidence {
  std::size_t samples{0};
  int gain_sign{0};
  /// r² of dOP on de and e: that OP is the output of the controller of PV.
  double controller{0.0};
  double op_range{0.0};   ///< Largest − smallest OP [%].
  double at_limit{0.0};   ///< Share with OP within 0.5 % of 0 or 100 %.
  double off_limit{0.0};  ///< Mean distance of X from OP in those samples [%].
  double sp_moves{0.0};   ///< Share in which SP changes: a cascade above 0.5.
  std::size_t distinct_answer{0};  ///< Values of X, else of PV.
  std::size_t longest_repeat{0};   ///< Equal readings of PV while OP moves.
  double unanswered{0.0};  ///< Longest one-way run of OP without answer [%].
  /// OP stands at its open end and PV comes no nearer to SP.
  bool helpless_open{false};
  /// The same at its closed end, and PV was as far off before OP came there.
  bool helpless_closed{false};
  std::optional<Oscillation> oscillation;  ///< In OP; period in samples.
  std::optional<PlayFit> fit;              ///< PV, or X, over OP.
  Standing standing;            ///< Stops of X, for samples of 2 s or less.
  bool unrelated{false};        ///< X is noise, whatever OP does.
  double hunts{0.0};            ///< Share in which X swings while OP rests.
  double prediction_gain{0.0};  ///< LLR, the second witness.
  double increments{0.0};       ///< r² of PV as the integral of OP.
  double correlation{0.0};      ///< Between OP and PV, times the gain's sign.
  bool integrates{false};       ///< As known, else by the increments.
  /// OP and PV seem exchanged: SP stays at OP and not at PV, and the
  /// controller's law fits better the other way round.
  bool exchanged{false};
  /// The play is fitted with the longest lag tried, and PV is not known to be a
  /// flow, which answers sooner.
  bool late{false};

  /// The band of the play or, if that explains little of X, of the standing;
  /// nothing if neither was found.
  std::optional<Band> band() const;
};

/// The verdict on a window.
struct Finding {
  Verdict verdict{Verdict::kUndetermined};
  bool sure{false};           ///< For stiction: two witnesses, or X, agree.
  std::string_view reason{};  ///< One sentence.
};

struct Audit : Finding {
  Evidence evidence;
};

/// The first of the function letters of a tag, which is its service: L, a
/// level, of "20LIC101_0405". NUL: there are none.
/// @param of_valve the tag may be the valve's own: FV101 can be in a level loop
///   and tells nothing, unlike FIC101.
char ServiceOf(std::string_view name, bool of_valve = false);

/// Sets what the service of a loop (ServiceOf()) says of its PV: a level is an
/// integral, a flow is none and answers at once, a temperature is late.
void SetService(char service, Window& window);

/// True if `op` can be % of its span: within -10 to 110.
bool IsPercent(std::span<const double> op);

/// Judges a window:
///
/// - stiction, if a play of at least 0.25 % explains PV much better than a
///   straight line (gap > 0.15 and G > 0.3, or G > 0.8 and LLR > 10;
///   FitPlay()), no regular sinusoid does, and the same play also predicts PV
///   better (PlayPredictionGain(): LLR > 0 likely, LLR > 3 sure; where G is
///   below a half, LLR > 5.5). Where X is measured,
///   if a play explains half of what a straight line leaves of X over OP, or if
///   X stands five times and 1 % of the time while OP moves (Standing): where
///   OP is restless, friction holds X for seconds and is no play.
/// - hunting, if X swings regularly about OP in a tenth of the time although OP
///   rests: the positioner makes it, which no play between OP and X explains.
/// - the other causes by the rest: see Verdict and docs/loops.md.
///
/// In an integrating loop, play is never concluded from PV, because the
/// integral's quarter period looks like one. Nor is it where PV is known to
/// follow OP late: under a slow load the controller keeps PV - SP in step with
/// dOP/dt, which looks like a play, too. In both cases a run of OP without an
/// answer means something only if it ends at a limit. A play that is fitted
/// with the longest lag (Evidence::late) needs G > 0.8, and is never sure.
///
/// @throws std::invalid_argument if the series differ in length, a value is not
///   finite, or the period is not positive.
Audit AuditWindow(const Window& window);

/// The same verdict at less cost, for a service that audits all the time: the
/// prediction gain is left out where it decides nothing. Where X is measured,
/// the verdict is read off X; if that says nothing, it is what PV tells, but
/// for stiction. Throws as AuditWindow().
Audit AuditValve(Window window);

}  // namespace fdi::loop
