// A bus with keys: who has one exchanges samples, who has none neither gets nor
// gives any.
#include <map>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <gtest/gtest.h>

#include "base/error.h"
#include "idl/library_log.h"
#include "idl/participant_impl.h"
#include "idl/security/keys.h"
#include "tests/idl/dds_fixture.h"
#include "tests/idl/signed_documents.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::idl {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::uint64_t kSamples = 200;
// A participant is found, or refused, well within it.
// To be found by a participant that would serve.
constexpr seconds kLongEnough{3};

class SecurityTest : public DeliveryTest {
 protected:
  SecurityTest() {
    MakeAuthority(Keys(), 10);
    MakeKey(Keys(), "monitor", Role::kMonitor, 10, false);
    MakeKey(Keys(), "gateway", Role::kGateway, 10, false);
    MakeKey(Keys(), "reader", Role::kReader, 10, false);
  }

  std::filesystem::path Keys() const { return directory_.path() / "keys"; }
  DdsOptions With(const std::string& key) const {
    DdsOptions options = domain_.Options();
    options.security = (Keys() / key).string();
    return options;
  }

  // Samples from `gateway` that reach `reader`; none if it finds no reader in
  // time.
  static std::uint64_t Exchanged(Participant& gateway, Participant& reader,
                                 seconds patience = kPatience) {
    Subscriber<ValveSampleMessage> subscriber(reader, Profile::kLossless);
    Publisher<ValveSampleMessage> publisher(gateway, {Profile::kLossless});
    if (!publisher.WaitForReaders(1, patience)) {
      return 0;
    }
    for (std::uint64_t k = 0; k < kSamples; ++k) {
      publisher.Write(SampleOf("FV-101", k));
    }
    OrderCheck check;
    TakeUntil(subscriber, check.AsHandlers(),
              [&] { return check.count >= kSamples; });
    EXPECT_EQ(check.out_of_order, 0U);
    return check.count;
  }

  storage::TemporaryDirectory directory_;
};

TEST_F(SecurityTest, WhoHasAKeyIsServed) {
  Participant gateway(With("gateway"));
  Participant monitor(With("monitor"), log_.Sink());
  EXPECT_EQ(Exchanged(gateway, monitor), kSamples);
  Participant reader(With("reader"));
  EXPECT_EQ(Exchanged(gateway, reader), kSamples);
  EXPECT_EQ(monitor.refused_participants(), 0U);
  EXPECT_TRUE(log_.WaitFor("security_key_expires name=monitor days=9"));
}

// Keys of earlier versions permit version 1 alone.
TEST_F(SecurityTest, AKeyWithoutTheRightToPvsServesWithoutThem) {
  for (const std::string key : {"gateway", "monitor"}) {
    SignAgain(Keys() / key / "permissions.p7s", Keys() / "ca.pem",
              Keys() / "ca.key", [](std::string text) {
                const std::string topic = "<topic>fdi/v2/ValveSample</topic>";
                return text.erase(text.find(topic), topic.size());
              });
  }
  MakeKey(Keys(), "new", Role::kMonitor, 10, false);
  const std::uint64_t before = RefusedPermissions();
  Participant monitor(With("monitor"), log_.Sink());
  Participant gateway(With("gateway"), log_.Sink());
  Participant other(With("new"));
  Subscriber<ValveSampleMessage> old(monitor, Profile::kLossless);
  Subscriber<ValveSampleMessage> fresh(other, Profile::kLossless);
  Publisher<ValveSampleMessage> publisher(gateway, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(2, kPatience));
  EXPECT_TRUE(log_.WaitFor("security_key_without_pv name=monitor"));
  EXPECT_TRUE(log_.WaitFor("security_key_without_pv name=gateway"));
  EXPECT_EQ(RefusedPermissions() - before, 2U);

  ValveSampleMessage message = SampleOf("FV-101", 0);
  message.sample.Set(Signal::kX, 40.0);
  message.sample.Set(Signal::kSp, 3.2);
  message.sample.Set(Signal::kPv, 3.1);
  ASSERT_EQ(publisher.Write(message), WriteResult::kSent);
  for (Subscriber<ValveSampleMessage>* each : {&old, &fresh}) {
    SignalMask present = 0;
    TakeUntil<ValveSampleMessage>(
        *each,
        {[&](const ValveSampleMessage& got, const Reception&) {
           present = got.sample.present;
         },
         {}},
        [&] { return present != 0; });
    EXPECT_EQ(present, MaskOf(Signal::kX));
  }
}

// The gateway's key is new, that of the monitor is not.
TEST_F(SecurityTest, AMonitorThatReadsNoPvsGetsSamplesWithoutThem) {
  SignAgain(Keys() / "monitor" / "permissions.p7s", Keys() / "ca.pem",
            Keys() / "ca.key", [](std::string text) {
              const std::string topic = "<topic>fdi/v2/ValveSample</topic>";
              return text.erase(text.find(topic), topic.size());
            });
  Participant monitor(With("monitor"));
  Participant gateway(With("gateway"), log_.Sink());
  Subscriber<ValveSampleMessage> subscriber(monitor, Profile::kLossless);
  Publisher<ValveSampleMessage> publisher(gateway, {Profile::kLossless});
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));
  ValveSampleMessage message = SampleOf("FV-101", 0);
  message.sample.Set(Signal::kPv, 3.1);
  for (; message.sample.seq < 3; ++message.sample.seq) {
    ASSERT_EQ(publisher.Write(message), WriteResult::kSent);
  }
  OrderCheck check;
  TakeUntil(subscriber, check.AsHandlers(), [&] { return check.count == 3; });
  EXPECT_EQ(check.out_of_order, 0U);
  EXPECT_TRUE(log_.WaitFor("pv_unread topic=fdi/v2/ValveSample"));
}

TEST_F(SecurityTest, WhoHasNoKeyNeitherGetsNorGivesASample) {
  Participant monitor(With("monitor"), log_.Sink());
  Participant gateway(With("gateway"));
  Participant stranger(domain_.Options());
  EXPECT_EQ(Exchanged(stranger, monitor, kLongEnough), 0U);
  EXPECT_EQ(Exchanged(gateway, stranger, kLongEnough), 0U);
  EXPECT_EQ(monitor.refused_participants(), 1U);
  EXPECT_TRUE(log_.WaitFor("participant_refused"));
  EXPECT_EQ(Exchanged(gateway, monitor), kSamples);
}

TEST_F(SecurityTest, AKeyOfAnotherAuthorityIsNone) {
  const std::filesystem::path others = directory_.path() / "others";
  MakeAuthority(others, 10);
  MakeKey(others, "gateway", Role::kGateway, 10, false);
  DdsOptions options = domain_.Options();
  options.security = (others / "gateway").string();
  Participant monitor(With("monitor"), log_.Sink());
  Participant stranger(options);
  EXPECT_EQ(Exchanged(stranger, monitor, kLongEnough), 0U);
  EXPECT_GE(monitor.refused_participants(), 1U);
}

TEST_F(SecurityTest, ARoleGivesItsTopicsAndNoOthers) {
  Participant reader(With("reader"));
  EXPECT_THROW(Publisher<ValveSampleMessage>{reader}, TransportError);
  Participant gateway(With("gateway"));
  EXPECT_THROW(Publisher<FaultEvent>{gateway}, TransportError);
  EXPECT_THROW(Subscriber<ValveSampleMessage>{gateway}, TransportError);
  Participant monitor(With("monitor"));
  EXPECT_THROW(Publisher<ValveSampleMessage>{monitor}, TransportError);
  const Publisher<FaultEvent> events(monitor);
  const Subscriber<FaultEvent> read(reader);
  EXPECT_TRUE(events.WaitForReaders(1, kPatience));
}

TEST_F(SecurityTest, AGatewayPublishesInItsPartitionAlone) {
  MakeKey(Keys(), "hall-1", Role::kGateway, 10, false, "hall-1");
  Participant gateway(With("hall-1"));
  for (const auto& partitions : std::vector<std::vector<std::string>>{
           {}, {""}, {"hall-2"}, {"hall-1", "hall-2"}, {"*"}, {"hall-?"}}) {
    EXPECT_THROW((Publisher<ValveSampleMessage>{
                     gateway, {Profile::kLive, 0, partitions}}),
                 TransportError)
        << (partitions.empty() ? "none" : partitions.front());
  }
  Participant monitor(With("monitor"));
  Subscriber<ValveSampleMessage> subscriber(monitor, Profile::kLive,
                                            Overflow::kLibrary, {"hall-*"});
  const Publisher<ValveSampleMessage> publisher(
      gateway, {Profile::kLive, 0, {"hall-1"}});
  EXPECT_TRUE(publisher.WaitForReaders(1, kPatience));
}

// The library checks the domain of a grant only on the other side, so this is
// what a program of one's own would do with any key.
TEST_F(SecurityTest, EndpointsWithoutTheRightAreRefusedAndCounted) {
  const auto grant_elsewhere = [&](const std::string& key) {
    const std::string in = "<allow_rule>";
    SignAgain(Keys() / key / "permissions.p7s", Keys() / "ca.pem",
              Keys() / "ca.key", [&](std::string text) {
                const std::size_t at = text.find(in);
                const std::size_t end = text.find("</domains>", at) + 10;
                std::string all = text.substr(at, end - at) + "</allow_rule>";
                text.replace(text.find("<min>0", at), 6, "<min>232");
                return text.insert(at, all);
              });
  };
  grant_elsewhere("gateway");
  grant_elsewhere("reader");
  const std::uint64_t before = RefusedPermissions();
  Participant monitor(With("monitor"), log_.Sink());
  const Subscriber<ValveSampleMessage> samples(monitor);
  const Publisher<FaultEvent> events(monitor);

  Participant gateway(With("gateway"), log_.Sink());
  const Publisher<ValveSampleMessage> forged(gateway);
  EXPECT_TRUE(log_.WaitFor("permission_refused of=writer guid="));
  EXPECT_TRUE(log_.WaitFor(
      "reason=\"fdi/v1/ValveSample topic not found in allow rule.\""));
  Participant reader(With("reader"), log_.Sink());
  const Subscriber<FaultEvent> read(reader);
  EXPECT_TRUE(log_.WaitFor("permission_refused of=reader guid="));
  // The writers of both versions of the samples, and the reader.
  EXPECT_EQ(RefusedPermissions() - before, 3U);
  EXPECT_EQ(samples.status().matched, 0);
  EXPECT_EQ(events.matched(), 0);
}

// Its certificate is of our authority, its rights of another one.
TEST_F(SecurityTest, RightsOfAnotherAuthorityAreRefusedAndCounted) {
  const std::filesystem::path others = directory_.path() / "others";
  MakeAuthority(others, 10);
  MakeKey(others, "gateway", Role::kMonitor, 10, false);
  const std::uint64_t before = RefusedPermissions();
  Participant monitor(With("monitor"), log_.Sink());
  dds::DomainParticipantQos qos = monitor.impl()->get_qos();
  const std::string rights = "file://" + (others / "gateway").string() + "/";
  for (auto& property : qos.properties().properties()) {
    const std::string& name = property.name();
    std::string& value = property.value();
    if (name.find("Access-Permissions.") != std::string::npos) {
      value = rights + value.substr(value.rfind('/') + 1);
    } else if (name.find("PKI-DH.") != std::string::npos) {
      value = "file://" + (Keys() / "gateway").string() + "/" +
              value.substr(value.rfind('/') + 1);
    }
  }
  auto* const factory = dds::DomainParticipantFactory::get_instance();
  dds::DomainParticipant* const stranger =
      factory->create_participant(domain_.id(), qos);
  ASSERT_NE(stranger, nullptr);
  EXPECT_TRUE(log_.WaitFor("permission_refused of=participant guid="));
  EXPECT_EQ(factory->delete_participant(stranger), return_code::RETCODE_OK);
  EXPECT_GT(RefusedPermissions(), before);
}

TEST_F(SecurityTest, ABadKeyIsRefusedBeforeTheBusIsTouched) {
  std::filesystem::remove(Keys() / "monitor" / "cert.pem");
  EXPECT_THROW(Participant{With("monitor")}, ConfigError);
  EXPECT_THROW(Participant{With("nobody")}, ConfigError);
}

}  // namespace
}  // namespace fdi::idl
