// Sparkplug B: births, aliases and deaths of nodes in; valves as devices out.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/time_units.h"
#include "gateway/sparkplug_node.h"
#include "gateway/sparkplug_source.h"

namespace fdi::gateway {
namespace {

using sparkplug::Payload;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;
using Clock = SparkplugHost::Clock;

constexpr std::uint64_t kStampMs = 1'767'607'200'000;
constexpr std::int64_t kStampNs = 1'767'607'200 * kNsPerSecond;

Payload Sent(std::optional<std::uint64_t> seq = {}) {
  Payload payload;
  payload.set_stamp(kStampMs);
  if (seq) {
    payload.set_seq(*seq);
  }
  return payload;
}

sparkplug::Metric& Add(Payload& payload, const std::string& name,
                       std::uint64_t alias, sparkplug::DataType type) {
  sparkplug::Metric& metric = *payload.add_metrics();
  if (!name.empty()) {
    metric.set_name(name);
  }
  if (alias > 0) {
    metric.set_alias(alias);
  }
  metric.set_type(type);
  return metric;
}

Payload NodeBirth(std::uint64_t bd_seq, std::uint64_t seq = 0) {
  Payload payload = Sent(seq);
  Add(payload, "bdSeq", 0, sparkplug::INT64).set_long_value(bd_seq);
  Add(payload, "Node Control/Rebirth", 0, sparkplug::BOOLEAN)
      .set_bool_value(false);
  return payload;
}

Payload NodeDeath(std::uint64_t bd_seq) {
  Payload payload = Sent();
  Add(payload, "bdSeq", 0, sparkplug::INT64).set_long_value(bd_seq);
  return payload;
}

Payload DeviceBirth(std::uint64_t seq, double value = 40.0) {
  Payload payload = Sent(seq);
  Add(payload, "FV1.OP", 7, sparkplug::DOUBLE).set_double_value(value);
  return payload;
}

Payload Data(std::uint64_t seq, std::uint64_t alias, double value) {
  Payload payload = Sent(seq);
  payload.add_metrics()->set_alias(alias);
  payload.mutable_metrics(0)->set_double_value(value);
  return payload;
}

class SparkplugHostTest : public ::testing::Test {
 protected:
  SparkplugHostTest() { host_.Use({"FV1.OP", "FV1.MODE"}); }
  void Take(const std::string& rest, const Payload& payload) {
    TakeBytes(rest, payload.SerializeAsString());
  }
  void TakeBytes(const std::string& rest, const std::string& bytes,
                 bool retained = false) {
    host_.Take(
        {MqttEvent::Kind::kMessage, "spBv1.0/G/" + rest, bytes, retained}, now_,
        handlers_);
  }
  // Node N with device D, which has FV1.OP as alias 7.
  void Bear() {
    Take("NBIRTH/N", NodeBirth(3));
    Take("DBIRTH/N/D", DeviceBirth(1));
    readings_.clear();
  }
  importer::TagReading Only() {
    EXPECT_EQ(readings_.size(), 1U) << ::testing::PrintToString(wrong_);
    return readings_.empty() ? importer::TagReading() : readings_.front();
  }

  Clock::time_point now_{Clock::now()};
  std::vector<importer::TagReading> readings_;
  std::vector<std::string> ended_;
  std::vector<std::pair<std::string, std::int64_t>> alive_;
  std::vector<std::string> wrong_;
  std::vector<Outgoing> commands_;
  ReadingHandlers handlers_{
      [this](const importer::TagReading& reading) {
        readings_.push_back(reading);
        tags_.emplace_back(reading.tag);  // A copy: the views do not last.
        words_.emplace_back(reading.word);
      },
      [this](std::string_view source, std::optional<std::int64_t> stamp) {
        alive_.emplace_back(source, stamp.value_or(0));
      },
      [this](std::string_view source) { ended_.emplace_back(source); },
      [this](std::string_view about, std::string_view why) {
        wrong_.push_back(std::string(about) + ": " + std::string(why));
      }};
  std::vector<std::string> tags_;
  std::vector<std::string> words_;
  SparkplugHost host_{"G", seconds(1), [this](const Outgoing& command) {
                        commands_.push_back(command);
                      }};
};

TEST_F(SparkplugHostTest, ABirthSaysWhatStandsAtItsTime) {
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = DeviceBirth(1);
  birth.mutable_metrics(0)->set_stamp(1000);  // Changed in 1970.
  Take("DBIRTH/N/D", birth);
  EXPECT_EQ(Only().value, 40.0);
  EXPECT_EQ(Only().stamp_ns, kStampNs);
  EXPECT_THAT(tags_, ElementsAre("FV1.OP"));
  EXPECT_THAT(wrong_, IsEmpty());
  EXPECT_THAT(commands_, IsEmpty());
}

TEST_F(SparkplugHostTest, DataHaveTheirAliasAndTheirOwnStamp) {
  Bear();
  Payload data = Data(2, 7, 41.5);
  data.mutable_metrics(0)->set_stamp(kStampMs + 250);
  Take("DDATA/N/D", data);
  EXPECT_EQ(Only().value, 41.5);
  EXPECT_EQ(Only().stamp_ns, kStampNs + 250'000'000);
  EXPECT_EQ(Only().quality, SignalQuality::kGood);
}

TEST_F(SparkplugHostTest, IntegersHaveTheirSignAndFloatsTheirWidth) {
  const auto value = [&](sparkplug::DataType type, const auto& set) {
    readings_.clear();
    Take("NBIRTH/N", NodeBirth(3));
    Payload birth = Sent(1);
    set(Add(birth, "FV1.OP", 7, type));
    Take("DBIRTH/N/D", birth);
    return Only().value;
  };
  using sparkplug::Metric;
  EXPECT_EQ(value(sparkplug::INT8, [](Metric& m) { m.set_int_value(0xFFU); }),
            -1.0);
  EXPECT_EQ(
      value(sparkplug::INT16, [](Metric& m) { m.set_int_value(0xFFFFFFFEU); }),
      -2.0);
  EXPECT_EQ(
      value(sparkplug::INT32, [](Metric& m) { m.set_int_value(0xFFFFFFFDU); }),
      -3.0);
  EXPECT_EQ(value(sparkplug::INT64, [](Metric& m) { m.set_long_value(~3ULL); }),
            -4.0);
  EXPECT_EQ(value(sparkplug::UINT16, [](Metric& m) { m.set_int_value(65535); }),
            65535.0);
  EXPECT_EQ(
      value(sparkplug::DOUBLE, [](Metric& m) { m.set_float_value(0.5F); }),
      0.5);
  EXPECT_EQ(
      value(sparkplug::BOOLEAN, [](Metric& m) { m.set_bool_value(true); }),
      1.0);
}

TEST_F(SparkplugHostTest, NullAndBadQualityAreNoReading) {
  Bear();
  Payload null = Data(2, 7, 1.0);
  null.mutable_metrics(0)->set_null(true);
  Take("DDATA/N/D", null);
  EXPECT_EQ(Only().quality, SignalQuality::kBad);
  readings_.clear();
  Payload stale = Data(3, 7, 1.0);
  auto& properties = *stale.mutable_metrics(0)->mutable_properties();
  properties.add_keys("Unit");
  properties.add_keys("Quality");
  properties.add_values();
  properties.add_values()->set_int_value(500);
  Take("DDATA/N/D", stale);
  EXPECT_EQ(Only().quality, SignalQuality::kBad);
  readings_.clear();
  properties.mutable_values(1)->set_int_value(192);
  stale.set_seq(4);
  Take("DDATA/N/D", stale);
  EXPECT_EQ(Only().quality, SignalQuality::kGood);
}

TEST_F(SparkplugHostTest, AWordIsThatOfAMode) {
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = Sent(1);
  Add(birth, "FV1.MODE", 0, sparkplug::STRING).set_string_value("MAN");
  Take("DBIRTH/N/D", birth);
  EXPECT_THAT(words_, ElementsAre("MAN"));
}

TEST_F(SparkplugHostTest, AWrongTypeIsSaidByTagAndTheOthersGoOn) {
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = Sent(1);
  Add(birth, "FV1.MODE", 1, sparkplug::DOUBLE).set_string_value("MAN");
  Add(birth, "FV1.OP", 7, sparkplug::DOUBLE).set_double_value(40.0);
  Take("DBIRTH/N/D", birth);
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("FV1.MODE: data type 10")));
  EXPECT_EQ(Only().value, 40.0);
}

TEST_F(SparkplugHostTest, HistoricalValuesAreNotOfNow) {
  Bear();
  Payload data = Data(2, 7, 1.0);
  data.mutable_metrics(0)->set_historical(true);
  Take("DDATA/N/D", data);
  EXPECT_THAT(readings_, IsEmpty());
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("FV1.OP: it is historical")));
}

TEST_F(SparkplugHostTest, AnAliasBeforeItsBirthAsksForOneOnce) {
  Take("DDATA/N/D", Data(9, 7, 1.0));
  Take("DDATA/N/D", Data(10, 7, 1.0));
  EXPECT_THAT(readings_, IsEmpty());
  EXPECT_THAT(wrong_.front(), HasSubstr("N: N/D: no NBIRTH has come"));
  ASSERT_EQ(commands_.size(), 1U);
  EXPECT_EQ(commands_.front().topic, "spBv1.0/G/NCMD/N");
  EXPECT_TRUE(SparkplugNode::AsksForBirth(commands_.front().payload));
  now_ += seconds(11);
  Take("DDATA/N/D", Data(11, 7, 1.0));
  EXPECT_EQ(commands_.size(), 2U);
}

TEST_F(SparkplugHostTest, ADeviceOrAnAliasThatIsNoneOfTheBirth) {
  Bear();
  Take("DDATA/N/D", Data(2, 8, 1.0));
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("N/D: alias 8 is none")));
  EXPECT_EQ(commands_.size(), 1U);
  Take("DDATA/N/E", Data(3, 8, 1.0));
  EXPECT_THAT(wrong_.back(), HasSubstr("N: N/E: no DBIRTH has come"));
}

TEST_F(SparkplugHostTest, AMetricWithoutATagIsSkipped) {
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = DeviceBirth(1);
  Add(birth, "other", 8, sparkplug::DOUBLE).set_double_value(1.0);
  Take("DBIRTH/N/D", birth);
  Take("DDATA/N/D", Data(2, 8, 2.0));
  Payload named = Sent(3);
  Add(named, "other", 0, sparkplug::DOUBLE).set_double_value(3.0);
  Take("DDATA/N/D", named);
  EXPECT_THAT(tags_, ElementsAre("FV1.OP"));
  EXPECT_THAT(wrong_, IsEmpty());
  named.set_seq(4);
  named.mutable_metrics(0)->set_name("FV1.MODE");
  Take("DDATA/N/D", named);
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("N/D: FV1.MODE is none")));
}

TEST_F(SparkplugHostTest, NeitherNameNorAliasIsNotAliasZero) {
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = DeviceBirth(1);
  birth.mutable_metrics(0)->set_alias(0);
  Take("DBIRTH/N/D", birth);
  readings_.clear();
  Payload data = Sent(2);
  data.add_metrics()->set_double_value(99.0);
  Take("DDATA/N/D", data);
  EXPECT_THAT(readings_, IsEmpty());
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("no name and no alias")));
  Take("DDATA/N/D", Data(3, 0, 5.0));
  EXPECT_EQ(Only().value, 5.0);
}

TEST_F(SparkplugHostTest, ABirthThatDoesNotComeIsAskedForAgain) {
  Bear();
  Take("DDATA/N/D", Data(3, 7, 1.0));
  now_ += seconds(5);
  host_.Beat(now_, handlers_);
  EXPECT_EQ(commands_.size(), 1U);
  now_ += seconds(6);
  host_.Beat(now_, handlers_);
  EXPECT_EQ(commands_.size(), 2U);
  Bear();
  now_ += seconds(11);
  host_.Beat(now_, handlers_);
  EXPECT_EQ(commands_.size(), 2U);
  Take("DDATA/N/D", Data(3, 7, 1.0));
  EXPECT_EQ(commands_.size(), 3U);
  Take("NDEATH/N", NodeDeath(3));  // Nobody is there to answer.
  now_ += seconds(11);
  host_.Beat(now_, handlers_);
  EXPECT_EQ(commands_.size(), 3U);
}

// An answer to an earlier question, or none, is not enough.
TEST_F(SparkplugHostTest, ANewTableOrConnectionAsksAtOnceAndUntilTheBirth) {
  Bear();
  Take("DDATA/N/D", Data(3, 7, 1.0));
  Bear();
  host_.Use({"FV1.OP", "FV1.P1"});
  host_.Greet(now_);
  EXPECT_EQ(commands_.size(), 2U);
  host_.Lose(handlers_);
  host_.Greet(now_);
  EXPECT_EQ(commands_.size(), 3U);
  now_ += seconds(11);
  host_.Beat(now_, handlers_);
  EXPECT_EQ(commands_.size(), 4U);
}

TEST_F(SparkplugHostTest, AfterAMissingMessageNothingCountsUntilABirth) {
  Bear();
  Take("DDATA/N/D", Data(3, 7, 1.0));
  EXPECT_THAT(wrong_, ElementsAre(AllOf(HasSubstr("seq 3 instead of 2"),
                                        HasSubstr("rebirth"))));
  EXPECT_EQ(commands_.size(), 1U);
  Take("DDATA/N/D", Data(4, 7, 1.0));
  EXPECT_THAT(readings_, IsEmpty());
  now_ += seconds(5);
  host_.Beat(now_, handlers_);
  EXPECT_THAT(alive_, IsEmpty());
  Take("NBIRTH/N", NodeBirth(3, 255));
  Take("DBIRTH/N/D", DeviceBirth(0));  // 255 is followed by 0.
  EXPECT_EQ(Only().value, 40.0);
}

TEST_F(SparkplugHostTest, ADeathEndsItsConnectionAndNoLaterOne) {
  Bear();
  Take("NDEATH/N", NodeDeath(2));
  EXPECT_THAT(ended_, IsEmpty());
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("not that of the birth, 3")));
  Take("NDEATH/N", NodeDeath(3));
  EXPECT_THAT(ended_, UnorderedElementsAre("N", "N/D"));
  now_ += seconds(5);
  host_.Beat(now_, handlers_);
  EXPECT_THAT(alive_, IsEmpty());
}

TEST_F(SparkplugHostTest, ADeviceDiesAlone) {
  Bear();
  Take("DBIRTH/N/E", DeviceBirth(2));
  Take("DDEATH/N/D", Sent(3));
  EXPECT_THAT(ended_, ElementsAre("N/D"));
}

TEST_F(SparkplugHostTest, WhatLivesIsUnchangedALittleBehindItsOwnClock) {
  Bear();
  now_ += seconds(60);
  host_.Beat(now_, handlers_);
  EXPECT_THAT(alive_,
              ElementsAre(std::pair("N/D", kStampNs + 59 * kNsPerSecond)));
  alive_.clear();
  host_.Beat(now_, handlers_);  // Not more often than it takes.
  EXPECT_THAT(alive_, IsEmpty());
  host_.Lose(handlers_);
  EXPECT_THAT(ended_, UnorderedElementsAre("N", "N/D"));
}

// A stamp of the year 584 million is one beyond what is accepted.
TEST_F(SparkplugHostTest, StampsOfAnySizeAreHandedOn) {
  Bear();
  Payload data = Data(2, 7, 1.0);
  data.mutable_metrics(0)->set_stamp(~0ULL);
  data.set_stamp(~0ULL);
  Take("DDATA/N/D", data);
  EXPECT_GT(Only().stamp_ns, kStampNs);
  now_ += seconds(60);
  host_.Beat(now_, handlers_);
}

TEST_F(SparkplugHostTest, TheLongestNameThatTheTableHasIsTheTag) {
  host_.Use({"N/D/OP", "D/X", "X"});
  Take("NBIRTH/N", NodeBirth(3));
  Payload birth = Sent(1);
  Add(birth, "OP", 1, sparkplug::DOUBLE).set_double_value(1.0);
  Add(birth, "X", 2, sparkplug::DOUBLE).set_double_value(2.0);
  Add(birth, "other", 3, sparkplug::DOUBLE).set_double_value(3.0);
  Take("DBIRTH/N/D", birth);
  EXPECT_THAT(tags_, ElementsAre("N/D/OP", "D/X"));
}

TEST_F(SparkplugHostTest, ATagOfTwoDevicesIsThatOfTheFirstWhileItLives) {
  Bear();
  Take("DBIRTH/N/E", DeviceBirth(2));
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("FV1.OP: N/D and N/E have it")));
  EXPECT_THAT(readings_, IsEmpty());
  Take("DDEATH/N/D", Sent(3));
  Take("DDATA/N/E", Data(4, 7, 5.0));
  EXPECT_EQ(Only().value, 5.0);
}

TEST_F(SparkplugHostTest, WhatIsNoMessageOfANodeChangesNothing) {
  Bear();
  TakeBytes("DDATA/N/D", "41.5");
  EXPECT_THAT(wrong_.back(), HasSubstr("no payload of Sparkplug B"));
  TakeBytes("DDATA/N/D", DeviceBirth(2).SerializeAsString(), true);
  EXPECT_THAT(wrong_.back(), HasSubstr("the broker had kept it"));
  TakeBytes("DDATA/N", "");
  TakeBytes("NBIRTH/", "");
  TakeBytes("DDATA/N/D/x", "");
  EXPECT_EQ(wrong_.size(), 5U);
  TakeBytes("NCMD/N", "");
  TakeBytes("", "");
  host_.Take({MqttEvent::Kind::kMessage, "spBv1.0/G", "", false}, now_,
             handlers_);
  EXPECT_EQ(wrong_.size(), 5U);
  Take("DDATA/N/" + std::string(1024, 'x'), Data(2, 7, 6.0));
  EXPECT_THAT(wrong_.back(), HasSubstr("no topic of Sparkplug B"));
  Take("DDATA/N/D", Data(2, 7, 6.0));
  EXPECT_EQ(Only().value, 6.0);
}

// Whatever a flipped bit makes of a birth, the next one counts.
TEST_F(SparkplugHostTest, BrokenPayloadsDoNoHarm) {
  const std::string birth = DeviceBirth(1).SerializeAsString();
  for (std::size_t bit = 0; bit < 8 * birth.size(); ++bit) {
    std::string broken = birth;
    broken[bit / 8] = static_cast<char>(broken[bit / 8] ^ (1 << bit % 8));
    Take("NBIRTH/N", NodeBirth(3));
    TakeBytes("DBIRTH/N/D", broken);
    TakeBytes("DDATA/N/D", broken.substr(0, bit / 8));
  }
  Bear();
  Take("DDATA/N/D", Data(2, 7, 6.0));
  EXPECT_EQ(Only().value, 6.0);
}

TEST_F(SparkplugHostTest, NamesThatSomebodyMakesUpEndNoNode) {
  Bear();
  for (int i = 0; i < 10'001; ++i) {
    Take("NDATA/ghost" + std::to_string(i), Sent(0));
  }
  Take("DDATA/N/D", Data(2, 7, 6.0));
  EXPECT_EQ(Only().value, 6.0);
}

TEST_F(SparkplugHostTest, MetricsThatSomebodyMakesUpEndNoNode) {
  Bear();
  Payload names = Sent(0);
  Payload aliases = Sent(0);
  for (std::uint64_t i = 0; i < 50'000; ++i) {
    names.add_metrics()->set_name("x" + std::to_string(i));
    aliases.add_metrics()->set_alias(i);
    aliases.add_metrics()->set_alias(50'000 + i);
  }
  for (int i = 0; i < 11; ++i) {  // A name without a tag is not kept.
    Take("NBIRTH/named" + std::to_string(i), names);
  }
  for (int i = 0; i < 5; ++i) {
    Take("NBIRTH/ghost" + std::to_string(i), aliases);
  }
  EXPECT_THAT(wrong_, ElementsAre(HasSubstr("ghost4: ghost4: the group has "
                                            "more than 500 000 metrics")));
  Take("NBIRTH/ghost0", aliases);  // In place of what it had.
  EXPECT_EQ(wrong_.size(), 1U);
  // Whatever ends makes room for another.
  for (int i = 0; i < 3; ++i) {
    const std::string name = "ghost" + std::to_string(i);
    Take("NDEATH/" + name, Sent());
    Take("NBIRTH/other", NodeBirth(3));
    aliases.set_seq(1);
    Take("DBIRTH/other/D", aliases);
    Take("DBIRTH/other/D", (aliases.set_seq(2), aliases));
    Take("DDEATH/other/D", Sent(3));
    Take("NBIRTH/" + name, (aliases.set_seq(0), aliases));
  }
  EXPECT_EQ(wrong_.size(), 1U);
  Take("DDATA/N/D", Data(2, 7, 6.0));
  EXPECT_EQ(Only().value, 6.0);
}

class SparkplugNodeTest : public ::testing::Test {
 protected:
  static Payload Read(const Outgoing& message) {
    Payload payload;
    EXPECT_TRUE(payload.ParseFromString(message.payload));
    return payload;
  }
  static std::vector<std::string> TopicsOf(
      const std::vector<Outgoing>& messages) {
    std::vector<std::string> topics;
    for (const Outgoing& message : messages) {
      EXPECT_FALSE(message.retained);
      EXPECT_EQ(message.qos, 0);
      topics.push_back(message.topic);
    }
    return topics;
  }
  std::vector<Outgoing> Tell(const std::string& json) {
    return node_.Tell({"fdi/north/FV%2F1/state", json, true});
  }
  SparkplugNode node_{"G", "north"};
  const std::string normal_ =
      R"({"valve_id":"FV/1","health":"NORMAL","reason":null,"state":"NORMAL",
          "fault":null,"description":null,"since_utc":null})";
};

TEST_F(SparkplugNodeTest, TheDeathIsThatOfTheBirthOfTheSameConnection) {
  const auto first = Read(node_.Will()).metrics(0).long_value();
  const Outgoing will = node_.Will();
  EXPECT_EQ(will.topic, "spBv1.0/G/NDEATH/north");
  EXPECT_EQ(will.qos, 1);
  EXPECT_FALSE(will.retained);
  const Payload birth = Read(node_.Birth());
  EXPECT_EQ(birth.seq(), 0U);
  EXPECT_EQ(birth.metrics(0).long_value(), (first + 1) % 256);
  EXPECT_EQ(Read(will).metrics(0).long_value(), (first + 1) % 256);
  EXPECT_EQ(Read(node_.Death()).metrics(0).long_value(), (first + 1) % 256);
}

TEST_F(SparkplugNodeTest, AValveIsBornThenOnlyChangesAreTold) {
  node_.Birth();
  const auto birth = Tell(normal_);
  EXPECT_THAT(TopicsOf(birth), ElementsAre("spBv1.0/G/DBIRTH/north/FV%2F1"));
  const Payload all = Read(birth.front());
  EXPECT_EQ(all.metrics_size(), 9);
  EXPECT_EQ(all.metrics(0).int_value(), 0U);
  EXPECT_TRUE(all.metrics(2).null());
  EXPECT_THAT(Tell(normal_), IsEmpty());
  const auto changed = Tell(
      R"({"valve_id":"FV/1","health":"FAILURE","reason":null,
          "state":"ISOLATED","fault":"f19","name":"Flow transmitter wrong",
          "description":"flow","certainty":"sure","strength_pct":25.5,
          "severity":"critical","priority":1,"since_utc":"2026-01-05T10:00:00Z",
          "check":"look"})");
  EXPECT_THAT(TopicsOf(changed), ElementsAre("spBv1.0/G/DDATA/north/FV%2F1"));
  const Payload data = Read(changed.front());
  ASSERT_EQ(data.metrics_size(), 9);
  EXPECT_EQ(data.seq(), 2U);
  EXPECT_EQ(data.metrics(0).int_value(), 1U);
  EXPECT_EQ(data.metrics(1).string_value(), "flow");
  EXPECT_EQ(data.metrics(5).double_value(), 25.5);
  EXPECT_EQ(data.metrics(6).int_value(), 1000U);
  EXPECT_EQ(data.metrics(7).long_value(), kStampMs);
}

TEST_F(SparkplugNodeTest, AValveThatNobodyTellsOfIsDeadAndNotNormal) {
  const std::string gone =
      R"({"valve_id":"FV/1","health":"CHECK_FUNCTION",
          "reason":"no monitor tells of it"})";
  node_.Birth();
  Tell(normal_);
  const auto end = Tell(gone);
  EXPECT_THAT(TopicsOf(end), ElementsAre("spBv1.0/G/DDATA/north/FV%2F1",
                                         "spBv1.0/G/DDEATH/north/FV%2F1"));
  EXPECT_EQ(Read(end.front()).metrics(0).int_value(), 2U);
  EXPECT_EQ(Read(end.front()).metrics(1).string_value(),
            "no monitor tells of it");
  EXPECT_THAT(Tell(gone), IsEmpty());
  EXPECT_THAT(TopicsOf(Tell(normal_)),
              ElementsAre("spBv1.0/G/DBIRTH/north/FV%2F1"));
  node_.Birth();
  EXPECT_THAT(TopicsOf(Tell(gone)),
              ElementsAre("spBv1.0/G/DBIRTH/north/FV%2F1",
                          "spBv1.0/G/DDEATH/north/FV%2F1"));
}

TEST_F(SparkplugNodeTest, SequenceNumbersGoRound) {
  node_.Birth();
  for (int i = 0; i < 255; ++i) {
    Tell(R"({"alive":true,"monitor":"host:)" + std::to_string(i) + "\"}");
  }
  const auto last = Tell(R"({"alive":true,"monitor":null})");
  EXPECT_THAT(TopicsOf(last), ElementsAre("spBv1.0/G/NDATA/north"));
  EXPECT_EQ(Read(last.front()).seq(), 0U);
  EXPECT_THAT(node_.Tell({"fdi/north/FV1/event", "{}", false}), IsEmpty());
}

TEST_F(SparkplugNodeTest, OnlyOneCommandIsFollowed) {
  EXPECT_FALSE(SparkplugNode::AsksForBirth("rebirth"));
  EXPECT_FALSE(SparkplugNode::AsksForBirth(node_.Birth().payload));
}

}  // namespace
}  // namespace fdi::gateway
