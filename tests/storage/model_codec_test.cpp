#include "storage/models/model_codec.h"

#include <bit>
#include <cstring>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/storage/model_set_fixture.h"

namespace fdi::storage {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

/// Bytes whose CRC is right, whatever else is wrong with them.
std::vector<std::byte> WithValidChecksum(std::vector<std::byte> bytes) {
  // CRC-32 of IEEE 802.3, bit by bit: independent of zlib.
  std::uint32_t crc = 0xFFFFFFFFU;
  for (std::size_t i = 0; i + 4 < bytes.size(); ++i) {
    crc ^= std::to_integer<std::uint32_t>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) {
      crc = crc >> 1U ^ (0xEDB88320U & (0U - (crc & 1U)));
    }
  }
  crc = ~crc;
  std::memcpy(bytes.data() + bytes.size() - 4, &crc, 4);
  return bytes;
}

std::string Refusal(std::span<const std::byte> bytes) {
  try {
    DecodeModelSet(bytes, "blob 7");
  } catch (const DataError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ModelCodecTest, EveryFieldReadsBackBitForBit) {
  ModelSet models = RandomModelSet("valve", 5);
  models.observers[2].channels[1].model.parallel = false;
  models.observers[1].channels[0].validation.vaf =
      std::bit_cast<double>(0x7FF8000000001234ULL);
  models.observers[1].channels[0].validation.bias = -0.0;
  models.observers[1].channels[0].validation.mse = 5e-324;
  models.decision.settling_samples = 17;
  models.decision.evidence_support = 8.5;
  models.validity.cv = {10.25, 90.75};
  models.validity.rearm_samples = 61;
  models.stuck = {260, 0, 70};
  FloorLimits& floor = models.floor.emplace();
  floor.quick = {0.75, 20.0};
  floor.slow.share = 0.25;
  floor.flow_shape.assign(FloorLimits::kShapePoints, 0.25);
  floor.flow_share = 0.5;
  AddFindings(models);
  models.decision.interpolation_allowance = 0.06;
  models.decision.early_error = 1e-3;
  models.observers[2].channels[1].fit = {-0.75, 0.5, 2.25};
  models.observers[1].moved = MaskOf(Signal::kT1);
  models.physics = {{"trim.kv_m3_h", 118.5}, {"drive.command_delay", -1.0}};
  models.position_as_command = true;

  const auto bytes = EncodeModelSet(models);
  const ModelSet back = DecodeModelSet(bytes, "test");

  EXPECT_EQ(EncodeModelSet(back), bytes);
  EXPECT_EQ(back.name, "valve");
  EXPECT_EQ(back.created_ns, models.created_ns);
  EXPECT_EQ(back.flow_unit, FlowUnit::kTPerHour);
  EXPECT_EQ(back.validity.cv.maximum, 90.75);
  EXPECT_EQ(back.validity.dp.minimum, kUnbounded.minimum);
  EXPECT_EQ(back.validity.rearm_samples, 61);
  EXPECT_EQ(back.stuck.t1, 260);
  EXPECT_EQ(back.stuck.p2, 70);
  EXPECT_EQ(back.floor, models.floor);
  EXPECT_EQ(back.decision.interpolation_allowance, 0.06);
  EXPECT_EQ(back.decision.early_error, 1e-3);
  EXPECT_EQ(back.observers[2].channels[1].fit, (FitBounds{-0.75, 0.5, 2.25}));
  EXPECT_EQ(back.observers[2].channels[0].fit, FitBounds{});
  EXPECT_EQ(back.observers[1].moved, MaskOf(Signal::kT1));
  ASSERT_EQ(back.physics.size(), 2U);
  EXPECT_EQ(back.physics[1].name, "drive.command_delay");
  EXPECT_EQ(back.physics[1].value, -1.0);
  EXPECT_TRUE(back.position_as_command);
  EXPECT_EQ(back.decision.settling_samples, 17);
  EXPECT_EQ(back.decision.evidence_support, 8.5);
  EXPECT_EQ(back.faults, models.faults);
  EXPECT_EQ(back.groups, models.groups);
  EXPECT_EQ(back.undetectable, models.undetectable);
  EXPECT_EQ(back.training_runs, models.training_runs);
  const ChannelObserver& a = models.observers[2].channels[1];
  const ChannelObserver& b = back.observers[2].channels[1];
  EXPECT_FALSE(b.model.parallel);
  EXPECT_EQ(b.model.regressors, a.model.regressors);
  EXPECT_EQ(b.model.rules[1].antecedents[1].right_width,
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(b.model.rules[0].slopes, a.model.rules[0].slopes);
  EXPECT_TRUE(b.model.rules[0].center.empty());
  EXPECT_EQ(b.model.rules[1].center, a.model.rules[1].center);
  EXPECT_EQ(b.model.rules[1].metric, a.model.rules[1].metric);
  EXPECT_EQ(b.membership.b, a.membership.b);
  EXPECT_EQ(b.residual_sd, a.residual_sd);
  const ValidationFigures& v = back.observers[1].channels[0].validation;
  EXPECT_EQ(std::bit_cast<std::uint64_t>(v.vaf), 0x7FF8000000001234ULL);
  EXPECT_TRUE(std::signbit(v.bias));
  EXPECT_EQ(v.mse, 5e-324);
}

TEST(ModelCodecTest, PredictionsAreTheSameAfterReadingBack) {
  const ModelSet models = RandomModelSet("valve");
  const ModelSet back = DecodeModelSet(EncodeModelSet(models), "test");
  for (int i = 0; i < 100; ++i) {
    const double x[2] = {0.01 * i, 1.0 / (1.0 + i)};
    for (std::size_t o = 0; o < models.observers.size(); ++o) {
      EXPECT_EQ(Evaluate(models.observers[o].channels[0].model, x),
                Evaluate(back.observers[o].channels[0].model, x));
    }
  }
}

TEST(ModelCodecTest, VersionAndHashAreNotPartOfTheBytes) {
  ModelSet models = RandomModelSet("valve");
  const auto bytes = EncodeModelSet(models);
  models.version = 9;
  models.content_hash = 10;
  EXPECT_EQ(EncodeModelSet(models), bytes);
}

TEST(ModelCodecTest, EveryFlippedByteAndEveryCutIsDetected) {
  const auto good = EncodeModelSet(RandomModelSet("v", 1));
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0xFF}) {
      auto bad = good;
      bad[i] ^= static_cast<std::byte>(flip);
      ASSERT_NE(Refusal(bad), "accepted") << "byte " << i;
    }
    ASSERT_NE(Refusal(std::span(good).first(i)), "accepted") << "size " << i;
  }
  auto longer = good;
  longer.push_back(std::byte{0});
  EXPECT_NE(Refusal(longer), "accepted");
}

// The CRC is no protection from bytes made on purpose: with a CRC that fits,
// a flipped byte is refused or gives another set, and memory stays bounded.
TEST(ModelCodecTest, ForgedBytesAreRefusedOrHarmless) {
  const auto good = EncodeModelSet(RandomModelSet("v", 1));
  int refused = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int flip : {0x01, 0x80, 0xFF}) {
      auto bad = good;
      bad[i] ^= static_cast<std::byte>(flip);
      bad = WithValidChecksum(std::move(bad));
      if (Refusal(bad) != "accepted") {
        ++refused;
      } else {
        ASSERT_EQ(EncodeModelSet(DecodeModelSet(bad, "v")).size(), bad.size());
      }
    }
  }
  EXPECT_GT(refused, 0);
  EXPECT_EQ(Refusal(WithValidChecksum(good)), "accepted");
}

TEST(ModelCodecTest, RefusalsNameThePlaceAndTheReason) {
  auto bytes = EncodeModelSet(RandomModelSet("v", 1));
  auto damaged = bytes;
  damaged[40] ^= std::byte{1};
  EXPECT_THAT(Refusal(damaged), HasSubstr("blob 7 is damaged: its CRC-32"));
  auto older = bytes;
  older[4] = std::byte{3};
  older[5] = std::byte{0};
  EXPECT_THAT(Refusal(WithValidChecksum(older)),
              AllOf(HasSubstr("blob 7: format 3 is of another version"),
                    HasSubstr("`fdi-trainer train`")));
  EXPECT_THAT(Refusal({}), HasSubstr("is not a model set"));
  // The length of the name stands first in the payload, after 16 bytes.
  auto huge = bytes;
  huge[18] = std::byte{0x7F};
  EXPECT_THAT(Refusal(WithValidChecksum(huge)), HasSubstr("beyond its limit"));
}

TEST(ModelCodecTest, HashBeginsLikeSha256) {
  // FIPS 180-4 example: SHA-256("abc") = ba7816bf8f01cfea...
  const std::string text = "abc";
  EXPECT_EQ(Sha256Start(std::as_bytes(std::span(text))), 0xBA7816BF8F01CFEAULL);
}

TEST(ModelCodecTest, ContentHashDependsOnContentNotOnItsOrigin) {
  const ModelSet models = RandomModelSet("pump");
  ModelSet elsewhere = models;
  elsewhere.created_ns += 1;
  elsewhere.software += "+1";
  elsewhere.training_runs.push_back("0123456789ab");
  ModelSet other = models;
  other.decision.isolation_samples += 1;

  EXPECT_EQ(ContentHash(elsewhere), ContentHash(models));
  EXPECT_NE(ContentHash(other), ContentHash(models));
}

}  // namespace
}  // namespace fdi::storage
