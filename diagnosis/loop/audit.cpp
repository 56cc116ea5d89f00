#include "diagnosis/loop/audit.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <span>
#include <utility>

#include <Eigen/Dense>

#include "base/correlation.h"
#include "base/error.h"
#include "diagnosis/loop/play.h"

namespace fdi::loop {
namespace {

// Thresholds of the method; set on simulation and public windows, not fitted.
constexpr double kGap = 0.15;
constexpr double kExplained = 0.3;
constexpr double kPredictionGain = 3.0;  // LLR of a sure verdict.
// ln N of two hours in blocks of 30 s: by BIC, what width and start of a play
// have to gain to be more than chance.
constexpr double kChanceGain = 5.5;
constexpr double kConvincingGain = 10.0;  // LLR that makes up for the gap.
constexpr double kUnclearGain = 20.0;     // LLR that calls for a closer look.
constexpr double kRegular = 1.0;
constexpr double kSinusoid = 0.6;      // Shapes below are sines.
constexpr double kOverwhelming = 0.8;  // G that no sinusoid explains.
constexpr double kGoodFit = 0.8;       // r² of a controller's own oscillation.
constexpr double kIntegral = 0.3;      // r² of increments of an integral.
// The longest lag of a flow: the stroke of a slow electric valve.
constexpr double kFlowLagS = 120.0;
constexpr double kAntiphase = -0.5;
constexpr double kPoorFit = 0.1;  // r² of a disturbance's.
// A good valve with positioner has a dead band of 0.25 to 0.5 %.
constexpr double kGoodBand = 0.25;
constexpr double kHalf = 0.5;     // G of a play between OP and X.
constexpr double kMoves = 1.0;    // Change of OP that calls for an answer [%].
constexpr double kWindsUp = 5.0;  // The same, whatever the noise of it [%].
// Share of the mean error by which PV moves at most if it does not answer; so
// an error of less than 1/kUnmoved noises says nothing.
constexpr double kUnmoved = 0.05;
constexpr double kSteady = 0.9;  // r² of PV over time of a slow process.
// A load seldom takes away this share of an error, or moves OP by this much of
// its travel [%]. Chosen on simulated loops, counted on others
// (docs/results/loops.md).
constexpr double kTakenAway = 0.25;
constexpr double kLongWay = 25.0;
constexpr double kNearEnd = 0.5;  // From an end of the range of OP [%].
constexpr double kOftenAtLimit = 0.05;
constexpr double kOtherHalf = 50.0;  // Distance from OP, in % of the travel.
// Samples further apart than the lag of a rod are alike by chance.
constexpr double kFast_s = 2.0;
constexpr std::size_t kOftenStands = 5;  // X stands at least so often,
constexpr double kLongStands = 0.01;     // and for such a share of the time.
constexpr double kUnrelated = 0.05;      // r² of X over OP: it is all noise.
// Six swings are three periods: a step of OP or a bump makes fewer.
constexpr std::size_t kSwings = 6;
constexpr std::size_t kRestSamples = 20;
constexpr double kHunts = 0.1;        // Share of the window.
constexpr double kBeyondNoise = 2.0;  // Deviations; short periods add to them.
constexpr std::size_t kFrozenSamples = 300;
constexpr double kBlock_s = 30.0;  // Block length of the second witness.

std::vector<double> BlockMeans(std::span<const double> values,
                               std::size_t block) {
  std::vector<double> means;
  for (std::size_t k = 0; k + block <= values.size(); k += block) {
    means.push_back(Mean(values.subspan(k, block)));
  }
  return means;
}

std::vector<double> Errors(const Window& window) {
  std::vector<double> errors(window.pv.size());
  const double level = window.sp.empty() ? Mean(window.pv) : 0.0;
  for (std::size_t k = 0; k < errors.size(); ++k) {
    errors[k] = (window.sp.empty() ? level : window.sp[k]) - window.pv[k];
  }
  return errors;
}

// The deviation of the noise: half of the second differences are within 0.67 of
// theirs, which is √6 times that of a reading.
double NoiseOf(std::span<const double> values) {
  std::vector<double> second;
  for (std::size_t k = 2; k < values.size(); ++k) {
    second.push_back(std::abs(values[k] - 2.0 * values[k - 1] + values[k - 2]));
  }
  const auto middle =
      second.begin() + static_cast<std::ptrdiff_t>(second.size() / 2);
  std::ranges::nth_element(second, middle);
  return *middle / 0.6745 / std::sqrt(6.0);
}

struct ControllerFit {
  int sign{1};
  double r2{0.0};
};

// dOP = Kc de + Ki e + c: a controller acts against the error, so that the
// larger of its two parts has the sign of the process gain.
ControllerFit FitController(const Window& window) {
  const std::vector<double> e = Errors(window);
  const auto rows = static_cast<Eigen::Index>(e.size()) - 1;
  Eigen::MatrixX3d inputs(rows, 3);
  Eigen::VectorXd output(rows);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const auto k = static_cast<std::size_t>(r) + 1;
    inputs.row(r) << e[k] - e[k - 1], e[k], 1.0;
    output(r) = window.op[k] - window.op[k - 1];
  }
  const Eigen::Vector3d gains = inputs.colPivHouseholderQr().solve(output);
  const Eigen::RowVector3d mean = inputs.colwise().mean();
  const Eigen::RowVector3d spread = (inputs.rowwise() - mean).colwise().norm();
  const double p = gains(0) * spread(0);
  const double i = gains(1) * spread(1);
  const double total = (output.array() - output.mean()).matrix().squaredNorm();
  ControllerFit fit;
  fit.sign = (std::abs(p) > std::abs(i) ? p : i) < 0.0 ? -1 : 1;
  if (total > 0.0) {
    fit.r2 = 1.0 - (output - inputs * gains).squaredNorm() / total;
  }
  return fit;
}

double Spread(std::span<const double> values) {
  const double mean = Mean(values);
  double squares = 0.0;
  for (const double v : values) {
    squares += (v - mean) * (v - mean);
  }
  return std::sqrt(squares / static_cast<double>(values.size()));
}

// The distance of the means of two series, over the sum of their spreads.
double Distance(std::span<const double> a, std::span<const double> b) {
  const double off = std::abs(Mean(a) - Mean(b));
  return off > 0.0 ? off / (Spread(a) + Spread(b)) : 0.0;
}

// The longest stretch of OP at this end of its range, from first to past last.
std::pair<std::size_t, std::size_t> LongestAt(const std::vector<double>& op,
                                              double limit) {
  std::size_t longest = 0;
  std::size_t end = 0;
  for (std::size_t k = 0, length = 0; k < op.size(); ++k) {
    length = std::abs(op[k] - limit) <= kNearEnd ? length + 1 : 0;
    if (length > longest) {
      longest = length;
      end = k + 1;
    }
  }
  return {end - longest, end};
}

// True if PV, off SP on one side by more than noise, comes no nearer in this
// stretch: neither by as much as a load seldom brings it, nor steadily once its
// dead time is over.
bool StaysOff(const Window& window, std::size_t begin, std::size_t end) {
  const std::size_t third = (end - begin) / 3;
  const auto mean = [&](const std::vector<double>& values, std::size_t from) {
    return Mean(std::span(values).subspan(from, third));
  };
  const double pv = mean(window.pv, begin);
  const double first = mean(window.sp, begin) - pv;
  const double last =
      mean(window.sp, end - third) - mean(window.pv, end - third);
  const double nearer = (mean(window.pv, end - third) - pv) / first;
  CorrelationSums path;
  for (std::size_t k = begin + third; k < end; ++k) {
    path.Add(static_cast<double>(k - begin), window.pv[k] - pv);
  }
  const double r = path.Correlation();
  return first * last > 0.0 && nearer <= kTakenAway &&
         (nearer <= kUnmoved || r * r <= kSteady) &&
         kUnmoved * std::min(std::abs(first), std::abs(last)) >
             NoiseOf(window.pv);
}

// True if OP has come to the end of its range, where it stands from `begin` to
// `end`, by a quarter of its travel, PV was off SP meanwhile, and is as far off
// at last.
bool HasWoundUp(const Window& window, double limit, std::size_t begin,
                std::size_t end) {
  const auto distance = [&](std::size_t k) {
    return std::abs(window.op[k] - limit);
  };
  std::size_t from = begin;
  while (from > 0 &&
         (distance(from) < kLongWay || distance(from - 1) > distance(from))) {
    --from;
  }
  const std::vector<double> errors = Errors(window);
  const std::size_t third = (end - begin) / 3;
  const double last = Mean(std::span(errors).subspan(end - third, third));
  double farthest = 0.0;
  double sum = 0.0;
  for (std::size_t k = from; k < begin + third; ++k) {
    farthest = std::max(farthest, errors[k] / last);
    sum += k < begin ? errors[k] / last : 0.0;
  }
  return distance(from) >= kLongWay &&
         sum >= kTakenAway * static_cast<double>(begin - from) &&
         (1.0 - kTakenAway) * farthest <= 1.0;
}

// True if OP has stood at an end for as long as a window needs, and PV comes no
// nearer to SP. At the closed end that is usual where the valve is not needed,
// unless PV was already off SP when OP was on its way there.
bool IsHelpless(const Window& window, bool open) {
  if (window.sp.empty() || !IsPercent(window.op)) {
    return false;
  }
  const double limit = open ? window.open_op : 100.0 - window.open_op;
  const auto [begin, end] = LongestAt(window.op, limit);
  return end - begin >= kMinSamples && StaysOff(window, begin, end) &&
         (open || HasWoundUp(window, limit, begin, end));
}

bool IsExchanged(const Window& window, double controller) {
  if (window.sp.empty() || Distance(window.pv, window.sp) <= 1.0 ||
      Distance(window.op, window.sp) >= 1.0) {
    return false;
  }
  Window other;
  other.op = window.pv;
  other.pv = window.op;
  other.sp = window.sp;
  return FitController(other).r2 > controller;
}

bool IsAtLimit(double op) {
  return op <= kNearEnd || op >= 100.0 - kNearEnd;
}

// The ends of an OP that is no percentage are not known.
double ShareAtLimit(std::span<const double> op) {
  if (!IsPercent(op)) {
    return 0.0;
  }
  const auto at = std::ranges::count_if(op, IsAtLimit);
  return static_cast<double>(at) / static_cast<double>(op.size());
}

// The mean distance of X from OP where OP is at an end. An X that follows the
// other way round is read in the other sense, and gives 0.
double DistanceAtLimit(const Window& window) {
  if (window.x.empty() || !IsPercent(window.op)) {
    return 0.0;
  }
  double distance = 0.0;
  std::size_t samples = 0;
  CorrelationSums others;
  for (std::size_t k = 0; k < window.op.size(); ++k) {
    if (IsAtLimit(window.op[k])) {
      distance += std::abs(window.x[k] - window.op[k]);
      ++samples;
    } else {
      others.Add(window.op[k], window.x[k]);
    }
  }
  return samples == 0 || others.Correlation() < -kHalf
             ? 0.0
             : distance / static_cast<double>(samples);
}

// The longest run of equal readings in which OP moves by 1 % or more.
std::size_t LongestRepeat(const Window& window) {
  std::size_t longest = 0;
  std::size_t begin = 0;
  for (std::size_t k = 1; k <= window.pv.size(); ++k) {
    if (k < window.pv.size() && window.pv[k] == window.pv[begin]) {
      continue;
    }
    if (k - begin > longest &&
        RangeOf(std::span(window.op).subspan(begin, k - begin)) >= kMoves) {
      longest = k - begin;
    }
    begin = k;
  }
  return longest;
}

// The longest one-way run of the smoothed OP in which SP - PV has one sign in
// 95 % of the samples and PV moves by less than 5 % of its mean, which is more
// than noise [% of OP]: at last and on average, because under a load that steps
// PV ends where it began, and was elsewhere meanwhile.
double UnansweredRun(const Window& window) {
  const std::vector<double> errors = Errors(window);
  const std::size_t n = errors.size();
  const double noise = NoiseOf(window.pv);
  constexpr std::size_t kSide = 3;  // Samples on either side of the mean.
  std::vector<double> op(n);
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t from = k - std::min(k, kSide);
    const std::size_t to = std::min(n, k + kSide + 1);
    op[k] = Mean(std::span(window.op).subspan(from, to - from));
  }
  double longest = 0.0;
  for (std::size_t begin = 0; begin + 1 < n;) {
    const bool up = op[begin + 1] > op[begin];
    std::size_t end = begin + 1;
    while (end + 1 < n && (op[end + 1] > op[end]) == up &&
           op[end + 1] != op[end]) {
      ++end;
    }
    const double run = std::abs(op[end] - op[begin]);
    const std::span e = std::span(errors).subspan(begin, end - begin + 1);
    const auto positive = static_cast<double>(
        std::ranges::count_if(e, [](double v) { return v > 0.0; }));
    const double share = positive / static_cast<double>(e.size());
    const double mean = std::abs(Mean(e));
    if (run > longest && std::max(share, 1.0 - share) >= 0.95 &&
        kUnmoved * mean > noise &&
        std::abs(Mean(std::span(window.pv).subspan(begin, e.size())) -
                 window.pv[begin]) < kUnmoved * mean &&
        std::abs(window.pv[end] - window.pv[begin]) < kUnmoved * mean) {
      longest = run;
    }
    begin = end;
  }
  return longest;
}

// How often a series passes from one side of its mean to the other, by `least`.
std::size_t SwingsOf(std::span<const double> values, double least) {
  const double mean = Mean(values);
  std::size_t swings = 0;
  int side = 0;
  for (const double value : values) {
    const int now = value > mean + least ? 1 : value < mean - least ? -1 : side;
    swings += now != side && side != 0 ? 1U : 0U;
    side = now;
  }
  return swings;
}

// X swings regularly about OP, by more than noise, more than a good positioner
// leaves, and more than OP itself moves. An OP that repeats one value may have
// been held or compressed, while the command moved.
bool Hunts(std::span<const double> op, std::span<const double> x,
           double noise) {
  const double range = RangeOf(op);
  if (range == 0.0) {
    return false;
  }
  std::vector<double> distance(x.begin(), x.end());
  for (std::size_t k = 0; k < op.size(); ++k) {
    distance[k] -= op[k];
  }
  const auto oscillation = FindOscillation(distance);
  if (!oscillation || oscillation->regularity <= kRegular) {
    return false;
  }
  // A wandering position is unlike itself a period ago.
  CorrelationSums again;
  const auto period =
      static_cast<std::size_t>(std::lround(oscillation->period));
  for (std::size_t k = period; k < distance.size(); ++k) {
    again.Add(distance[k - period], distance[k]);
  }
  return again.Correlation() > kHalf &&
         SwingsOf(distance, std::max({kGoodBand, kBeyondNoise * noise,
                                      range})) >= kSwings;
}

// The share of the stretches in which OP rests and X swings.
double HuntingShare(const Window& window) {
  if (window.x.empty() || !IsPercent(window.op)) {
    return 0.0;
  }
  const double noise = NoiseOf(window.x);
  std::size_t hunting = 0;
  std::size_t begin = 0;
  for (std::size_t k = 1; k <= window.op.size(); ++k) {
    if (k < window.op.size() &&
        std::abs(window.op[k] - window.op[begin]) <= kGoodBand) {
      continue;
    }
    const auto part = [&](const std::vector<double>& values) {
      return std::span(values).subspan(begin, k - begin);
    };
    if (k - begin >= kRestSamples &&
        Hunts(part(window.op), part(window.x), noise)) {
      hunting += k - begin;
    }
    begin = k;
  }
  return static_cast<double>(hunting) / static_cast<double>(window.op.size());
}

double MovingShare(std::span<const double> values) {
  if (values.size() < 2) {
    return 0.0;
  }
  std::size_t moves = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    moves += values[k] != values[k - 1] ? 1U : 0U;
  }
  return static_cast<double>(moves) / static_cast<double>(values.size() - 1);
}

bool IsRegular(const Evidence& evidence) {
  return evidence.oscillation && evidence.oscillation->regularity > kRegular;
}

bool IsSinusoid(const Evidence& evidence) {
  return IsRegular(evidence) && evidence.oscillation->shape < kSinusoid;
}

// Where set-point steps move OP far beyond the band, a straight line explains
// most of PV and leaves no room for the gap. There a play has to explain most
// of the rest, and to predict.
bool IsPlay(const Evidence& e) {
  if (!e.fit || e.fit->band < kGoodBand) {
    return false;
  }
  const double explained = e.fit->explained();
  if (IsSinusoid(e) && explained < kOverwhelming) {
    return false;
  }
  return (e.fit->gap() > kGap && explained > kExplained) ||
         (explained > kOverwhelming && e.prediction_gain > kConvincingGain);
}

bool Sticks(const Standing& standing) {
  return standing.times >= kOftenStands && standing.share > kLongStands;
}

}  // namespace

std::optional<Band> Evidence::band() const {
  if (Sticks(standing) && (!fit || fit->explained() <= kHalf)) {
    return Band{standing.middle, standing.low, standing.high};
  }
  return fit ? std::optional(Band{fit->band, fit->band_low, fit->band_high})
             : std::nullopt;
}

void SetService(char service, Window& window) {
  window.lags = service == 'T';
  if (service == 'L' || service == 'F') {
    window.integrating = service == 'L';
  }
}

bool IsPercent(std::span<const double> op) {
  return std::ranges::all_of(op,
                             [](double u) { return u >= -10.0 && u <= 110.0; });
}

std::string_view VerdictName(Verdict verdict) {
  constexpr std::array<std::string_view, kVerdictCount> kNames{
      "undetermined", "stiction", "no_response", "frozen", "saturated",
      "quantised",    "tuning",   "external",    "hunting"};
  return kNames[static_cast<std::size_t>(verdict)];
}

namespace {

Finding AtLimit() {
  return {Verdict::kSaturated, true, "OP is at an end of its range"};
}

// With X: it is read off X, whose only input is OP.
Finding JudgePosition(const Evidence& e) {
  if ((e.distinct_answer == 1 && e.op_range >= kMoves) ||
      (e.unrelated && e.op_range >= kWindsUp)) {
    return {Verdict::kNoResponse, true, "OP moves and the position stands"};
  }
  // Before the play, which holds as long as the rod followed.
  if (e.at_limit > kOftenAtLimit && e.off_limit > kOtherHalf) {
    return {Verdict::kNoResponse, true,
            "OP is at an end of its range and the position in the other half"};
  }
  if (e.fit && e.fit->band >= kGoodBand && e.fit->explained() > kHalf) {
    return {Verdict::kStiction, true, "the position follows OP through a play"};
  }
  if (Sticks(e.standing)) {
    return {Verdict::kStiction, true,
            "the position stands again and again while OP moves"};
  }
  if (e.at_limit > kOftenAtLimit) {
    return AtLimit();
  }
  return {Verdict::kUndetermined, false,
          "the position follows OP without a play"};
}

Finding JudgePlay(const Evidence& e) {
  // A play that leaves most of PV unexplained has to predict it all the more:
  // where only the load moves PV, the integral of the controller lags like
  // one.
  // Under a slow load PV - SP is in step with dOP/dt, a quarter period behind
  // OP however slow that is, so that the fit takes all the lag it may.
  const double explained = e.fit ? e.fit->explained() : 0.0;
  if (!IsPlay(e) || (e.late && explained <= kOverwhelming) ||
      e.prediction_gain <= (explained > kHalf ? 0.0 : kChanceGain)) {
    return {};
  }
  if (e.prediction_gain <= kPredictionGain) {
    return {Verdict::kStiction, false,
            "a play explains PV and hardly predicts it better"};
  }
  if (e.late) {
    return {Verdict::kStiction, false,
            "a play explains PV and predicts it, but PV follows late, as under "
            "a slow load"};
  }
  return {Verdict::kStiction, true, "a play explains PV and predicts it"};
}

// Against the controller: in antiphase, or, where PV is known to follow OP,
// with no relation that a controller could have made.
bool IsFromOutside(const Window& window, const Evidence& e) {
  return e.correlation < kAntiphase ||
         (window.integrating == false && e.fit->linear < kPoorFit);
}

Finding JudgeOscillation(const Window& window, const Evidence& e) {
  if (!IsRegular(e) || !e.fit) {
    return {};
  }
  const double linear =
      window.integrating == true ? e.increments : e.fit->linear;
  if (linear > kGoodFit) {
    return {Verdict::kTuning, false,
            "a regular oscillation in which PV follows OP in a straight line"};
  }
  if (window.integrating != true && IsSinusoid(e) && IsFromOutside(window, e)) {
    return {Verdict::kExternal, false,
            "a regular sinusoid in which OP works against PV"};
  }
  return {};
}

// No cause holds: what keeps the record from telling.
Finding Unclear(const Window& window, const Evidence& e) {
  if (e.integrates) {
    return {Verdict::kUndetermined, false,
            "PV follows the integral of OP, which looks like a play: measure X "
            "or a flow, or step OP in manual"};
  }
  if (IsPlay(e) && (window.lags || e.late)) {
    return {
        Verdict::kUndetermined, false,
        window.integrating == false
            ? "PV follows OP late, which looks like a play: measure X, read "
              "the flow each 20 s or faster, or step OP in manual"
            : "PV follows OP late, which looks like a play: measure X or a "
              "flow, or step OP in manual"};
  }
  if (IsPlay(e)) {
    return {Verdict::kUndetermined, false,
            "a play explains PV but does not predict it"};
  }
  if (e.prediction_gain > kUnclearGain) {
    return {Verdict::kUndetermined, false,
            "tuning or stiction: a play predicts PV but does not explain it"};
  }
  return {Verdict::kUndetermined, false, "nothing stands out"};
}

// The first cause that holds, from those that leave nothing else to see to
// those that need a sound record.
Finding Judge(const Window& window, const Evidence& e) {
  if (e.samples < kMinSamples) {
    return {Verdict::kUndetermined, false, "too few samples"};
  }
  if (e.helpless_open && window.x.empty()) {
    return {Verdict::kNoResponse, true,
            "OP stands at its open end and PV comes no nearer to SP: stuck, "
            "shut, isolated, or too small"};
  }
  // A load that falls until the valve just closes looks alike.
  if (e.helpless_closed && window.x.empty()) {
    return {Verdict::kNoResponse, false,
            "OP stands at its closed end and PV comes no nearer to SP: stuck "
            "open, bypassed, or a load that needs no valve"};
  }
  if (e.hunts > kHunts) {
    return {Verdict::kHunting, false, "X swings to and fro while OP rests"};
  }
  if (e.op_range <= 0.0) {
    return {Verdict::kUndetermined, false, "OP stands still"};
  }
  if (!window.x.empty()) {
    return JudgePosition(e);
  }
  if (e.exchanged) {
    return {Verdict::kUndetermined, false,
            "SP stays at OP and not at PV, as if the two were exchanged"};
  }
  if (e.distinct_answer == 1 && e.op_range < kMoves) {
    return {Verdict::kUndetermined, false, "PV stands and OP hardly moves"};
  }
  const bool known_slow = window.lags || window.integrating == true;
  if (e.distinct_answer == 1 || (e.unanswered >= kWindsUp &&
                                 (!known_slow || e.at_limit > kOftenAtLimit))) {
    return {Verdict::kNoResponse, true,
            "OP moves and PV does not answer: stuck, shut, isolated, or a dead "
            "transmitter"};
  }
  if (e.longest_repeat > kFrozenSamples) {
    return {Verdict::kFrozen, true, "PV repeats one reading while OP moves"};
  }
  if (e.at_limit > kOftenAtLimit) {
    return AtLimit();
  }
  if (e.distinct_answer < 20) {
    return {Verdict::kQuantised, true, "PV has too few values"};
  }
  if (!e.integrates && !window.lags) {
    if (const Finding play = JudgePlay(e);
        play.verdict != Verdict::kUndetermined) {
      return play;
    }
  }
  if (const Finding cause = JudgeOscillation(window, e);
      cause.verdict != Verdict::kUndetermined) {
    return cause;
  }
  return Unclear(window, e);
}

void Check(const Window& window) {
  const std::size_t n = window.op.size();
  Require(window.period_s > 0.0, "the period of a window is positive");
  Require(window.pv.size() == n, "a window has as many PV as OP");
  for (const auto* series : {&window.op, &window.pv, &window.sp, &window.x}) {
    Require(series->empty() || series->size() == n,
            "the series of a window have one length");
    Require(
        std::ranges::all_of(*series, [](double v) { return std::isfinite(v); }),
        "the values of a window are finite");
  }
}

// The part of the evidence in which X, where it is measured, takes PV's place.
void AddAnswer(const Window& window, Evidence& e) {
  const std::size_t n = window.op.size();
  std::vector<double> answer = window.x.empty() ? window.pv : window.x;
  std::size_t block = 1;
  if (e.oscillation && e.oscillation->period > 90.0 && n > 1500) {
    block = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::min(e.oscillation->period / 40.0,
                                             static_cast<double>(n) / 750.0)));
  }
  const std::vector<double> op = BlockMeans(window.op, block);
  const std::vector<double> means = BlockMeans(answer, block);
  const auto explains = [](const std::optional<PlayFit>& fit) {
    return fit ? std::max(fit->linear, fit->play) : 1.0;
  };
  e.fit = FitPlay(op, means, window.x.empty() ? e.gain_sign : 1);
  // Nor does it follow the other way round, as with a wrong sense; and it does
  // not move on its own, as where OP is restless and X a moment late.
  e.unrelated = explains(e.fit) < kUnrelated && !window.x.empty() &&
                explains(FitPlay(op, means, -1)) < kUnrelated &&
                Spread(means) < kHalf * Spread(op);
  e.late =
      e.fit && e.fit->lag == kLongestLag &&
      (window.integrating != false ||
       kLongestLag * static_cast<double>(block) * window.period_s > kFlowLagS);
  e.increments = FitIncrements(op, BlockMeans(window.pv, block), e.gain_sign);
  e.integrates = window.integrating.value_or(
      e.fit && e.increments > kIntegral && e.increments > e.fit->linear);
  std::ranges::sort(answer);
  answer.erase(std::unique(answer.begin(), answer.end()), answer.end());
  e.distinct_answer = answer.size();
}

// The second witness.
double PredictionGain(const Window& window, const PlayFit& fit) {
  const auto block = static_cast<std::size_t>(
      std::max(1.0, std::round(kBlock_s / window.period_s)));
  return PlayPredictionGain(BlockMeans(window.op, block),
                            BlockMeans(window.pv, block), fit);
}

// All but the second witness.
Evidence EvidenceOf(const Window& window) {
  const std::size_t n = window.op.size();
  Evidence e;
  e.samples = n;
  if (n < kMinSamples) {
    return e;
  }
  e.op_range = RangeOf(window.op);
  e.at_limit = ShareAtLimit(window.op);
  e.hunts = HuntingShare(window);
  e.off_limit = DistanceAtLimit(window);
  e.sp_moves = MovingShare(window.sp);
  e.longest_repeat = LongestRepeat(window);
  e.unanswered = window.sp.empty() ? 0.0 : UnansweredRun(window);
  e.helpless_open = IsHelpless(window, true);
  e.helpless_closed = IsHelpless(window, false);
  e.oscillation = FindOscillation(window.op);
  const ControllerFit controller = FitController(window);
  e.controller = controller.r2;
  e.exchanged = IsExchanged(window, controller.r2);
  e.gain_sign = window.gain_sign != 0 ? window.gain_sign : controller.sign;
  CorrelationSums sums;
  for (std::size_t k = 0; k < n; ++k) {
    sums.Add(window.op[k] - window.op[0], window.pv[k] - window.pv[0]);
  }
  e.correlation = e.gain_sign * sums.Correlation();
  if (!window.x.empty() && window.period_s <= kFast_s) {
    e.standing = FindStanding(window.op, window.x);
  }
  AddAnswer(window, e);
  return e;
}

}  // namespace

Audit AuditWindow(const Window& window) {
  Check(window);
  Audit audit;
  audit.evidence = EvidenceOf(window);
  if (audit.evidence.fit) {
    audit.evidence.prediction_gain =
        PredictionGain(window, *audit.evidence.fit);
  }
  static_cast<Finding&>(audit) = Judge(window, audit.evidence);
  return audit;
}

Audit AuditValve(Window window) {
  Check(window);
  Audit by_x;
  by_x.evidence = EvidenceOf(window);
  const auto judge = [&window](Audit& audit) {
    Evidence& e = audit.evidence;
    // The second witness is heard where the first has something to say.
    if (window.x.empty() && e.fit && e.fit->explained() > kExplained) {
      e.prediction_gain = PredictionGain(window, *e.fit);
    }
    static_cast<Finding&>(audit) = Judge(window, e);
  };
  judge(by_x);
  if (window.x.empty() || by_x.verdict != Verdict::kUndetermined ||
      window.pv == window.x || window.op.size() < kMinSamples) {
    return by_x;
  }
  window.x.clear();
  Audit by_flow = by_x;
  by_flow.evidence.standing = {};
  // X tells where the rod is.
  by_flow.evidence.helpless_open = by_flow.evidence.helpless_closed = false;
  by_flow.evidence.hunts = 0.0;
  AddAnswer(window, by_flow.evidence);
  judge(by_flow);
  // A play that X does not show is none of the valve.
  return by_flow.verdict == Verdict::kStiction ||
                 by_flow.verdict == Verdict::kUndetermined ||
                 by_flow.verdict == Verdict::kQuantised
             ? by_x
             : by_flow;
}

char ServiceOf(std::string_view name, bool of_valve) {
  constexpr std::string_view kFunctions = "ICTVRYASDQK";
  for (std::size_t i = 0; i < name.size();) {
    std::size_t end = i;
    while (end < name.size() &&
           std::isupper(static_cast<unsigned char>(name[end])) != 0) {
      ++end;
    }
    const std::string_view letters = name.substr(i, end - i);
    if (letters.size() >= 2 && letters.size() <= 4 &&
        letters.substr(1).find_first_not_of(kFunctions) ==
            std::string_view::npos &&
        !(of_valve && letters.front() == 'F' && letters.back() == 'V')) {
      return letters.front();
    }
    i = std::max(end, i + 1);
  }
  std::string lower(name);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return lower.find("level") != std::string::npos ? 'L' : '\0';
}

}  // namespace fdi::loop
