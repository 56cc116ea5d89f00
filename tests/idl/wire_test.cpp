#include "idl/wire.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace fdi::idl {
namespace {

ModelSet ThreeFaults() {
  ModelSet models;
  models.name = "pump-house";
  models.content_hash = 0xABCDU;
  models.faults = {1, 3, 19};
  models.channels = {{"X", Signal::kX, -0.5, 0.4}, {"F", Signal::kF, -1, 1}};
  models.observers.resize(4);
  models.decision.isolation_threshold = 0.8;
  return models;
}

TEST(WireTest, IdsOfOneTo64BytesAreAccepted) {
  EXPECT_NO_THROW(ValidateId("v"));
  EXPECT_NO_THROW(ValidateId(std::string(64, 'v')));
  EXPECT_THROW(ValidateId(""), DataError);
  EXPECT_THROW(ValidateId(std::string(65, 'v')), DataError);
  EXPECT_THROW(ValidateId(std::string("a\0b", 3)), DataError);
}

// Half of T = 0.8 makes a candidate; a member of the isolated set always is.
TEST(WireTest, CandidatesAreTheIsolatedAndTheLikelyLargestFirst) {
  Verdict verdict;
  verdict.fault_factors[0] = 0.39;
  verdict.fault_factors[1] = 0.40;
  verdict.fault_factors[2] = 0.95;
  verdict.strengths[2] = -0.75;
  verdict.isolated = 0b100;

  const auto candidates =
      CandidatesOf(ThreeFaults(), verdict, verdict.isolated);

  ASSERT_EQ(candidates.size(), 2U);
  EXPECT_EQ(candidates[0].fault, 19);
  EXPECT_EQ(candidates[0].strength, -0.75);
  EXPECT_TRUE(candidates[0].isolated);
  EXPECT_EQ(candidates[1].fault, 3);
  EXPECT_FALSE(candidates[1].isolated);
}

TEST(WireTest, IsolatedFaultIsACandidateWhateverItsFactor) {
  Verdict verdict;
  verdict.fault_factors[0] = 0.01;
  verdict.isolated = 0b001;

  const auto candidates =
      CandidatesOf(ThreeFaults(), verdict, verdict.isolated);

  ASSERT_EQ(candidates.size(), 1U);
  EXPECT_EQ(candidates[0].fault, 1);
}

}  // namespace
// The last second of 31 bits, and the next one, which the library calls 1901.
TEST(WireTest, StampsOfTheLibraryGoOnAfterJanuary2038) {
  constexpr std::int64_t kSecond = 1'000'000'000;
  constexpr std::int64_t kLast = ((std::int64_t{1} << 31) - 1) * kSecond;
  constexpr std::int64_t kNextOfLibrary = -(std::int64_t{1} << 31) * kSecond;
  EXPECT_EQ(UtcOfStamp(kLast), kLast);
  EXPECT_EQ(UtcOfStamp(kNextOfLibrary), kLast + kSecond);
  EXPECT_EQ(UtcOfStamp(kNextOfLibrary + 5), kLast + kSecond + 5);
}

}  // namespace fdi::idl
