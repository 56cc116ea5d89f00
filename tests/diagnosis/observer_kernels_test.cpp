#include "diagnosis/observers/observer_kernels.h"

#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "diagnosis/observers/observer_bank.h"

namespace fdi {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr int kObservers = 23;  // not a multiple of the lanes

enum class Premises { kShared, kOwn };

struct Shape {
  Signal output;
  std::vector<Regressor> regressors;
  Premises premises;
  bool centers;
  bool difference;
};

// One channel of each kind that the plan tells apart.
const std::vector<Shape> kShapes = {
    {Signal::kX,
     {{Signal::kCv, 0}, {Signal::kCv, 3}, {Signal::kP1, 1}},
     Premises::kShared,
     false,
     false},
    {Signal::kF,
     {{Signal::kCv, 1}, {Signal::kF, 1}, {Signal::kF, 2}},
     Premises::kOwn,
     false,
     false},
    {Signal::kF,
     {{Signal::kX, 0}, {Signal::kP1, 0}, {Signal::kP2, 0}},
     Premises::kOwn,
     true,
     false},
    {Signal::kX,
     {{Signal::kCv, 2}, {Signal::kP2, 0}},
     Premises::kShared,
     true,
     true}};

class RandomModels {
 public:
  explicit RandomModels(unsigned seed) : random_(seed) {}

  ModelSet Make() {
    ModelSet models;
    models.name = "random";
    for (const Shape& shape : kShapes) {
      models.channels.push_back({"c", shape.output, -1.0, 1.0});
    }
    for (int o = 0; o < kObservers; ++o) {
      Observer observer{"o", o == 0 ? 0 : 1, o / 100.0, {}};
      for (std::size_t c = 0; c < kShapes.size(); ++c) {
        observer.channels.push_back(Channel(models, kShapes[c], c, o));
      }
      models.observers.push_back(observer);
    }
    models.faults = {1};
    return models;
  }

 private:
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  FuzzySet Set() {
    if (Between(0, 1) < 0.2) {
      return {0.0, 0.0, kInfinite, kInfinite};
    }
    const double center = Between(0, 100);
    return {center, center + Between(0, 10), Between(1, 20),
            Between(0, 1) < 0.3 ? kInfinite : Between(1, 20)};
  }

  TsRule Rule(const Shape& shape) {
    TsRule rule;
    const bool center = shape.centers && Between(0, 1) < 0.7;
    for (std::size_t j = 0; j < shape.regressors.size(); ++j) {
      rule.antecedents.push_back(Set());
      if (center && j < 2) {
        rule.center.push_back(Between(0, 100));
        for (std::size_t k = 0; k <= j; ++k) {
          rule.metric.push_back(Between(-0.1, 0.1));
        }
      }
    }
    return rule;
  }

  ChannelObserver Channel(const ModelSet& models, const Shape& shape,
                          std::size_t c, int o) {
    ChannelObserver channel;
    channel.difference = shape.difference && o > 0;
    TsModel& model = channel.model;
    model.output = shape.output;
    model.regressors = shape.regressors;
    model.regressor_min.assign(shape.regressors.size(), 20.0);
    model.regressor_max.assign(shape.regressors.size(), 80.0);
    model.output_min = -50.0;
    model.output_max = 150.0;
    model.saturation = shape.output == Signal::kF ? 90.0 : kInfinite;
    const int rules = static_cast<int>(Between(1, 9));
    for (int i = 0; i < rules; ++i) {
      model.rules.push_back(Rule(shape));
    }
    if (shape.premises == Premises::kShared && o > 1) {
      model.rules = models.observers[1].channels[c].model.rules;
    }
    for (TsRule& rule : model.rules) {
      rule.intercept = Between(-20, 20);
      rule.slopes.clear();
      for (std::size_t j = 0; j < shape.regressors.size(); ++j) {
        rule.slopes.push_back(Between(-0.8, 0.8));
      }
    }
    channel.membership = {-20.0, -5.0, Between(-5, 5), 30.0};
    channel.residual_sd = Between(0.5, 5);
    return channel;
  }

  std::mt19937_64 random_;
};

// The same equations, one model after the other, on samples kept in full.
class ReferenceBank {
 public:
  explicit ReferenceBank(const ModelSet& models) : models_(models) {
    past_.resize(models.observers.size(),
                 std::vector<std::vector<double>>(models.channels.size()));
  }

  // Sample 0 stands for all before it.
  void Step(const Sample& sample) {
    samples_.push_back(sample);
    for (std::size_t o = 0; o < models_.observers.size(); ++o) {
      for (std::size_t c = 0; c < models_.channels.size(); ++c) {
        StepOne(o, c);
      }
    }
  }

  double Factor(std::size_t o) const {
    double factor = 1.0;
    for (std::size_t c = 0; c < models_.channels.size(); ++c) {
      const ChannelObserver& channel = models_.observers[o].channels[c];
      const double uncertain =
          kExtrapolationError * Extrapolation(o, c) / channel.residual_sd;
      const double r = Residual(o, c);
      if (!std::isnan(r)) {
        factor = std::min(
            factor,
            channel.membership(r / std::sqrt(1.0 + uncertain * uncertain)));
      }
    }
    return factor;
  }

  double Prediction(std::size_t o, std::size_t c) const {
    return past_[o][c].back();
  }
  double Residual(std::size_t o, std::size_t c) const {
    const TsModel& model = models_.observers[o].channels[c].model;
    return fdi::Residual(model, samples_.back()[model.output],
                         Prediction(o, c));
  }
  double Extrapolation(std::size_t o, std::size_t c) const {
    return extrapolation_.at(o * models_.channels.size() + c);
  }

 private:
  double Value(std::size_t o, std::size_t c, const Regressor& r) const {
    const TsModel& model = models_.observers[o].channels[c].model;
    const int k = static_cast<int>(samples_.size()) - 1 - r.lag;
    if (r.signal == model.output) {
      return k < 0 ? samples_[0][r.signal]
                   : past_[o][c][static_cast<std::size_t>(k)];
    }
    return samples_[static_cast<std::size_t>(std::max(k, 0))][r.signal];
  }

  void StepOne(std::size_t o, std::size_t c) {
    const ChannelObserver& channel = models_.observers[o].channels[c];
    std::vector<double> x;
    std::vector<double> inside;
    for (std::size_t j = 0; j < channel.model.regressors.size(); ++j) {
      x.push_back(Value(o, c, channel.model.regressors[j]));
      inside.push_back(std::clamp(x[j], channel.model.regressor_min[j],
                                  channel.model.regressor_max[j]));
    }
    const double own = Evaluate(channel.model, x.data());
    const double base = channel.difference ? past_[0][c].back() : 0.0;
    past_[o][c].push_back(base + own);
    extrapolation_.resize(models_.observers.size() * models_.channels.size());
    extrapolation_[o * models_.channels.size() + c] =
        (channel.difference ? extrapolation_[c] : 0.0) +
        std::abs(own - Evaluate(channel.model, inside.data()));
  }

  const ModelSet& models_;
  std::vector<Sample> samples_;
  std::vector<std::vector<std::vector<double>>> past_;
  std::vector<double> extrapolation_;
};

Sample RandomSample(std::mt19937_64& random) {
  std::uniform_real_distribution<double> value(0.0, 100.0);
  Sample sample;
  for (const Signal signal :
       {Signal::kCv, Signal::kP1, Signal::kP2, Signal::kX, Signal::kF}) {
    sample.Set(signal, value(random));
  }
  return sample;
}

// Doubles that are equal to the last bit.
#define EXPECT_SAME_BITS(a, b)                                                \
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a), std::bit_cast<std::uint64_t>(b)) \
      << "observer " << o << ", channel " << c

void ExpectSame(const ObserverBank& bank, const ReferenceBank& reference) {
  std::vector<double> factors(kObservers);
  bank.Score(factors);
  for (std::size_t o = 0; o < kObservers; ++o) {
    std::size_t c = 0;
    for (; c < kShapes.size(); ++c) {
      const int observer = static_cast<int>(o);
      const int channel = static_cast<int>(c);
      EXPECT_SAME_BITS(bank.prediction(observer, channel),
                       reference.Prediction(o, c));
      const double residual = bank.residual(observer, channel);
      if (!std::isnan(residual) || !std::isnan(reference.Residual(o, c))) {
        EXPECT_SAME_BITS(residual, reference.Residual(o, c));
      }
      EXPECT_SAME_BITS(bank.extrapolation(observer, channel),
                       reference.Extrapolation(o, c));
    }
    EXPECT_SAME_BITS(factors[o], reference.Factor(o));
  }
}

class ObserverKernelsTest : public ::testing::TestWithParam<InstructionSet> {};

TEST_P(ObserverKernelsTest, HaveTheBitsOfOneModelAfterTheOther) {
  if (GetParam() == InstructionSet::kAvx2 &&
      BestInstructionSet() != InstructionSet::kAvx2) {
    GTEST_SKIP() << "this processor has no AVX2";
  }
  for (const unsigned seed : {1U, 2U, 3U}) {
    const ModelSet models = RandomModels(seed).Make();
    Validate(models);
    ObserverBank bank(std::make_shared<const ObserverPlan>(models), GetParam());
    ReferenceBank reference(models);
    std::mt19937_64 random(seed);
    for (int k = 0; k < 50; ++k) {
      const Sample sample = RandomSample(random);
      if (k == 0) {
        bank.Initialise(sample);
      }
      bank.Step(sample);
      reference.Step(sample);
      ExpectSame(bank, reference);
      ASSERT_FALSE(HasFailure()) << "seed " << seed << ", sample " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, ObserverKernelsTest,
                         ::testing::Values(InstructionSet::kPortable,
                                           InstructionSet::kAvx2),
                         [](const auto& test) {
                           return test.param == InstructionSet::kAvx2
                                      ? "Avx2"
                                      : "Portable";
                         });

}  // namespace
}  // namespace fdi
