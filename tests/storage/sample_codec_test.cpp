#include "storage/runs/sample_codec.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "storage/database/bytes.h"
#include "storage/runs/column_codec.h"

namespace fdi::storage {
namespace {

std::vector<std::uint64_t> BitsOf(std::span<const double> values) {
  std::vector<std::uint64_t> bits;
  for (const double value : values) {
    bits.push_back(std::bit_cast<std::uint64_t>(value));
  }
  return bits;
}

/// A sample as bytes of its fields, so that NaN compares equal to itself.
std::vector<std::uint64_t> FieldsOf(const StoredSample& stored) {
  const Sample& s = stored.sample;
  std::vector<std::uint64_t> fields = BitsOf(s.values);
  for (const SignalQuality quality : s.quality) {
    fields.push_back(static_cast<std::uint64_t>(quality));
  }
  for (const auto field :
       {static_cast<std::uint64_t>(s.stamp_ns), s.source_id, s.seq,
        static_cast<std::uint64_t>(s.present),
        static_cast<std::uint64_t>(s.mode),
        static_cast<std::uint64_t>(s.flow_unit),
        static_cast<std::uint64_t>(s.epoch),
        static_cast<std::uint64_t>(stored.intake),
        static_cast<std::uint64_t>(stored.initialised),
        static_cast<std::uint64_t>(stored.model_swapped),
        static_cast<std::uint64_t>(stored.truth.has_value())}) {
    fields.push_back(field);
  }
  if (stored.truth) {
    fields.push_back(static_cast<std::uint64_t>(stored.truth->fault));
    fields.push_back(std::bit_cast<std::uint64_t>(stored.truth->strength));
  }
  return fields;
}

void ExpectRoundTrip(const std::vector<StoredSample>& samples) {
  for (const ChunkCodec codec : {ChunkCodec::kPlain, ChunkCodec::kColumns}) {
    const auto back = DecodeChunk(EncodeChunk(samples, codec), "test");
    ASSERT_EQ(back.size(), samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      ASSERT_EQ(FieldsOf(back[i]), FieldsOf(samples[i])) << "sample " << i;
    }
  }
}

/// Reading of a 16-bit transmitter with the span [low, high].
double Quantize(double value, double low, double high) {
  const double step = (high - low) / 65535.0;
  return low + std::round((value - low) / step) * step;
}

/// A noisy valve at 1 Hz: six signals, transmitters of 16 bits.
std::vector<StoredSample> NoisyValve(int count, bool quantized) {
  std::mt19937_64 random(7);
  std::normal_distribution<double> noise;
  std::vector<StoredSample> samples;
  for (int k = 0; k < count; ++k) {
    StoredSample stored;
    Sample& s = stored.sample;
    s.stamp_ns = 1'700'000'000'000'000'000 + k * 1'000'000'000LL;
    s.source_id = 0xDEADBEEFCAFEF00D;
    s.seq = static_cast<std::uint64_t>(k);
    const double cv = 50.0 + 25.0 * std::sin(0.02 * k);
    const auto set = [&](Signal signal, double value, double low, double high) {
      const double reading = value + 0.005 * (high - low) * noise(random);
      s.Set(signal, quantized ? Quantize(reading, low, high) : reading);
    };
    set(Signal::kCv, cv, 0.0, 100.0);
    set(Signal::kP1, 3500.0, 0.0, 5000.0);
    set(Signal::kP2, 2600.0, 0.0, 4000.0);
    set(Signal::kT1, 132.0, 50.0, 150.0);
    set(Signal::kX, cv, -5.0, 105.0);
    set(Signal::kF, 40.0 - 0.3 * cv, 0.0, 40.0);
    samples.push_back(stored);
  }
  return samples;
}

double BytesPerSample(const std::vector<StoredSample>& samples) {
  return static_cast<double>(
             EncodeChunk(samples, ChunkCodec::kColumns).bytes.size()) /
         static_cast<double>(samples.size());
}

TEST(ColumnCodecTest, IntegersOfEveryShapeReadBack) {
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
  std::mt19937_64 random(1);
  std::vector<std::int64_t> wild(500);
  for (auto& value : wild) {
    value = static_cast<std::int64_t>(random());
  }
  for (const std::vector<std::int64_t>& values :
       std::vector<std::vector<std::int64_t>>{{5},
                                              {kMin},
                                              {1, 2},
                                              {kMin, kMax, kMin, kMax},
                                              {0, 0, 0},
                                              {7, 9, 11, 13},
                                              {1, 4, 9, 16, 25},
                                              {kMax, kMax - 1, kMin},
                                              wild}) {
    ByteWriter writer;
    WriteIntegers(writer, values);
    ByteReader reader(writer.view(), "test");
    EXPECT_EQ(ReadIntegers(reader, values.size()), values);
    EXPECT_NO_THROW(reader.ExpectEnd());
  }
}

TEST(ColumnCodecTest, DoublesOfEveryBitPatternReadBack) {
  std::mt19937_64 random(2);
  std::vector<double> wild(2000);
  for (double& value : wild) {
    value = std::bit_cast<double>(random());
  }
  // Signalling and quiet NaN with payloads, both zeros, the denormal range.
  std::vector<double> odd(100, 1.25);
  for (const std::uint64_t bits :
       {0x7FF0000000000001ULL, 0xFFF8DEADBEEF0001ULL, 0x8000000000000000ULL,
        0x0000000000000001ULL, 0x800FFFFFFFFFFFFFULL, 0x7FEFFFFFFFFFFFFFULL,
        0x7FF0000000000000ULL, 0xFFF0000000000000ULL}) {
    odd.push_back(std::bit_cast<double>(bits));
    odd.push_back(-0.5);
  }
  const std::vector<double> denormals{5e-324, 1e-310, -1e-320, 5e-324, 1e-310,
                                      2e-310, 3e-310, 4e-310,  5e-310};
  for (const auto& values : {wild, odd, denormals, {0.1}, {-0.0, -0.0}}) {
    ByteWriter writer;
    WriteDoubles(writer, values);
    ByteReader reader(writer.view(), "test");
    EXPECT_EQ(BitsOf(ReadDoubles(reader, values.size())), BitsOf(values));
  }
}

TEST(ColumnCodecTest, DecimalsWithThreeDigitsTakeLittleMoreThanTheirDigits) {
  std::mt19937_64 random(3);
  std::vector<double> values(1000);
  for (double& value : values) {
    value = static_cast<double>(random() % 1000) / 1000.0;  // < 2 bytes each
  }
  ByteWriter writer;
  WriteDoubles(writer, values);
  EXPECT_LE(writer.size(), 2 * values.size() + 64);
}

// Hints save time; the bits must be the same with those of another valve.
TEST(SampleCodecTest, HintsOfOtherDataChangeNoSample) {
  ChunkHints hints;
  EncodeChunk(NoisyValve(300, true), ChunkCodec::kColumns, &hints);
  EXPECT_TRUE(hints.columns[Index(Signal::kCv)].has_value());
  std::vector<StoredSample> other = NoisyValve(300, true);
  for (StoredSample& stored : other) {
    for (double& value : stored.sample.values) {
      value = value * 1.7 + 3.0;
    }
  }
  other[7].sample.values[0] = std::numeric_limits<double>::quiet_NaN();

  for (const auto& samples : {other, NoisyValve(300, false), other}) {
    const Chunk chunk = EncodeChunk(samples, ChunkCodec::kColumns, &hints);
    const auto back = DecodeChunk(chunk, "test");
    ASSERT_EQ(back.size(), samples.size());
    for (std::size_t k = 0; k < samples.size(); ++k) {
      ASSERT_EQ(FieldsOf(back[k]), FieldsOf(samples[k])) << "sample " << k;
    }
  }
}

TEST(SampleCodecTest, HintsOfTheSameValveCostNoBytes) {
  const std::vector<StoredSample> samples = NoisyValve(1200, true);
  const std::span<const StoredSample> all(samples);
  ChunkHints hints;
  EncodeChunk(all.first(600), ChunkCodec::kColumns, &hints);

  const auto hinted =
      EncodeChunk(all.last(600), ChunkCodec::kColumns, &hints).bytes.size();
  const auto searched =
      EncodeChunk(all.last(600), ChunkCodec::kColumns).bytes.size();

  EXPECT_LE(static_cast<double>(hinted), 1.05 * static_cast<double>(searched));
}

TEST(SampleCodecTest, RandomSamplesReadBackBitForBit) {
  std::mt19937_64 random(4);
  for (const std::size_t count : {1UL, 2UL, 3UL, 17UL, 600UL}) {
    std::vector<StoredSample> samples(count);
    for (StoredSample& stored : samples) {
      Sample& s = stored.sample;
      s.stamp_ns = static_cast<std::int64_t>(random());
      s.source_id = random();
      s.seq = random();
      s.present = static_cast<SignalMask>(random() % (1U << kSignalCount));
      for (std::size_t i = 0; i < kSignalCount; ++i) {
        s.values[i] = std::bit_cast<double>(random());
        s.quality[i] = static_cast<SignalQuality>(random() % 3);
      }
      s.mode = static_cast<ValveMode>(random() % 5);
      s.flow_unit = static_cast<FlowUnit>(random() % 2);
      s.epoch = static_cast<std::uint32_t>(random());
      stored.intake = static_cast<Intake>(random() % kIntakeCount);
      stored.initialised = random() % 2 == 0;
      stored.model_swapped = random() % 2 == 0;
      if (random() % 2 == 0) {
        stored.truth = FaultTruth{static_cast<int>(random() % 20),
                                  std::bit_cast<double>(random())};
      }
    }
    ExpectRoundTrip(samples);
  }
}

TEST(SampleCodecTest, ValveSamplesReadBackBitForBit) {
  ExpectRoundTrip(NoisyValve(600, true));
  std::vector<StoredSample> with_pv = NoisyValve(600, true);
  with_pv[599].sample.Set(Signal::kPv, -1e12);
  ExpectRoundTrip(with_pv);
  ExpectRoundTrip(NoisyValve(600, false));
}

std::vector<std::byte> BytesOf(std::string_view hex) {
  std::vector<std::byte> bytes;
  for (std::size_t i = 0; i < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::byte>(
        std::stoul(std::string(hex.substr(i, 2)), nullptr, 16)));
  }
  return bytes;
}

// The bytes of a file that a user has. Those of columns are compressed, which
// another zlib may do otherwise.
TEST(SampleCodecTest, PlainChunksKeepTheirBytes) {
  std::vector<StoredSample> samples(3);
  for (std::size_t k = 0; k < 3; ++k) {
    Sample& s = samples[k].sample;
    s.stamp_ns = 1'700'000'000'000'000'000 +
                 static_cast<std::int64_t>(k) * 1'000'000'000;
    s.source_id = 7;
    s.seq = k;
    s.Set(Signal::kCv, 50.0 + static_cast<double>(k));
    s.Set(Signal::kF, 12.5);
    s.Set(Signal::kPz, 140.0);
  }
  samples[2].truth = FaultTruth{7, 0.5};
  samples[2].sample.quality[Index(Signal::kPz)] = SignalQuality::kUncertain;
  const std::vector<std::byte> bytes = BytesOf(
      "0b08110000002a36fe9c9717070000000000000021020000000000000000000000"
      "004940000000000000294000000000008061400f08110000cac471fe9c97170700"
      "000000000000010000000000000021020000000000000000000000804940000000"
      "0000002940000000000080"
      "61401f0e510000945fadfe9c9717070000000000000002000000000000002102"
      "0000000000000000040000000000040000000000000007000000000000000000"
      "000000004a4000000000000029400000000000806140000000000000e03f");
  EXPECT_EQ(EncodeChunk(samples, ChunkCodec::kPlain).bytes, bytes);
}

// Six signals of 16 bits hold 12 bytes of resolution, noise of 0.5 % of span
// about 10 of information.
TEST(SampleCodecTest, SixNoisySignalsOf16BitsTakeAtMost20BytesPerSample) {
  const double quantized = BytesPerSample(NoisyValve(600, true));
  const double continuous = BytesPerSample(NoisyValve(600, false));
  std::printf("bytes/sample: 16 bits %.2f, unquantized doubles %.2f\n",
              quantized, continuous);
  RecordProperty("bytes_per_sample", std::to_string(quantized));
  EXPECT_LE(quantized, 20.0);
  EXPECT_LE(continuous, 48.0);
}

TEST(SampleCodecTest, OneBadReadingDoesNotSpoilItsColumn) {
  auto samples = NoisyValve(600, true);
  const double before = BytesPerSample(samples);
  samples[300].sample.Set(Signal::kX, std::numeric_limits<double>::quiet_NaN());
  samples[301].sample.Set(Signal::kF, 1e300);

  ExpectRoundTrip(samples);
  EXPECT_LE(BytesPerSample(samples), before + 0.5);
}

TEST(SampleCodecTest, EveryFlippedBitIsDetected) {
  for (const ChunkCodec codec : {ChunkCodec::kPlain, ChunkCodec::kColumns}) {
    const Chunk good = EncodeChunk(NoisyValve(20, true), codec);
    for (std::size_t bit = 0; bit < good.bytes.size() * 8; ++bit) {
      Chunk bad = good;
      bad.bytes[bit / 8] ^= std::byte{1} << (bit % 8);
      ASSERT_THROW(DecodeChunk(bad, "chunk"), DataError) << "bit " << bit;
    }
    for (std::size_t size = 0; size < good.bytes.size(); ++size) {
      Chunk bad = good;
      bad.bytes.resize(size);
      ASSERT_THROW(DecodeChunk(bad, "chunk"), DataError) << "size " << size;
    }
    Chunk bad = good;
    bad.count = 21;
    EXPECT_THROW(DecodeChunk(bad, "chunk"), DataError);
    bad.count = 0;
    EXPECT_THROW(DecodeChunk(bad, "chunk"), DataError);
  }
}

// Bytes that pass the CRC but were never written by EncodeChunk(): the parser
// below must hold by itself.
TEST(SampleCodecTest, RandomColumnsAreRefusedOrRead) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 20000; ++round) {
    std::vector<std::byte> bytes(random() % 64);
    for (std::byte& byte : bytes) {
      byte = static_cast<std::byte>(random() % 20);
    }
    ByteReader reader(bytes, "test");
    try {
      EXPECT_EQ(ReadDoubles(reader, 5).size(), 5U);
    } catch (const DataError&) {
    }
  }
}

TEST(SampleCodecTest, EmptyAndOversizedChunksAreRefused) {
  EXPECT_THROW(EncodeChunk({}, ChunkCodec::kColumns), std::invalid_argument);
  EXPECT_THROW(EncodeChunk(std::vector<StoredSample>(kMaxChunkSamples + 1),
                           ChunkCodec::kPlain),
               std::invalid_argument);
}

}  // namespace
}  // namespace fdi::storage
