// Messages that publishers of other vendors may send.
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <gtest/gtest.h>

#include "idl/codec.h"
#include "idl/participant_impl.h"
#include "idl/qos.h"
#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

// The type of a publisher that was built from another IDL: one field less, and
// so fewer bytes, under the same name or one of its own.
class OtherVersion : public v1::ValveSamplePubSubType {
 public:
#if FDI_FAST_DDS == 2
  explicit OtherVersion(const char* name) {
    setName(name);
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const bool done = v1::ValveSamplePubSubType::serialize(data, payload);
    payload->length -= 4;  // epoch
    return done;
  }
#else
  explicit OtherVersion(const char* name) {
    set_name(name);
  }
  bool serialize(const void* data, rtps::SerializedPayload_t& payload,
                 dds::DataRepresentationId_t representation) override {
    const bool done =
        v1::ValveSamplePubSubType::serialize(data, payload, representation);
    payload.length -= 4;  // epoch
    return done;
  }
#endif
};

// A publisher that uses the library as it is.
class ForeignPublisher {
 public:
  explicit ForeignPublisher(
      const DdsOptions& options,
      dds::TopicDataType* type = new v1::ValveSamplePubSubType())
      : participant_(options),
        publisher_(
            participant_.impl()->create_publisher(dds::PUBLISHER_QOS_DEFAULT)) {
    dds::Topic* topic = participant_.impl().TopicOf("fdi/v1/ValveSample",
                                                    dds::TypeSupport(type));
    writer_ = publisher_->create_datawriter(
        topic, QosFor<ValveSampleMessage>(Profile::kLossless, 10).writer);
  }
  ~ForeignPublisher() {
    publisher_->delete_datawriter(writer_);
    participant_.impl()->delete_publisher(publisher_);
  }
  ForeignPublisher(const ForeignPublisher&) = delete;
  ForeignPublisher& operator=(const ForeignPublisher&) = delete;

  bool Matched() const {
    dds::PublicationMatchedStatus status;
    writer_->get_publication_matched_status(status);
    return status.current_count > 0;
  }
  void Write(v1::ValveSample sample) { writer_->write(&sample); }

 private:
  Participant participant_;
  dds::Publisher* publisher_;
  dds::DataWriter* writer_{nullptr};
};

v1::ValveSample Valid(std::uint64_t seq) {
  v1::ValveSample sample;
  Codec<ValveSampleMessage>::Encode(SampleOf("v", seq), sample);
  return sample;
}

TEST(ForeignTest, WrongEnumeratorsAreCountedAndTheRestGoesOn) {
  const TestDomain domain;
  Participant participant(domain.Options());
  Subscriber<ValveSampleMessage> subscriber(participant);
  ForeignPublisher publisher(domain.Options());
  ASSERT_TRUE(TakeUntil<ValveSampleMessage>(
      subscriber, {}, [&] { return publisher.Matched(); }));

  v1::ValveSample wrong = Valid(1);
  wrong.mode(static_cast<v1::ValveMode>(77));
  v1::ValveSample nameless = Valid(2);
  nameless.valve_id() = "";
  publisher.Write(Valid(0));
  publisher.Write(wrong);
  publisher.Write(nameless);
  publisher.Write(Valid(3));
  std::vector<std::uint64_t> seen;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage& message, const Reception&) {
        seen.push_back(message.sample.seq);
      },
      nullptr};
  TakeUntil(subscriber, handlers, [&] { return seen.size() == 2; });

  EXPECT_EQ(seen, (std::vector<std::uint64_t>{0, 3}));
  EXPECT_EQ(subscriber.status().undecodable, 2U);
  EXPECT_EQ(subscriber.status().received, 2U);
}

TEST(ForeignTest, BytesOfAnotherVersionOfTheTypeAreCountedAndTheRestGoesOn) {
  const TestDomain domain;
  Participant participant(domain.Options());
  Subscriber<ValveSampleMessage> subscriber(participant);
  ForeignPublisher other(domain.Options(),
                         new OtherVersion("fdi::v1::ValveSample"));
  ForeignPublisher ours(domain.Options());
  ASSERT_TRUE(TakeUntil<ValveSampleMessage>(
      subscriber, {}, [&] { return other.Matched() && ours.Matched(); }));

  for (std::uint64_t seq = 0; seq < 20; ++seq) {
    other.Write(Valid(seq));
    ours.Write(Valid(seq));
  }
  std::vector<std::uint64_t> seen;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage& message, const Reception&) {
        seen.push_back(message.sample.seq);
      },
      nullptr};
  ASSERT_TRUE(TakeUntil(subscriber, handlers,
                        [&] {
                          return seen.size() >= 20 &&
                                 subscriber.status().undecodable >= 20;
                        }))
      << seen.size() << " " << subscriber.status().undecodable;

  EXPECT_EQ(seen.size(), 20U);
  EXPECT_EQ(subscriber.status().undecodable, 20U);
  EXPECT_EQ(subscriber.status().lost, 0U);
}

TEST(ForeignTest, ATypeOfAnotherNameIsNotMatched) {
  const TestDomain domain;
  Participant participant(domain.Options());
  Subscriber<ValveSampleMessage> subscriber(participant);
  ForeignPublisher other(domain.Options(),
                         new OtherVersion("fdi::v2::ValveSample"));
  ForeignPublisher ours(domain.Options());  // Found later than the other.
  ASSERT_TRUE(TakeUntil<ValveSampleMessage>(subscriber, {}, [&] {
    return ours.Matched() && subscriber.status().matched > 0;
  }));

  EXPECT_FALSE(other.Matched());
  EXPECT_EQ(subscriber.status().matched, 1);
}

}  // namespace
}  // namespace fdi::idl
