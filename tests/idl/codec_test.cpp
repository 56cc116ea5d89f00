#include "idl/codec.h"

#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "tests/idl/payload.h"

namespace fdi::idl {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Bits of values that a decimal or a float would not survive.
const double kThird = 1.0 / 3.0;
const double kSignallingBits = std::bit_cast<double>(0x7FF8'0000'DEAD'BEEFU);

std::uint64_t Bits(double value) {
  return std::bit_cast<std::uint64_t>(value);
}

// Through the generated serializer, as on the wire.
template <int kVersion = 1, typename Message>
Message RoundTrip(const Message& message) {
  using Codec = Codec<Message, kVersion>;
  typename Codec::Wire out;
  Codec::Encode(message, out);
  CheckedType<typename Codec::Type> type;
  typename Codec::Wire in;
  EXPECT_TRUE(Deserialize(type, Serialized(type, &out), &in));
  Message result;
  EXPECT_TRUE(Codec::Decode(in, result));
  return result;
}

ValveSampleMessage SomeSample() {
  ValveSampleMessage message;
  message.valve_id = std::string(64, 'v');
  Sample& sample = message.sample;
  sample.stamp_ns = -1;
  sample.source_id = 0xFFFF'FFFF'FFFF'FFFFU;
  sample.seq = 1U << 31U;
  for (std::size_t i = 0; i < kModelSignalCount; ++i) {
    sample.values[i] = kThird * static_cast<double>(i + 1);
    sample.quality[i] = static_cast<SignalQuality>(i % 3);
  }
  sample.values[Index(Signal::kX)] = kSignallingBits;
  sample.values[Index(Signal::kF)] = -0.0;
  sample.values[Index(Signal::kSp)] = -kInfinity;
  sample.present = 0x2A5;
  sample.mode = ValveMode::kCalibrating;
  sample.flow_unit = FlowUnit::kTPerHour;
  sample.epoch = 7;
  return message;
}

void ExpectSame(const ValveSampleMessage& got, const ValveSampleMessage& sent) {
  EXPECT_EQ(got.valve_id, sent.valve_id);
  EXPECT_EQ(got.sample.stamp_ns, sent.sample.stamp_ns);
  EXPECT_EQ(got.sample.source_id, sent.sample.source_id);
  EXPECT_EQ(got.sample.seq, sent.sample.seq);
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    EXPECT_EQ(Bits(got.sample.values[i]), Bits(sent.sample.values[i])) << i;
  }
  EXPECT_EQ(got.sample.quality, sent.sample.quality);
  EXPECT_EQ(got.sample.present, sent.sample.present);
  EXPECT_EQ(got.sample.mode, sent.sample.mode);
  EXPECT_EQ(got.sample.flow_unit, sent.sample.flow_unit);
  EXPECT_EQ(got.sample.epoch, sent.sample.epoch);
}

TEST(CodecTest, SamplesArriveBitForBit) {
  const ValveSampleMessage sent = SomeSample();
  ExpectSame(RoundTrip(sent), sent);
  ExpectSame(RoundTrip<2>(sent), sent);
}

ValveSampleMessage SampleWithPv() {
  ValveSampleMessage message = SomeSample();
  message.sample.Set(Signal::kPv, -1e12 * kThird);
  message.sample.quality[Index(Signal::kPv)] = SignalQuality::kUncertain;
  return message;
}

TEST(CodecTest, APvGoesByVersion2Alone) {
  const ValveSampleMessage sent = SampleWithPv();
  ExpectSame(RoundTrip<2>(sent), sent);
  v1::ValveSample first;
  EXPECT_THAT([&] { Codec<ValveSampleMessage>::Encode(sent, first); },
              ThrowsMessage<DataError>(HasSubstr("present is 1701")));
  // An object that held a PV does not keep it.
  ValveSampleMessage other = SampleWithPv();
  Codec<ValveSampleMessage>::Encode(SomeSample(), first);
  ASSERT_TRUE(Codec<ValveSampleMessage>::Decode(first, other));
  ExpectSame(other, SomeSample());
}

TEST(CodecTest, WhatNobodyDefinedIsNotDecodedFromVersion2) {
  using Codec = Codec<ValveSampleMessage, 2>;
  v2::ValveSample wire;
  Codec::Encode(SampleWithPv(), wire);
  ValveSampleMessage message;
  ASSERT_TRUE(Codec::Decode(wire, message));

  v2::ValveSample wrong = wire;
  wrong.quality()[10] = static_cast<v2::SignalQuality>(3);
  EXPECT_FALSE(Codec::Decode(wrong, message));
  wrong = wire;
  wrong.mode(static_cast<v2::ValveMode>(5));
  EXPECT_FALSE(Codec::Decode(wrong, message));
  wrong = wire;
  wrong.flow_unit(static_cast<v2::FlowUnit>(2));
  EXPECT_FALSE(Codec::Decode(wrong, message));
  wrong = wire;
  wrong.present(1U << kSignalCount);
  EXPECT_FALSE(Codec::Decode(wrong, message));
  wrong = wire;
  wrong.stamp_ns(kMaxStampNs + 1);
  EXPECT_FALSE(Codec::Decode(wrong, message));
  wrong = wire;
  wrong.valve_id() = "";
  EXPECT_FALSE(Codec::Decode(wrong, message));
}

// Signals of a model set are those of version 1.
TEST(CodecTest, NoChannelOfAModelSetIsAPv) {
  ModelSetInfoMessage info;
  info.model_set = "m";
  info.channels = {{"PV", Signal::kPv, -1.0, 1.0}};
  v1::ModelSetInfo wire;
  EXPECT_THROW(Codec<ModelSetInfoMessage>::Encode(info, wire), DataError);
  info.channels.front().output = Signal::kPz;
  EXPECT_NO_THROW(Codec<ModelSetInfoMessage>::Encode(info, wire));
  wire.channels()[0].output(10);
  EXPECT_FALSE(Codec<ModelSetInfoMessage>::Decode(wire, info));
}

DecisionMessage FullDecision() {
  DecisionMessage message;
  message.valve_id = "V";
  message.model_hash = 42;
  message.channel_count = kMaxChannels;
  message.fault_count = kMaxFaults;
  message.observer_count = kMaxObservers;
  Verdict& verdict = message.verdict;
  verdict.stamp_ns = 5;
  verdict.source_id = 6;
  verdict.seq = 7;
  verdict.intake = Intake::kPeriod;
  verdict.initialised = true;
  verdict.quality = Quality::kModelUnsuited;
  verdict.state = State::kIsolated;
  verdict.detected = true;
  verdict.confidence = kThird;
  verdict.normal_factor = std::nextafter(1.0, 0.0);
  verdict.isolated = 1ULL << 63U;
  verdict.residuals.fill(kSignallingBits);
  verdict.fault_factors.fill(kThird);
  verdict.strengths.fill(-kThird);
  verdict.observer_factors.fill(0.1);
  return message;
}

TEST(CodecTest, DecisionsOfTheLargestModelSetArriveBitForBit) {
  const DecisionMessage sent = FullDecision();

  const DecisionMessage got = RoundTrip(sent);

  EXPECT_EQ(got.observer_count, kMaxObservers);
  EXPECT_EQ(got.fault_count, kMaxFaults);
  EXPECT_EQ(got.channel_count, kMaxChannels);
  EXPECT_EQ(got.model_hash, 42U);
  EXPECT_EQ(got.verdict.intake, Intake::kPeriod);
  EXPECT_TRUE(got.verdict.initialised);
  EXPECT_EQ(got.verdict.quality, Quality::kModelUnsuited);
  EXPECT_EQ(got.verdict.state, State::kIsolated);
  EXPECT_TRUE(got.verdict.detected);
  EXPECT_EQ(got.verdict.isolated, sent.verdict.isolated);
  EXPECT_EQ(Bits(got.verdict.normal_factor), Bits(sent.verdict.normal_factor));
  EXPECT_EQ(Bits(got.verdict.residuals.back()), Bits(kSignallingBits));
  EXPECT_EQ(got.verdict.fault_factors, sent.verdict.fault_factors);
  EXPECT_EQ(got.verdict.strengths, sent.verdict.strengths);
  EXPECT_EQ(got.verdict.observer_factors, sent.verdict.observer_factors);
}

// 2 channels, 5 faults, 11 observers: the paper's model set.
TEST(CodecTest, SmallModelSetsMakeSmallMessages) {
  DecisionMessage message = FullDecision();
  message.channel_count = 2;
  message.fault_count = 5;
  message.observer_count = 11;
  v1::DecisionVector wire;
  Codec<DecisionMessage>::Encode(message, wire);

  TopicOf<DecisionMessage>::Type type;
  EXPECT_LT(Serialized(type, &wire).size(), 320U);
  EXPECT_EQ(RoundTrip(message).verdict.observer_factors[11], 0.0);
}

TEST(CodecTest, FaultEventsArriveWhole) {
  FaultEvent sent;
  sent.valve_id = "V";
  sent.source_id = 1;
  sent.seq = 2;
  sent.episode_id = 3;
  sent.transition = {.kind = TransitionKind::kClosed,
                     .stamp_ns = 4,
                     .detection_stamp_ns = 5,
                     .faults = 0b11,
                     .factor = kThird,
                     .strength = -0.5,
                     .reason = EndReason::kUnknown};
  sent.candidates = {{19, 0.9, -0.5, true}, {3, 0.4, 0.1, false}};
  sent.model_set = "set";
  sent.model_version = 6;
  sent.model_hash = 7;
  sent.persisted = true;

  const FaultEvent got = RoundTrip(sent);

  EXPECT_EQ(got.episode_id, 3U);
  EXPECT_EQ(got.seq, 2U);
  EXPECT_EQ(got.transition.kind, TransitionKind::kClosed);
  EXPECT_EQ(got.transition.stamp_ns, 4);
  EXPECT_EQ(got.transition.detection_stamp_ns, 5);
  EXPECT_EQ(got.transition.faults, 0b11U);
  EXPECT_EQ(got.transition.factor, kThird);
  EXPECT_EQ(got.transition.strength, -0.5);
  EXPECT_EQ(got.transition.reason, EndReason::kUnknown);
  ASSERT_EQ(got.candidates.size(), 2U);
  EXPECT_EQ(got.candidates[1].fault, 3);
  EXPECT_TRUE(got.candidates[0].isolated);
  EXPECT_EQ(got.model_version, 6);
  EXPECT_TRUE(got.persisted);
}

TEST(CodecTest, ModelSetsArriveWhole) {
  ModelSet models;
  models.name = "set";
  models.content_hash = 9;
  models.version = 2;
  models.sample_period_s = 0.1;
  models.channels = {{"X", Signal::kX, -0.5, 0.4}};
  models.faults = {1, 19, 22};
  models.observers.resize(2);
  models.observers[1].name = "f19 0.50";
  models.observers[1].fault = 19;
  models.observers[1].strength = -0.5;
  models.observers[0].channels.resize(1);
  models.undetectable = {5};
  models.groups = {{1, 19}, {3}};
  models.decision.clearing_samples = 61;

  const ModelSetInfoMessage got = RoundTrip(Describe(models));

  EXPECT_EQ(got.model_set, "set");
  EXPECT_EQ(got.model_hash, 9U);
  EXPECT_EQ(got.sample_period_s, 0.1);
  EXPECT_EQ(got.clearing_samples, 61);
  ASSERT_EQ(got.channels.size(), 1U);
  EXPECT_EQ(got.channels[0].output, Signal::kX);
  EXPECT_EQ(got.channels[0].lower_threshold, -0.5);
  EXPECT_EQ(got.faults, models.faults);
  ASSERT_EQ(got.observers.size(), 2U);
  EXPECT_EQ(got.observers[1].name, "f19 0.50");
  EXPECT_EQ(got.observers[1].strength, -0.5);
  EXPECT_EQ(got.undetectable, models.undetectable);
  EXPECT_EQ(got.groups, models.groups);
}

TEST(CodecTest, MonitorStatusArrivesWhole) {
  MonitorStatusMessage sent;
  sent.monitor = "host:1";
  sent.software = "0.1.0";
  sent.stamp_ns = 4;
  sent.health = Health::kDegraded;
  sent.text = std::string(255, 't');
  sent.counters = {{"received", 1ULL << 40U}, {"range", 3}};

  const MonitorStatusMessage got = RoundTrip(sent);

  EXPECT_EQ(got.monitor, "host:1");
  EXPECT_EQ(got.health, Health::kDegraded);
  EXPECT_EQ(got.text, sent.text);
  EXPECT_EQ(got.counters, sent.counters);
}

TEST(CodecTest, ABatchArrivesWhole) {
  DecisionBatchMessage sent{"host:1", {}};
  for (std::size_t i = 0; i < kMaxBatch; ++i) {
    DecisionMessage& vector = sent.vectors.emplace_back();
    vector.valve_id = "V" + std::to_string(i);
    vector.fault_count = 1;
    vector.observer_count = 2;
    vector.verdict.seq = i;
    vector.verdict.fault_factors[0] = 0.25;
  }

  const DecisionBatchMessage got = RoundTrip(sent);

  EXPECT_EQ(got.monitor, "host:1");
  ASSERT_EQ(got.vectors.size(), kMaxBatch);
  EXPECT_EQ(got.vectors.back().valve_id, "V127");
  EXPECT_EQ(got.vectors.back().verdict.seq, 127U);
  EXPECT_EQ(got.vectors.back().verdict.fault_factors[0], 0.25);
  EXPECT_EQ(got.vectors.back().observer_count, 2);
  sent.vectors.push_back(sent.vectors.front());
  EXPECT_THROW(RoundTrip(sent), DataError);
}

TEST(CodecTest, MonitorShareArrivesWhole) {
  const MonitorShare got =
      RoundTrip(MonitorShare{"host:1", "FV-*", "hall-1,yard"});

  EXPECT_EQ(got.monitor, "host:1");
  EXPECT_EQ(got.valves, "FV-*");
  EXPECT_EQ(got.partitions, "hall-1,yard");
}

TEST(CodecTest, AValveStateArrivesWhole) {
  ValveStateMessage sent;
  sent.valve_id = "FV-1";
  sent.monitor = "host:1";
  sent.as_of_ns = 7;
  sent.quality = Quality::kLive;
  sent.state = State::kIsolated;
  sent.partly = true;
  sent.unconfirmed_ns = 6;
  sent.model_set = "demo@2";
  sent.episode_id = 0xc0ffee;
  sent.fault = "f3|f6";
  sent.look_alikes = "f18";
  sent.certainty = "one of";
  sent.layer = "physics";
  sent.priority = 2;
  sent.strength = -0.25;
  sent.since_ns = 5;
  sent.unjudged_ns = 4;
  sent.why = "UNCOVERED cv|dp";

  EXPECT_EQ(RoundTrip(sent), sent);
  for (const char* fault : {"", "unknown", "f19"}) {
    sent.fault = fault;
    EXPECT_EQ(RoundTrip(sent), sent);
  }
  sent.fault = "f99";
  EXPECT_THROW(RoundTrip(sent), DataError);
}

TEST(CodecTest, ATooLongIdIsRefusedNotCut) {
  ValveSampleMessage message = SomeSample();
  message.valve_id += 'v';
  v1::ValveSample wire;

  EXPECT_THAT([&] { Codec<ValveSampleMessage>::Encode(message, wire); },
              ThrowsMessage<DataError>(HasSubstr("65 bytes")));
}

TEST(CodecTest, AnIdWithControlCharactersIsNeitherSentNorDecoded) {
  v1::ValveSample wire;
  Codec<ValveSampleMessage>::Encode(SomeSample(), wire);
  ValveSampleMessage message;
  wire.valve_id() = "V-\u00b5 1";
  EXPECT_TRUE(Codec<ValveSampleMessage>::Decode(wire, message));
  for (const char* id : {"V\n2026 error", "V\x1b[2J", "V\x07", "V\x7f",
                         "V\xc2\x9b", "V\xff", "V\xed\xa0\x80"}) {
    wire.valve_id() = id;
    EXPECT_FALSE(Codec<ValveSampleMessage>::Decode(wire, message)) << id;
    ValveSampleMessage own = SomeSample();
    own.valve_id = id;
    v1::ValveSample other;
    EXPECT_THROW(Codec<ValveSampleMessage>::Encode(own, other), DataError);
  }
}

TEST(CodecTest, TooLongTextsAndListsAreRefused) {
  MonitorStatusMessage status;
  status.monitor = "m";
  status.text = std::string(256, 't');
  v1::MonitorStatus wire;
  EXPECT_THROW(Codec<MonitorStatusMessage>::Encode(status, wire), DataError);
  status.text.clear();
  status.counters.resize(kMaxCounters + 1);
  EXPECT_THROW(Codec<MonitorStatusMessage>::Encode(status, wire), DataError);
  status.counters = {{std::string(33, 'c'), 1}};
  EXPECT_THROW(Codec<MonitorStatusMessage>::Encode(status, wire), DataError);
}

TEST(CodecTest, WhatDoesNotFitIsNamed) {
  FaultEvent event;
  event.valve_id = "V";
  v1::FaultEvent wire;
  event.candidates = {{kLastFinding + 1, 0.9, 0.5, true}};
  EXPECT_THAT([&] { Codec<FaultEvent>::Encode(event, wire); },
              ThrowsMessage<DataError>(
                  "candidates.fault is " + std::to_string(kLastFinding + 1) +
                  ", accepted are 1 to " + std::to_string(kLastFault) +
                  " and 201 to " + std::to_string(kLastFinding)));
  event.candidates.resize(kMaxFaults + 1, {1, 0.9, 0.5, true});
  EXPECT_THAT([&] { Codec<FaultEvent>::Encode(event, wire); },
              ThrowsMessage<DataError>(
                  "candidates has 65 entries, accepted are 0 to 64"));
  event.candidates.clear();
  event.model_version = -1;
  EXPECT_THAT([&] { Codec<FaultEvent>::Encode(event, wire); },
              ThrowsMessage<DataError>(HasSubstr("model_version is -1")));
}

// The last fault of the catalogue is one; what comes behind it is none.
TEST(CodecTest, FaultsBeyondTheCatalogueAreNotDecoded) {
  FaultEvent event;
  event.valve_id = "V";
  event.candidates = {{kLastFinding, 0.9, 0.5, true}};
  v1::FaultEvent wire;
  Codec<FaultEvent>::Encode(event, wire);
  ASSERT_TRUE(Codec<FaultEvent>::Decode(wire, event));

  for (const int fault :
       {0, kLastFault + 1, kFirstFinding - 1, kLastFinding + 1}) {
    wire.candidates()[0].fault(static_cast<std::uint8_t>(fault));
    EXPECT_FALSE(Codec<FaultEvent>::Decode(wire, event)) << fault;
  }
}

TEST(CodecTest, EnumeratorsNobodyDefinedAreNotDecoded) {
  v1::ValveSample wire;
  Codec<ValveSampleMessage>::Encode(SomeSample(), wire);
  ValveSampleMessage message;
  ASSERT_TRUE(Codec<ValveSampleMessage>::Decode(wire, message));

  v1::ValveSample wrong = wire;
  wrong.quality()[9] = static_cast<v1::SignalQuality>(3);
  EXPECT_FALSE(Codec<ValveSampleMessage>::Decode(wrong, message));
  wrong = wire;
  wrong.mode(static_cast<v1::ValveMode>(5));
  EXPECT_FALSE(Codec<ValveSampleMessage>::Decode(wrong, message));
  wrong = wire;
  wrong.flow_unit(static_cast<v1::FlowUnit>(2));
  EXPECT_FALSE(Codec<ValveSampleMessage>::Decode(wrong, message));
  wrong = wire;
  wrong.present(1U << kModelSignalCount);
  EXPECT_FALSE(Codec<ValveSampleMessage>::Decode(wrong, message));
}

// The difference of two stamps, less a period, must be an int64.
TEST(CodecTest, StampsBeyondTheYears1900To2100AreRefused) {
  for (const std::int64_t stamp_ns :
       {kMinStampNs, kMinStampNs - 1, kMaxStampNs, kMaxStampNs + 1,
        std::numeric_limits<std::int64_t>::min(),
        std::numeric_limits<std::int64_t>::max()}) {
    const bool fits = stamp_ns == kMinStampNs || stamp_ns == kMaxStampNs;
    ValveSampleMessage message = SomeSample();
    v1::ValveSample wire;
    Codec<ValveSampleMessage>::Encode(message, wire);
    wire.stamp_ns(stamp_ns);
    EXPECT_EQ(Codec<ValveSampleMessage>::Decode(wire, message), fits);
    message.sample.stamp_ns = stamp_ns;
    if (!fits) {
      EXPECT_THROW(Codec<ValveSampleMessage>::Encode(message, wire), DataError);
    }
  }
}

TEST(CodecTest, ArraysBeyondTheirBoundAreNotDecoded) {
  v1::DecisionVector wire;
  Codec<DecisionMessage>::Encode(FullDecision(), wire);
  DecisionMessage message;
  ASSERT_TRUE(Codec<DecisionMessage>::Decode(wire, message));

  wire.residuals().push_back(0.0);
  EXPECT_FALSE(Codec<DecisionMessage>::Decode(wire, message));
}

TEST(CodecTest, BytesThatAreNoMessageAreCountedNotThrown) {
  CheckedType<v1::DecisionVectorPubSubType> type;
  v1::DecisionVector wire;

  EXPECT_FALSE(Deserialize(type, std::string(32, '\xFF'), &wire));
  EXPECT_EQ(type.refused(), 1U);
}

// Into an object that holds an earlier message.
TEST(CodecTest, AMessageThatIsCutAnywhereIsRefused) {
  const auto expect_refused = [](auto& type, auto wire) {
    const std::string bytes = Serialized(type, &wire);
    ASSERT_TRUE(Deserialize(type, bytes, &wire));
    for (std::size_t length = 0; length < bytes.size(); ++length) {
      EXPECT_FALSE(Deserialize(type, bytes.substr(0, length), &wire))
          << length << " of " << bytes.size();
    }
  };
  v1::ValveSample sample;
  Codec<ValveSampleMessage>::Encode(SomeSample(), sample);
  CheckedType<v1::ValveSamplePubSubType> samples;
  expect_refused(samples, sample);
  v2::ValveSample second;
  Codec<ValveSampleMessage, 2>::Encode(SampleWithPv(), second);
  CheckedType<v2::ValveSamplePubSubType> seconds;
  expect_refused(seconds, second);
  v1::DecisionVector decision;
  Codec<DecisionMessage>::Encode(FullDecision(), decision);
  CheckedType<v1::DecisionVectorPubSubType> decisions;
  expect_refused(decisions, decision);
  DecisionMessage small;
  small.valve_id = "V";
  Codec<DecisionMessage>::Encode(small, decision);
  expect_refused(decisions, decision);  // Ends with empty lists.
}

#if FDI_FAST_DDS != 2
TEST(CodecTest, WhatHasNoKeyHasAHandleAllTheSame) {
  CheckedType<v1::ValveSamplePubSubType> type;
  v1::ValveSample sample;
  Codec<ValveSampleMessage>::Encode(SomeSample(), sample);
  const std::string bytes = Serialized(type, &sample);
  const auto handle_of = [&](const std::string& message) {
    rtps::SerializedPayload_t payload(
        static_cast<std::uint32_t>(message.size() + 1));
    std::copy(message.begin(), message.end(), payload.data);
    payload.length = static_cast<std::uint32_t>(message.size());
    rtps::InstanceHandle_t handle;
    EXPECT_TRUE(type.compute_key(payload, handle, false));
    EXPECT_TRUE(handle.isDefined());
    return handle;
  };
  EXPECT_EQ(handle_of(bytes), HandleOf(type, &sample));
  // Encapsulation, length, key and its NUL; padded, as an end is.
  const std::size_t key = 8 + sample.valve_id().size() + 1;
  EXPECT_EQ(handle_of(bytes.substr(0, key + 1)), HandleOf(type, &sample));
  EXPECT_NE(handle_of(bytes.substr(0, key - 3)), HandleOf(type, &sample));
  handle_of("");
  EXPECT_EQ(type.refused(), 0U);  // Counted when it is taken.
}
#endif

// The number behind the name is aligned, and the gap is part of the sum.
TEST(CodecTest, AKeyDoesNotHangOnTheKeyBefore) {
  CheckedType<v1::ModelSetInfoPubSubType> type;
  const auto handle_of = [&](const std::string& name) {
    v1::ModelSetInfo set;
    set.model_set(name);
    return HandleOf(type, &set);
  };
  const rtps::InstanceHandle_t before = handle_of("PLANT");
  handle_of("a-longer-name");
  EXPECT_EQ(handle_of("PLANT"), before);
}

TEST(CodecTest, ThreadsThatShareATypeGetTheirOwnKeys) {
  CheckedType<v1::ValveSamplePubSubType> type;
  std::atomic<int> wrong{0};
  const auto compute = [&](const std::string& valve) {
    v1::ValveSample sample;
    sample.valve_id() = valve;
    v1::ValveSamplePubSubType alone;
    const rtps::InstanceHandle_t first = HandleOf(alone, &sample);
    for (int i = 0; i < 20000; ++i) {
      wrong += HandleOf(type, &sample) == first ? 0 : 1;
    }
  };
  {
    const std::jthread one(compute, "one");
    const std::jthread two(compute, "two");
  }

  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace fdi::idl
