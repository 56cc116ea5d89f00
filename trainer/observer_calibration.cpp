#include "trainer/observer_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <utility>

#include "base/parallel_for.h"
#include "diagnosis/decision/fault_bank.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/student.h"
#include "diagnosis/observers/fit_window.h"
#include "diagnosis/observers/observer_bank.h"
#include "diagnosis/observers/residual_windows.h"
#include "trainer/regression.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

constexpr std::size_t kFewResiduals = 20;

}  // namespace

ChannelObserver CalibrateChannel(TsModel model,
                                 std::span<const double> residuals,
                                 std::span<const double> outputs,
                                 double least) {
  ChannelObserver channel;
  channel.validation = Figures(residuals, outputs);
  channel.model = std::move(model);
  if (residuals.empty()) {  // always at the limit of the transmitter
    channel.residual_sd = least;
    channel.membership = {-4.0 * least, -2.0 * least, 2.0 * least, 4.0 * least};
    return channel;
  }
  channel.membership = FitMembership(residuals);
  channel.membership.a = std::min(channel.membership.a, -4.0 * least);
  channel.membership.b = std::min(channel.membership.b, -2.0 * least);
  channel.membership.c = std::max(channel.membership.c, 2.0 * least);
  channel.membership.d = std::max(channel.membership.d, 4.0 * least);
  channel.residual_sd = std::max(std::sqrt(channel.validation.mse), least);
  channel.correlation_time = CorrelationTime(residuals);
  return channel;
}

ChannelObserver CalibrateOn(TsModel model, const Condition& condition,
                            int settling, double least) {
  std::vector<double> residuals;
  std::vector<double> outputs;
  const auto add = [&](std::span<const Stretch> stretches) {
    for (const Stretch& stretch : stretches) {
      const std::vector<double> r = RunResiduals(model, stretch, settling);
      const std::vector<double> y = RunOutputs(model, stretch, settling);
      residuals.insert(residuals.end(), r.begin(), r.end());
      outputs.insert(outputs.end(), y.begin(), y.end());
    }
  };
  add(condition.validation);
  if (residuals.size() < kFewResiduals) {
    add(condition.training);
  }
  return CalibrateChannel(std::move(model), residuals, outputs, least);
}

void CalibrateNormal(const std::vector<ResidualSeries>& series,
                     Observer& normal) {
  for (std::size_t c = 0; c < series.size(); ++c) {
    const std::vector<double> residuals = Joined(series[c]);
    ChannelObserver& channel = normal.channels[c];
    double square = 0.0;
    for (const double r : residuals) {
      square += r * r;
    }
    channel.membership = FitMembership(residuals);
    channel.residual_sd = std::max(
        std::sqrt(square / static_cast<double>(residuals.size())), kMinSd);
    channel.correlation_time = CorrelationTime(residuals);
  }
}

namespace {

constexpr int kFolds = 4;

struct Fold {
  Condition rest;
  std::vector<Stretch> block;
  std::vector<Stretch> beyond;  // As `block`, see MarkBeyond().
};

// Commands that the rest of the record never had say nothing of models of that
// rest: there they extrapolate, for which Detection has its own allowance.
// Samples whose model reads such a command, up to `lag` before, count in
// `beyond`, all others in `block`, where they are few as in WithoutStops();
// else they are how the valve works.
void MarkBeyond(int lag, Fold& fold) {
  constexpr double kMostBeyond = 0.05;
  if (!fold.rest.training.front().samples.front().Has(Signal::kCv)) {
    return;
  }
  SignalRange range{std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity()};
  for (const Stretch& stretch : fold.rest.training) {
    for (const Sample& sample : stretch.samples) {
      range.minimum = std::min(range.minimum, sample[Signal::kCv]);
      range.maximum = std::max(range.maximum, sample[Signal::kCv]);
    }
  }
  std::vector<std::vector<bool>> outside;
  double count = 0.0;
  for (const Stretch& stretch : fold.block) {
    outside.emplace_back();
    int since = lag + 1;
    for (const Sample& sample : stretch.samples) {
      since = range.Contains(sample[Signal::kCv]) ? since + 1 : 0;
      outside.back().push_back(since <= lag);
    }
    count += static_cast<double>(std::ranges::count(outside.back(), true));
  }
  if (count == 0.0 ||
      count > kMostBeyond * static_cast<double>(CountSamples(fold.block))) {
    return;
  }
  fold.beyond = fold.block;
  for (std::size_t i = 0; i < fold.block.size(); ++i) {
    for (std::size_t k = 0; k < outside[i].size(); ++k) {
      Sample& left_out =
          (outside[i][k] ? fold.block : fold.beyond)[i].samples[k];
      for (const Signal output :
           {Signal::kX, Signal::kF, Signal::kP1, Signal::kP2, Signal::kT1}) {
        left_out.quality[Index(output)] = SignalQuality::kUncertain;
      }
    }
  }
}

// Every kFolds-th stretch and the others; if they are few, block f of kFolds of
// each, and the rest of it.
// A block that is left out cuts the rest of its stretch in two, so that no lag
// reaches across it. FitChannel() needs validation data to choose the kind of
// consequents, which is the block itself; it is not parallel to the training
// stretches, so WholeStretch() does not work on `rest`.
Fold MakeFold(const Condition& normal, int fold, int lag) {
  Fold result;
  const bool whole_stretches = normal.training.size() / 2 >= kFolds;
  for (std::size_t i = 0; i < normal.training.size(); ++i) {
    std::vector<Sample> whole = WholeStretch(normal, i).samples;
    const std::string& id = normal.training[i].run_id;
    if (whole_stretches) {
      const bool left_out = static_cast<int>(i % kFolds) == fold;
      (left_out ? result.block : result.rest.training)
          .push_back({id, std::move(whole)});
      continue;
    }
    const auto cut = [&](int f) {
      return whole.begin() +
             static_cast<std::ptrdiff_t>(whole.size() *
                                         static_cast<std::size_t>(f) / kFolds);
    };
    result.block.push_back({id, {cut(fold), cut(fold + 1)}});
    result.rest.training.push_back({id, {whole.begin(), cut(fold)}});
    result.rest.training.push_back({id, {cut(fold + 1), whole.end()}});
  }
  std::erase_if(result.rest.training,
                [](const Stretch& s) { return s.samples.empty(); });
  std::vector<Stretch> whole = result.block;
  MarkBeyond(lag, result);
  result.rest.validation = std::move(whole);
  return result;
}

// The series of channel c and fold f are at c · kFolds + f.
std::vector<ResidualSeries> JoinedFolds(
    const std::vector<ResidualSeries>& parts) {
  std::vector<ResidualSeries> joined(parts.size() / kFolds);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    auto& series = joined[i / kFolds];
    series.insert(series.end(), parts[i].begin(), parts[i].end());
  }
  return joined;
}

}  // namespace

NormalResiduals CrossValidate(const Condition& normal, const Observer& chosen,
                              const std::vector<ChannelPlan>& plans,
                              const FitOptions& options, int threads) {
  const std::size_t channels = plans.size();
  std::vector<ResidualSeries> residuals(channels * kFolds);
  std::vector<ResidualSeries> commands(channels * kFolds);
  // One task for each channel and fold, which writes only its own two entries.
  // Regressors and number of rules stay those of `chosen`, so that the
  // residuals are those of a model of the same structure.
  ParallelFor(static_cast<int>(residuals.size()), threads, [&](int i) {
    const auto c = static_cast<std::size_t>(i / kFolds);
    const TsModel& model_of_all = chosen.channels[c].model;
    const Fold fold = MakeFold(normal, i % kFolds, MaxLag(model_of_all));
    FitOptions fixed = options;
    fixed.rules.counts = {static_cast<int>(model_of_all.rules.size())};
    fixed.rules.min_rules = fixed.rules.counts.front();
    const TsModel model = FitChannel(plans[c], model_of_all.regressors,
                                     fold.rest, fixed, model_of_all.saturation);
    const auto run = [&](const TsModel& by, const std::vector<Stretch>& over) {
      for (const Stretch& stretch : over) {
        residuals[static_cast<std::size_t>(i)].push_back(
            RunResiduals(by, stretch, options.settling));
        commands[static_cast<std::size_t>(i)].push_back(
            RunCommands(by, stretch, options.settling));
      }
    };
    run(model, fold.block);
    run(model_of_all, fold.beyond);
  });
  return {JoinedFolds(residuals), JoinedFolds(commands)};
}

namespace {

constexpr double kMinInterpolationError = 0.02;
constexpr double kMaxInterpolationError = 1.0;
constexpr double kErrorFloor = 0.3;  // residual deviations
constexpr double kDetectableShare = 0.05;
constexpr double kGroupShare = 0.5;
constexpr int kEvidenceSamples = 60;  // before a factor counts

// Observers of one fault and direction by rising |strength|, normal first.
std::vector<int> Chain(const ModelSet& models, int fault, bool negative) {
  std::vector<int> chain{0};
  for (std::size_t i = 1; i < models.observers.size(); ++i) {
    const Observer& observer = models.observers[i];
    if (observer.fault == fault && (observer.strength < 0.0) == negative) {
      chain.push_back(static_cast<int>(i));
    }
  }
  std::sort(chain.begin(), chain.end(), [&](int a, int b) {
    return std::abs(models.observers[static_cast<std::size_t>(a)].strength) <
           std::abs(models.observers[static_cast<std::size_t>(b)].strength);
  });
  return chain;
}

struct InterpolationSums {
  double error{0.0};
  double move{0.0};
  double samples{0.0};
};

// Everything but the observers.
ModelSet Frame(ModelSet& models) {
  std::vector<Observer> observers = std::move(models.observers);
  models.observers.clear();
  ModelSet frame = models;
  models.observers = std::move(observers);
  return frame;
}

// The set with only some of its observers, normal first: predicting the others
// would take the same time again, to no use.
ModelSet WithObservers(const ModelSet& frame,
                       const std::vector<Observer>& observers,
                       const std::vector<int>& chosen) {
  ModelSet some = frame;
  for (const int i : chosen) {
    some.observers.push_back(observers[static_cast<std::size_t>(i)]);
  }
  return some;
}

// Squares of: neighbours' interpolation less the observer between them, and
// how far the interpolation moved from the nearer neighbour.
//
//     e = ŷ_low + w (ŷ_high − ŷ_low) − ŷ_middle,
//     w = (s_middle − s_low)/(s_high − s_low),
//
// s the strengths.
std::vector<InterpolationSums> CompareWithNeighbours(
    const std::vector<Condition>& conditions, const ModelSet& frame,
    const std::vector<Observer>& observers, int low, int middle, int high) {
  const auto strength = [&](int i) {
    return observers[static_cast<std::size_t>(i)].strength;
  };
  const double w =
      (strength(middle) - strength(low)) / (strength(high) - strength(low));
  std::vector<InterpolationSums> sums(frame.channels.size());
  const Condition& condition = conditions[static_cast<std::size_t>(middle)];
  // 0 normal, 1 low, 2 middle, 3 high.
  const ModelSet four = WithObservers(frame, observers, {0, low, middle, high});
  const auto plan = std::make_shared<const ObserverPlan>(four);
  for (const Stretch& stretch : condition.validation) {
    ObserverBank bank(plan);
    bank.Initialise(stretch.samples.front());
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      bank.Step(stretch.samples[k]);
      if (static_cast<int>(k) < frame.decision.settling_samples) {
        continue;
      }
      for (std::size_t c = 0; c < sums.size(); ++c) {
        const int channel = static_cast<int>(c);
        if (!bank.active(channel)) {
          continue;
        }
        const double from = bank.prediction(1, channel);
        const double to = bank.prediction(3, channel);
        const double between = from + w * (to - from);
        const double nearer = w < 0.5 ? from : to;
        const double error = between - bank.prediction(2, channel);
        sums[c].samples += 1.0;
        sums[c].error += error * error;
        sums[c].move += (between - nearer) * (between - nearer);
      }
    }
  }
  return sums;
}

// κ of the observer in the middle, over n samples with errors e and moves m,
//
//     κ² = max(0, Σ e² − n (0.3 σ)²) / Σ m²,
//
// σ the deviation of its residual: an error well inside the noise does no harm.
// The monitor takes κ times the move as the deviation of an interpolated
// prediction (docs/method.md).
void SetInterpolationErrors(const std::vector<InterpolationSums>& sums,
                            Observer& observer) {
  for (std::size_t c = 0; c < sums.size(); ++c) {
    ChannelObserver& channel = observer.channels[c];
    const double floor = kErrorFloor * channel.residual_sd;
    const double excess =
        std::max(0.0, sums[c].error - floor * floor * sums[c].samples);
    channel.interpolation_error =
        std::clamp(sums[c].move > 0.0 ? std::sqrt(excess / sums[c].move) : 0.0,
                   kMinInterpolationError, kMaxInterpolationError);
  }
}

void CopyErrors(const Observer& from, Observer& to) {
  for (std::size_t c = 0; c < to.channels.size(); ++c) {
    to.channels[c].interpolation_error = from.channels[c].interpolation_error;
  }
}

// Share of samples beyond a threshold, and per fault index with d ≥ T.
struct Shares {
  double samples{0.0};
  double abnormal{0.0};
  std::vector<double> accepted;

  void Add(const Shares& other) {
    samples += other.samples;
    abnormal += other.abnormal;
    accepted.resize(other.accepted.size());
    for (std::size_t i = 0; i < accepted.size(); ++i) {
      accepted[i] += other.accepted[i];
    }
  }
};

// True if a residual or a window of the normal observer is beyond its limits.
bool IsAbnormal(const ModelSet& models, const ObserverBank& bank,
                const ResidualWindows& windows) {
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const ChannelSpec& channel = models.channels[c];
    const double r = bank.residual(0, static_cast<int>(c));
    bool beyond = r < channel.lower_threshold || r > channel.upper_threshold;
    for (std::size_t w = 0; w < channel.windows.size(); ++w) {
      beyond = beyond || IsBeyond(channel.windows[w], windows.window(c, w),
                                  windows.command(c, w));
    }
    if (bank.active(static_cast<int>(c)) && beyond) {
      return true;
    }
  }
  return false;
}

void ScoreStretch(const Stretch& stretch,
                  const std::shared_ptr<const ObserverPlan>& observers,
                  const std::shared_ptr<const FaultPlan>& plan,
                  Shares& shares) {
  const ModelSet& models = observers->models();
  ObserverBank bank(observers);
  FaultBank faults(plan);
  Verdict verdict;
  bank.Initialise(stretch.samples.front());
  ResidualWindows windows(models);
  // The fault acts from the first sample on, so evidence is gathered as if it
  // had been detected there.
  faults.Restart();
  const int start = models.decision.settling_samples;
  for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
    bank.Step(stretch.samples[k]);
    if (static_cast<int>(k) < start) {
      continue;
    }
    std::array<double, kMaxChannels> residuals{};
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      residuals[c] = bank.residual(0, static_cast<int>(c));
    }
    windows.Push({residuals.data(), models.channels.size()},
                 stretch.samples[k][Signal::kCv]);
    faults.Score(bank, verdict);
    faults.Update(bank);
    faults.ApplyEvidence(verdict);
    if (static_cast<int>(k) < start + kEvidenceSamples) {
      continue;
    }
    shares.samples += 1.0;
    shares.abnormal += IsAbnormal(models, bank, windows) ? 1.0 : 0.0;
    for (std::size_t i = 0; i < models.faults.size(); ++i) {
      shares.accepted[i] +=
          verdict.fault_factors[i] >= models.decision.isolation_threshold;
    }
  }
}

}  // namespace

void FitInterpolationErrors(const std::vector<Condition>& conditions,
                            int threads, ModelSet& models) {
  const ModelSet frame = Frame(models);
  // A task reads and writes only the observers of its own fault and direction,
  // and reads the normal one, which stays.
  ParallelFor(
      2 * static_cast<int>(models.faults.size()), threads, [&](int task) {
        const int fault = models.faults[static_cast<std::size_t>(task / 2)];
        const std::vector<int> chain = Chain(models, fault, task % 2 == 0);
        for (std::size_t n = 1; n + 1 < chain.size(); ++n) {
          const auto sums =
              CompareWithNeighbours(conditions, frame, models.observers,
                                    chain[n - 1], chain[n], chain[n + 1]);
          SetInterpolationErrors(
              sums, models.observers[static_cast<std::size_t>(chain[n])]);
        }
        if (chain.size() > 2) {
          CopyErrors(
              models
                  .observers[static_cast<std::size_t>(chain[chain.size() - 2])],
              models.observers[static_cast<std::size_t>(chain.back())]);
        }
      });
}

namespace {

constexpr double kMisfitShare = 0.001;  // of the windows of a fault that acts
constexpr double kMinFitMean = 0.5;     // deviations
constexpr double kMinFitSquare = 2.0;   // likewise, squared
constexpr std::size_t kMinFitBlocks = 4;

// z of every channel over blocks of t_k samples, none of them twice.
struct FitBlocks {
  std::vector<double> means;
  std::vector<double> logs;  // of the mean squares
};

// `plan` has the normal observer and the one in question.
std::vector<FitBlocks> BlocksOf(
    const Condition& condition,
    const std::shared_ptr<const ObserverPlan>& plan) {
  const ModelSet& models = plan->models();
  const std::size_t channels = models.channels.size();
  const Observer& observer = models.observers.back();
  std::vector<FitBlocks> blocks(channels);
  std::vector<double> z(channels);
  for (const Stretch& stretch : condition.validation) {
    if (stretch.samples.empty()) {
      continue;
    }
    ObserverBank bank(plan);
    FitWindow window(models.decision.isolation_samples, channels);
    bank.Initialise(stretch.samples.front());
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      bank.Step(stretch.samples[k]);
      if (static_cast<int>(k) < models.decision.settling_samples) {
        continue;
      }
      for (std::size_t c = 0; c < channels; ++c) {
        const int channel = static_cast<int>(c);
        const double sd = observer.channels[c].residual_sd;
        const double s =
            std::min(std::hypot(sd, kExtrapolationError *
                                        bank.extrapolation(1, channel)),
                     std::sqrt(kMaxFitVariance) * sd);
        z[c] = bank.active(channel) ? bank.residual(1, channel) / s
                                    : std::numeric_limits<double>::quiet_NaN();
      }
      window.Push(z);
      if (!window.full()) {
        continue;
      }
      for (std::size_t c = 0; c < channels; ++c) {
        if (!std::isnan(window.mean(c))) {
          blocks[c].means.push_back(window.mean(c));
          blocks[c].logs.push_back(std::log(std::max(window.square(c), 1e-6)));
        }
      }
      window.Restart();
    }
  }
  return blocks;
}

// The value that one more block exceeds with probability `share`.
double BlockReach(const std::vector<double>& values, double share) {
  const auto n = static_cast<double>(values.size());
  return StudentQuantile(1.0 - share, n - 1.0) *
         std::sqrt(Variance(values) * n / (n - 1.0) * (1.0 + 1.0 / n));
}

// Where blocks with and without an effect alternate, as at a stop that the rod
// meets now and then, their scatter says nothing: no more than twice the
// largest that was seen.
double UpperSquare(const std::vector<double>& logs, double share) {
  return std::exp(std::min(Mean(logs) + BlockReach(logs, share),
                           *std::ranges::max_element(logs) + std::log(2.0)));
}

// Limits that none is closer than. The validation data are of the same hours as
// the models: what another day may add is in the limits on the shortest windows
// of the normal residual, which are about as long.
FitBounds AnotherDay(const ModelSet& models, std::size_t c) {
  FitBounds room{-kMinFitMean, kMinFitMean, kMinFitSquare};
  if (!models.channels[c].windows.empty()) {
    const WindowLimits& window = models.channels[c].windows.front();
    const double sd = models.observers.front().channels[c].residual_sd;
    room.lower_mean = std::min(room.lower_mean, window.lower_mean / sd);
    room.upper_mean = std::max(room.upper_mean, window.upper_mean / sd);
    room.upper_square = std::max(
        room.upper_square, std::exp(2.0 * window.upper_log_rms) / sd / sd);
  }
  return room;
}

}  // namespace

// The inputs that are outside normal operation in all data of a condition but
// what noise brings back.
SignalMask MovedIn(const Condition& condition, const ModelSet& models) {
  constexpr double kAlways = 0.95;
  const std::array<std::pair<Signal, SignalRange>, 3> inputs{
      {{Signal::kP1, models.validity.p1},
       {Signal::kP2, models.validity.p2},
       {Signal::kT1, models.validity.t1}}};
  SignalMask moved = 0;
  for (const auto& [signal, range] : inputs) {
    int outside = 0;
    int all = 0;
    for (const Stretch& stretch : condition.validation) {
      for (const Sample& sample : stretch.samples) {
        const bool has = sample.Has(signal);
        all += has ? 1 : 0;
        outside += has && !range.Contains(sample[signal]) ? 1 : 0;
      }
    }
    if (all > 0 && outside >= kAlways * all) {
      moved |= MaskOf(signal);
    }
  }
  return moved;
}

void SetFitBounds(const std::vector<Condition>& conditions, int threads,
                  ModelSet& models) {
  const double share =
      kMisfitShare / (3.0 * static_cast<double>(models.channels.size()));
  std::vector<std::vector<FitBlocks>> blocks(models.observers.size());
  const ModelSet frame = Frame(models);
  ParallelFor(static_cast<int>(blocks.size()) - 1, threads, [&](int i) {
    const ModelSet two = WithObservers(frame, models.observers, {0, i + 1});
    const auto o = static_cast<std::size_t>(i) + 1;
    blocks[o] =
        BlocksOf(conditions[o], std::make_shared<const ObserverPlan>(two));
  });
  for (std::size_t o = 1; o < models.observers.size(); ++o) {
    models.observers[o].moved = MovedIn(conditions[o], models);
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      const FitBlocks& seen = blocks[o][c];
      if (seen.means.size() < kMinFitBlocks) {
        continue;
      }
      const double mean = Mean(seen.means);
      const double reach = BlockReach(seen.means, share);
      const FitBounds room = AnotherDay(models, c);
      models.observers[o].channels[c].fit = {
          std::min(mean - reach, room.lower_mean),
          std::max(mean + reach, room.upper_mean),
          std::max(UpperSquare(seen.logs, share), room.upper_square)};
    }
  }
}

namespace {

// `plan` has the normal observer and the one in question.
SignalMask ExplainedBy(const Condition& condition,
                       const std::shared_ptr<const ObserverPlan>& plan) {
  const ModelSet& models = plan->models();
  std::vector<AccountedShare> shares(models.channels.size());
  for (const Stretch& stretch : condition.validation) {
    if (stretch.samples.empty()) {
      continue;
    }
    ObserverBank bank(plan);
    bank.Initialise(stretch.samples.front());
    for (std::size_t k = 0; k < stretch.samples.size(); ++k) {
      bank.Step(stretch.samples[k]);
      for (std::size_t c = 0; c < shares.size(); ++c) {
        const int channel = static_cast<int>(c);
        const double sd = models.observers.front().channels[c].residual_sd;
        const double normal = bank.residual(0, channel) / sd;
        const double own = bank.residual(1, channel) / sd;
        if (static_cast<int>(k) >= models.decision.settling_samples &&
            bank.active(channel) && !bank.saturated(channel) &&
            !std::isnan(normal + own)) {
          shares[c].Push(normal, own);
        }
      }
    }
  }
  SignalMask explained = kRodSignals;
  for (std::size_t c = 0; c < shares.size(); ++c) {
    const bool tolerates = shares[c].tells(models.decision.isolation_samples) &&
                           shares[c].share() < AccountedShare::kLeastOwn;
    const unsigned output = MaskOf(models.channels[c].output);
    explained &= static_cast<SignalMask>(tolerates ? ~output : ~0U);
  }
  return explained & RequiredSignals(models);
}

}  // namespace

void SetAccounting(const std::vector<Condition>& conditions, int threads,
                   ModelSet& models) {
  std::vector<SignalMask> explained(models.observers.size());
  const ModelSet frame = Frame(models);
  ParallelFor(static_cast<int>(explained.size()) - 1, threads, [&](int i) {
    const auto o = static_cast<std::size_t>(i) + 1;
    explained[o] = ExplainedBy(
        conditions[o], std::make_shared<const ObserverPlan>(
                           WithObservers(frame, models.observers, {0, i + 1})));
  });
  for (std::size_t o = 1; o < explained.size(); ++o) {
    models.observers[o].moved |= explained[o];
  }
}

void FindGroups(const std::vector<Condition>& conditions, int threads,
                ModelSet& models) {
  models.groups.clear();
  models.undetectable.clear();
  const Shares none{0.0, 0.0, std::vector<double>(models.faults.size())};
  std::vector<Shares> parts(conditions.size(), none);
  const auto observers = std::make_shared<const ObserverPlan>(models);
  const auto plan = std::make_shared<const FaultPlan>(observers);
  ParallelFor(static_cast<int>(conditions.size()), threads, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    if (conditions[at].fault != 0) {
      for (const Stretch& stretch : conditions[at].validation) {
        ScoreStretch(stretch, observers, plan, parts[at]);
      }
    }
  });
  std::map<int, Shares> by_fault;
  for (std::size_t i = 0; i < conditions.size(); ++i) {
    if (conditions[i].fault != 0) {
      by_fault[conditions[i].fault].Add(parts[i]);
    }
  }
  // root[i] is the smallest index in the group of fault i. Groups merge
  // transitively: where i looks like l and l like m, the three are one group.
  std::vector<std::size_t> root(models.faults.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  for (const auto& [fault, shares] : by_fault) {
    if (shares.abnormal < kDetectableShare * shares.samples) {
      models.undetectable.push_back(fault);
      continue;
    }
    const auto i = static_cast<std::size_t>(FaultIndex(models, fault));
    for (std::size_t l = 0; l < root.size(); ++l) {
      if (l != i && shares.accepted[l] > kGroupShare * shares.samples) {
        const std::size_t merged = std::min(root[i], root[l]);
        const std::size_t gone = std::max(root[i], root[l]);
        std::replace(root.begin(), root.end(), gone, merged);
      }
    }
  }
  for (std::size_t first = 0; first < root.size(); ++first) {
    std::vector<int> group;
    for (std::size_t i = 0; i < root.size(); ++i) {
      if (root[i] == first) {
        group.push_back(models.faults[i]);
      }
    }
    if (group.size() > 1) {
      models.groups.push_back(group);
    }
  }
}

}  // namespace fdi::trainer
