#include <cstdio>
#include <fstream>
#include <list>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using ::testing::HasSubstr;

class QosTest : public ::testing::Test {
 protected:
  ~QosTest() override { std::remove(path_.c_str()); }

  // Options with a file that makes the named writer best effort, and names the
  // peers. A process uses one file.
  DdsOptions WithFile() {
    std::ofstream(path_)
        << "<?xml version=\"1.0\"?>\n<profiles xmlns=\"http://"
           "www.eprosima.com/XMLSchemas/fastRTPS_Profiles\">"
           "<participant profile_name=\"fdi_participant\"><rtps><builtin>"
           "<initialPeersList><locator><udpv4><address>127.0.0.1</address>"
           "</udpv4></locator></initialPeersList></builtin></rtps>"
           "</participant><data_writer "
           "profile_name=\"fdi_valve_sample_writer\"><qos>"
           "<reliability><kind>BEST_EFFORT</kind></reliability></qos>"
           "</data_writer></profiles>";
    DdsOptions options = domain_.Options();
    options.qos_file = path_;
    return options;
  }

  const std::string path_ =
      ::testing::TempDir() + "fdi_qos_" + std::to_string(getpid()) + ".xml";
  const TestDomain domain_;
  LogCapture log_here_;
  LogCapture log_there_;
};

TEST_F(QosTest, IncompatibleQosIsLoggedWithBothSides) {
  Participant here(domain_.Options(), log_here_.Sink());
  Participant there(WithFile(), log_there_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  Publisher<ValveSampleMessage> publisher(there);

  EXPECT_TRUE(log_here_.WaitFor(
      "qos_incompatible topic=fdi/v1/ValveSample policy=RELIABILITY "
      "requested_here=RELIABLE offered_there=BEST_EFFORT"))
      << log_here_.text();
  EXPECT_TRUE(log_there_.WaitFor(
      "qos_incompatible topic=fdi/v1/ValveSample policy=RELIABILITY "
      "offered_here=BEST_EFFORT requested_there=RELIABLE"))
      << log_there_.text();
  EXPECT_TRUE(log_here_.WaitFor(
      "qos_incompatible topic=fdi/v2/ValveSample policy=RELIABILITY "));
  EXPECT_EQ(subscriber.status().incompatible, 1U);
  EXPECT_EQ(publisher.status().incompatible, 1U);
  EXPECT_EQ(subscriber.status().matched, 0);
}

TEST_F(QosTest, AFileWithoutAnElementIsRefused) {
  std::ofstream(path_) << "<?xml version=\"1.0\"?>\n<!-- nothing yet -->\n";
  DdsOptions options = domain_.Options();
  options.qos_file = path_;
  EXPECT_THROW(Participant(options, log_here_.Sink()), ConfigError);
}

// The library's default would be ten valves again.
TEST_F(QosTest, AFileAboutReliabilityLeavesTheLimitsAlone) {
  Participant here(domain_.Options(), log_here_.Sink());
  Participant there(WithFile(), log_there_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here, Profile::kBestEffort);
  Publisher<ValveSampleMessage> publisher(there);
  // Both ends have to know each other: what a best-effort writer sends before
  // its reader knows it is lost.
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));
  ASSERT_TRUE(subscriber.WaitForWriters(1, kPatience));

  int count = 0;
  const Handlers<ValveSampleMessage> handlers{
      [&](const ValveSampleMessage&, const Reception&) { ++count; }, nullptr};
  for (int i = 0; i < 50; ++i) {
    ASSERT_EQ(publisher.Write(SampleOf(ValveName(i), 0)), WriteResult::kSent);
  }
  TakeUntil(subscriber, handlers, [&] { return count == 50; });

  EXPECT_EQ(count, 50);
}

// Where peers are named, nobody announces itself by multicast. The library's
// default would call four participants of a host.
TEST_F(QosTest, PeersOfAFileAreCalledWhateverTheirNumber) {
  const DdsOptions options = WithFile();
  std::list<Participant> there;
  std::list<Subscriber<MonitorStatusMessage>> subscribers;
  for (int i = 0; i < 6; ++i) {
    subscribers.emplace_back(there.emplace_back(options));
  }
  Participant here(options);
  Publisher<MonitorStatusMessage> publisher(here);

  EXPECT_TRUE(publisher.WaitForReaders(6, kPatience)) << publisher.matched();
}

TEST_F(QosTest, TwoParticipantsMayUseTheSameFile) {
  const DdsOptions options = WithFile();
  Participant here(options);
  EXPECT_NO_THROW(Participant there(options));
}

TEST_F(QosTest, BestEffortIsAProfileOfBothEnds) {
  Participant here(domain_.Options(), log_here_.Sink());
  Participant there(domain_.Options(), log_there_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here, Profile::kBestEffort);
  Publisher<ValveSampleMessage> publisher(there, {Profile::kBestEffort});

  EXPECT_TRUE(publisher.WaitForReaders(1, kPatience));
}

// A process that hangs stays matched; what it owes is a status now and then.
TEST_F(QosTest, AMonitorThatFallsSilentIsNoticed) {
  Participant here(domain_.Options(), log_here_.Sink());
  Participant there(domain_.Options(), log_there_.Sink());
  Subscriber<MonitorStatusMessage> subscriber(here);
  Publisher<MonitorStatusMessage> publisher(there);
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  MonitorStatusMessage status;
  status.monitor = "m";
  // Again and again, as a monitor does: one message may come before the reader
  // knows its writer.
  ASSERT_TRUE(TakeUntil<MonitorStatusMessage>(subscriber, {}, [&] {
    publisher.Write(status);
    return subscriber.status().alive == 1;
  }));

  EXPECT_TRUE(TakeUntil<MonitorStatusMessage>(
      subscriber, {}, [&] { return subscriber.status().alive == 0; }));
  EXPECT_EQ(subscriber.status().matched, 1);
}

TEST_F(QosTest, APublisherThatEndsIsUnmatched) {
  Participant here(domain_.Options(), log_here_.Sink());
  Subscriber<ValveSampleMessage> subscriber(here);
  {
    Participant there(domain_.Options(), log_there_.Sink());
    Publisher<ValveSampleMessage> publisher(there);
    ASSERT_TRUE(subscriber.WaitForWriters(1, kPatience));
  }

  EXPECT_TRUE(TakeUntil<ValveSampleMessage>(
      subscriber, {}, [&] { return subscriber.status().matched == 0; }));
}

}  // namespace
}  // namespace fdi::idl
