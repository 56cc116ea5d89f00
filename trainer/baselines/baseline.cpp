#include "trainer/baselines/baseline.h"

#include <algorithm>

namespace fdi::trainer {

BaselineDetector::BaselineDetector(const Baseline& baseline)
    : baseline_(&baseline),
      signature_(baseline.models.size(), 0),
      standing_(signature_) {
  for (std::size_t i = 0; i < baseline.models.size(); ++i) {
    predictors_.emplace_back(baseline.models[i]);
    tests_.emplace_back(baseline.limits[i]);
  }
}

void BaselineDetector::Reset() {
  for (LinearPredictor& predictor : predictors_) {
    predictor.Reset();
  }
  for (Cusum& test : tests_) {
    test.Reset();
  }
  std::fill(signature_.begin(), signature_.end(), 0);
  stands_ = 0;
  samples_ = 0;
  detected_ = false;
  isolated_.clear();
}

Indication BaselineDetector::Step(const Sample& sample) {
  Indication indication;
  indication.settled = ++samples_ > baseline_->options.settling_samples;
  for (std::size_t i = 0; i < tests_.size(); ++i) {
    const std::optional<double> residual = predictors_[i].Step(sample);
    if (residual && indication.settled) {
      signature_[i] = tests_[i].Step(*residual);
    }
  }
  const bool alarm = std::any_of(signature_.begin(), signature_.end(),
                                 [](int sign) { return sign != 0; });
  quiet_ = alarm ? 0 : quiet_ + 1;
  if (alarm) {
    detected_ = true;
    Isolate();
  } else if (quiet_ >= baseline_->options.clearing_samples) {
    detected_ = false;
    isolated_.clear();
  }
  indication.detected = detected_;
  indication.isolated = isolated_;
  return indication;
}

void BaselineDetector::Isolate() {
  stands_ = signature_ == standing_ ? stands_ + 1 : 1;
  standing_ = signature_;
  if (stands_ < baseline_->options.isolation_samples) {
    return;
  }
  const auto row = baseline_->table.find(signature_);
  isolated_ = row == baseline_->table.end() ? std::vector<int>() : row->second;
}

}  // namespace fdi::trainer
