#include "monitor/trace.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/monitor/linear_models.h"
#include "tests/monitor/test_support.h"

namespace fdi::monitor {
namespace {

Verdict SomeVerdict(double residual, double factor) {
  Verdict verdict;
  verdict.residuals[0] = residual;
  verdict.normal_factor = 1.0 - factor;
  verdict.fault_factors = {factor, 0.25};
  return verdict;
}

TEST(TraceTest, UnpacksWhatWasPushedOldestFirst) {
  Trace trace(100, 1000 * kSecond);
  for (std::uint64_t k = 0; k < 70; ++k) {
    const auto value = static_cast<double>(k);
    trace.Push(PlantSample(k, 0.1 * value), SomeVerdict(-value, value / 70.0),
               1, 2);
  }

  const std::vector<TracePoint> points = trace.Unpack();

  ASSERT_EQ(points.size(), 70U);
  for (std::uint64_t k = 0; k < 70; ++k) {
    const auto value = static_cast<double>(k);
    EXPECT_EQ(points[k].sample.seq, k);
    EXPECT_EQ(points[k].sample[Signal::kX], 50.0 + 0.1 * value);
    EXPECT_EQ(points[k].residuals, std::vector<double>{-value});
    EXPECT_NEAR(points[k].factors[0], value / 70.0, 1.0 / 65536.0);
    EXPECT_EQ(points[k].factors[1], 0.25);
  }
}

TEST(TraceTest, HoldsTheNewestOfItsCapacity) {
  Trace trace(50, 1000 * kSecond);
  for (std::uint64_t k = 0; k < 333; ++k) {
    trace.Push(PlantSample(k), SomeVerdict(0.0, 0.0), 1, 2);
  }

  const std::vector<TracePoint> points = trace.Unpack();

  ASSERT_EQ(points.size(), 50U);
  EXPECT_EQ(points.front().sample.seq, 283U);
  EXPECT_EQ(points.back().sample.seq, 332U);
}

TEST(TraceTest, ForgetsWhatIsOlderThanItsSpan) {
  Trace trace(1000, 20 * kSecond);
  for (const std::uint64_t k : {0U, 1U, 2U, 15U, 22U}) {
    trace.Push(PlantSample(k), SomeVerdict(0.0, 0.0), 1, 2);
  }

  EXPECT_EQ(trace.Unpack().front().sample.seq, 2U);
  EXPECT_EQ(trace.size(), 3U);
}

TEST(TraceTest, MemoryFollowsTheContent) {
  Trace trace(1800, 1800 * kSecond);
  EXPECT_EQ(trace.bytes(), 0U);
  for (std::uint64_t k = 0; k < 20; ++k) {
    trace.Push(PlantSample(k), SomeVerdict(0.0, 0.0), 1, 2);
  }
  EXPECT_LT(trace.bytes(), 4096U);
  for (std::uint64_t k = 20; k < 5000; ++k) {
    trace.Push(PlantSample(k), SomeVerdict(0.0, 0.0), 1, 2);
  }
  EXPECT_LT(trace.bytes(), 1800U * 100U);
}

TEST(TraceTest, KeepsWhatANanSampleLookedLike) {
  Trace trace(10, 100 * kSecond);
  Sample sample = BadSample(3);
  sample.quality[Index(Signal::kCv)] = SignalQuality::kUncertain;
  sample.mode = ValveMode::kManual;
  Verdict verdict = SomeVerdict(std::nan(""), 0.0);
  verdict.intake = Intake::kNotFinite;
  trace.Push(sample, verdict, 1, 2);

  const TracePoint point = trace.Unpack().front();

  EXPECT_TRUE(std::isnan(point.sample[Signal::kX]));
  EXPECT_EQ(point.sample[Signal::kCv], 50.0);
  EXPECT_EQ(point.sample.quality, sample.quality);
  EXPECT_EQ(point.sample.mode, ValveMode::kManual);
  EXPECT_EQ(point.intake, Intake::kNotFinite);
  EXPECT_TRUE(std::isnan(point.residuals[0]));
}

TEST(TraceTest, BeginsAnewWithAnotherSource) {
  Trace trace(10, 100 * kSecond);
  trace.Push(PlantSample(1, 0.0, 1), SomeVerdict(0.0, 0.0), 1, 2);
  trace.Push(PlantSample(2, 0.0, 9), SomeVerdict(0.0, 0.0), 1, 2);

  ASSERT_EQ(trace.size(), 1U);
  EXPECT_EQ(trace.Unpack().front().sample.source_id, 9U);
}

TEST(TraceTest, TakingLeavesItEmptyAndUsable) {
  Trace trace(10, 100 * kSecond);
  trace.Push(PlantSample(1), SomeVerdict(0.0, 0.0), 1, 2);
  const Trace taken = trace.Take();
  trace.Push(PlantSample(2), SomeVerdict(0.0, 0.0), 1, 2);

  EXPECT_EQ(taken.Unpack().front().sample.seq, 1U);
  EXPECT_EQ(trace.Unpack().front().sample.seq, 2U);
}

}  // namespace
}  // namespace fdi::monitor
