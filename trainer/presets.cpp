#include "base/error.h"
#include "trainer/training.h"

namespace fdi::trainer {
namespace {

// The error of names before t_k (docs/method.md).
constexpr double kEarlyError = 1e-3;

TrainingOptions Paper() {
  using enum Signal;
  TrainingOptions options;
  options.preset = "paper";
  options.channels = {
      {"X",
       kX,
       true,
       {{{kCv, 0},
         {kCv, 1},
         {kCv, 2},
         {kCv, 3},
         {kP1, 0},
         {kP1, 1},
         {kP2, 0},
         {kP2, 1},
         {kT1, 0},
         {kX, 1},
         {kX, 2}}}},
      {"F",
       kF,
       true,
       {{{kCv, 0},
         {kCv, 1},
         {kCv, 2},
         {kP1, 0},
         {kP1, 1},
         {kP2, 0},
         {kP2, 1},
         {kT1, 0},
         {kF, 1}},
        {{kX, 0}, {kX, 1}, {kP1, 0}, {kP2, 0}, {kT1, 0}, {kF, 1}}}}};
  options.fit.rules.min_rules = 1;
  options.fit.rules.max_rules = 5;
  options.fit.rules.fit.clustering.num_starts = 2;
  options.fit.rules.fit.clustering.max_iterations = 60;
  options.fit.structure.relative_improvement = 0.02;
  options.fit.max_rows = 3000;
  // With four or five regressors and m = 2 the partition tends to the trivial
  // one, and with it the model to a linear one.
  options.fit.rules.fit.clustering.fuzziness = 1.5;
  options.decision.early_error = kEarlyError;
  return options;
}

std::vector<Regressor> Lags(Signal signal, int longest) {
  std::vector<Regressor> lags;
  for (int lag = 0; lag <= longest; ++lag) {
    lags.push_back({signal, lag});
  }
  return lags;
}

std::vector<Regressor> Joined(
    const std::vector<std::vector<Regressor>>& parts) {
  std::vector<Regressor> joined;
  for (const auto& part : parts) {
    joined.insert(joined.end(), part.begin(), part.end());
  }
  return joined;
}

// A transmitter against its normal band: a constant.
ChannelPlan Plausibility(std::string name, Signal output) {
  ChannelPlan plan;
  plan.name = std::move(name);
  plan.output = output;
  plan.pools = {{{Signal::kCv, 0}}};
  plan.rule_counts = {1};
  plan.adapted = true;
  plan.windows = {30};
  return plan;
}

TrainingOptions Extended() {
  using enum Signal;
  TrainingOptions options = Paper();
  options.preset = "extended";
  // The rod follows the command through play and flow force: position and
  // movement of the command tell the rules apart.
  ChannelPlan x;
  x.name = "X";
  x.output = kX;
  x.pools = {Joined({Lags(kCv, 6), Lags(kP1, 5), Lags(kP2, 3)})};
  x.antecedents = {{kCv, 0}, {kCv, 5}};
  x.rule_counts = {4, 8, 12, 16, 24};
  x.adapted = true;
  x.windows = {30, 200};
  // The flow at the measured position is static.
  ChannelPlan f;
  f.name = "F";
  f.output = kF;
  f.pools = {{{kX, 1}, {kP1, 0}, {kP2, 0}, {kT1, 0}}};
  f.antecedents = {{kX, 0}};
  f.rule_counts = {2, 4, 6, 8, 12};
  f.adapted = true;
  f.saturates = true;
  f.windows = {30, 200};
  // The flow at the command is coarser, but independent of the position sensor.
  ChannelPlan fc = x;
  fc.name = "F(CV)";
  fc.output = kF;
  fc.saturates = true;
  options.channels = {x,
                      f,
                      fc,
                      Plausibility("T1", kT1),
                      Plausibility("P1", kP1),
                      Plausibility("P2", kP2)};
  // Faults of a benchmark are told apart over several periods of the command;
  // what interpolation between observers leaves in error counts as much.
  options.decision.evidence_window = 400.0;
  options.decision.evidence_core = 4.0;
  options.decision.evidence_support = 10.0;
  options.decision.interpolation_allowance = 0.04;
  options.decision.early_error = kEarlyError;
  options.decision.reisolation_samples = 60;
  options.fit.rules.both_methods = true;
  // As if every regressor had noise of 1 % of its deviation: lags of a smooth
  // command are all but collinear, and their slopes would amplify its rounding.
  options.fit.rules.fit.consequents.ridge = 1e-4;
  options.fit.structure.max_regressors = 12;
  options.fit.search_rules = 8;
  options.fit.search_rows = 2000;
  options.fit.max_rows = 6000;
  return options;
}

}  // namespace

TrainingOptions PresetOptions(std::string_view preset) {
  if (preset == "paper") {
    return Paper();
  }
  if (preset == "extended") {
    return Extended();
  }
  throw ConfigError("unknown preset '" + std::string(preset) +
                    "': expected paper or extended");
}

}  // namespace fdi::trainer
