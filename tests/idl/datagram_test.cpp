#include "idl/datagram.h"

#include <cstring>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Of eProsima: the library looks for statistics in theirs only.
Bytes Header() {
  Bytes bytes{'R', 'T', 'P', 'S', 2, 2, 1, 15};
  bytes.resize(20, 7);
  return bytes;
}

// Little endian.
Bytes With(Bytes message, std::uint8_t kind, const Bytes& body,
           std::uint8_t flags = 1) {
  message.insert(message.end(),
                 {kind, flags, static_cast<std::uint8_t>(body.size()), 0});
  message.insert(message.end(), body.begin(), body.end());
  return message;
}

Bytes Zeros(std::size_t count) {
  return Bytes(count, 0);
}

// A sequence number with one byte set, of its eight as they are sent.
Bytes Sequence(std::size_t byte, std::uint8_t value) {
  Bytes bytes(8, 0);
  bytes[byte] = value;
  return bytes;
}

Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

Bytes Heartbeat(const Bytes& last) {
  return Zeros(8) + Sequence(4, 1) + last + Zeros(4);
}

Bytes Gap(const Bytes& base) {
  return Zeros(8) + Sequence(4, 1) + base + Zeros(4);
}

// extraFlags, the offset of the parameters, reader, writer, number 1.
Bytes Data(std::uint8_t offset) {
  return Bytes{0, 0, offset, 0} + Zeros(8) + Sequence(4, 1);
}

DatagramVerdict VerdictOn(const Bytes& message) {
  return CheckDatagram(message).verdict;
}

// An end of two submessages: it is well formed, and aborts the library.
Bytes StatisticsInFront() {
  return With(With(Header(), 0x80, Zeros(56)), 0x01, Zeros(4));
}

TEST(DatagramTest, HeaderIsOfRtps2) {
  EXPECT_EQ(VerdictOn({}), DatagramVerdict::kHeader);
  EXPECT_EQ(VerdictOn(Header()), DatagramVerdict::kSound);
  Bytes other = Header();
  other[4] = 3;
  EXPECT_EQ(VerdictOn(other), DatagramVerdict::kHeader);
  other = Header();
  other[3] = 'X';
  EXPECT_EQ(VerdictOn(other), DatagramVerdict::kHeader);
}

TEST(DatagramTest, SubmessagesFitIntoTheDatagram) {
  const Bytes whole = With(Header(), 0x0e, Zeros(12));
  EXPECT_EQ(VerdictOn(whole), DatagramVerdict::kSound);
  for (std::size_t size = 21; size < whole.size(); ++size) {
    EXPECT_EQ(VerdictOn(Bytes(whole.begin(), whole.begin() + size)),
              DatagramVerdict::kLength)
        << size;
  }
  EXPECT_EQ(VerdictOn(With(Header(), 0x0e, Zeros(8))),
            DatagramVerdict::kLength);
  EXPECT_EQ(VerdictOn(With(Header(), 0x07, Zeros(24))),
            DatagramVerdict::kLength);
}

TEST(DatagramTest, KindsAreThoseOfTheStandard) {
  EXPECT_EQ(VerdictOn(With(Header(), 0x02, Zeros(4))), DatagramVerdict::kKind);
  EXPECT_EQ(VerdictOn(With(Header(), 0x31, Zeros(4))), DatagramVerdict::kSound);
}

TEST(DatagramTest, VendorsSubmessagesAreCutOffAtTheEndAndRefusedElsewhere) {
  const Bytes pad = With(Header(), 0x01, Zeros(4));
  const CheckedDatagram checked =
      CheckDatagram(With(With(pad, 0x81, Zeros(4)), 0x80, Zeros(56)));
  EXPECT_EQ(checked.verdict, DatagramVerdict::kSound);
  EXPECT_EQ(checked.bytes, pad.size());
  EXPECT_EQ(VerdictOn(StatisticsInFront()), DatagramVerdict::kKind);
}

TEST(DatagramTest, SequenceNumbersAreThoseOfWriters) {
  EXPECT_EQ(VerdictOn(With(Header(), 0x07, Heartbeat(Sequence(4, 9)))),
            DatagramVerdict::kSound);
  EXPECT_EQ(VerdictOn(With(Header(), 0x07, Heartbeat(Sequence(3, 0x7f)))),
            DatagramVerdict::kContent);
  EXPECT_EQ(VerdictOn(With(Header(), 0x08, Gap(Sequence(7, 1)) + Zeros(4))),
            DatagramVerdict::kSound);
  EXPECT_EQ(VerdictOn(With(Header(), 0x08, Gap(Sequence(0, 2)) + Zeros(4))),
            DatagramVerdict::kContent);
  EXPECT_EQ(VerdictOn(With(Header(), 0x08, Gap(Zeros(8)) + Zeros(4))),
            DatagramVerdict::kContent);
}

TEST(DatagramTest, FragmentsAreOfSamplesThatFitIntoMemory) {
  const auto verdict = [](std::uint8_t units) {
    const Bytes fragment{1, 0, 0, 0, 1, 0, 64, 0, 0, 1, units, 0};
    return VerdictOn(With(Header(), 0x16, Data(28) + fragment + Zeros(64)));
  };
  EXPECT_EQ(verdict(0), DatagramVerdict::kSound);
  EXPECT_EQ(verdict(16), DatagramVerdict::kContent);
}

TEST(DatagramTest, ParametersAreInsideTheirSubmessage) {
  constexpr std::uint8_t kQos = 3;
  const Bytes next = Zeros(64);
  const auto verdict = [&](const Bytes& body) {
    return VerdictOn(With(With(Header(), 0x15, body, kQos), 0x01, next));
  };
  EXPECT_EQ(verdict(Data(16) + Bytes{0x70, 0, 4, 0, 1, 2, 3, 4, 1, 0, 0, 0}),
            DatagramVerdict::kSound);
  EXPECT_EQ(verdict(Data(16) + Bytes{0x70, 0, 32, 0}),
            DatagramVerdict::kContent);
  EXPECT_EQ(verdict(Data(16) + Bytes{0x70, 0, 0, 0}),
            DatagramVerdict::kContent);
  EXPECT_EQ(verdict(Data(60)), DatagramVerdict::kContent);
  EXPECT_EQ(verdict(Data(8) + Bytes{1, 0, 0, 0}), DatagramVerdict::kContent);
}

// To all participants of the domain, as those that look for others do.
void SendTo(int domain, const Bytes& datagram) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const in_addr loopback{htonl(INADDR_LOOPBACK)};
  setsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof loopback);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * domain));
  to.sin_addr.s_addr = inet_addr("239.255.0.1");
  EXPECT_EQ(sendto(socket, datagram.data(), datagram.size(), 0,
                   reinterpret_cast<const sockaddr*>(&to), sizeof to),
            static_cast<ssize_t>(datagram.size()));
  close(socket);
}

// Without the check this test ends by an abort of the library.
TEST(DatagramTest, ParticipantOutlivesWhatAbortsTheLibrary) {
  const TestDomain domain;
  LogCapture log;
  Participant participant(domain.Options(), log.Sink());
  Participant peer(domain.Options());
  Subscriber<ValveSampleMessage> subscriber(participant);
  Publisher<ValveSampleMessage> publisher(peer);
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));

  SendTo(domain.id(), StatisticsInFront());
  SendTo(domain.id(), StatisticsInFront());
  SendTo(domain.id(), Zeros(100));

  ASSERT_TRUE(log.WaitFor("datagram_refused reason=header bytes=100 from="));
  const DatagramCounts counts = participant.datagrams();
  EXPECT_EQ(counts[static_cast<std::size_t>(DatagramVerdict::kKind)], 2);
  EXPECT_EQ(counts[static_cast<std::size_t>(DatagramVerdict::kHeader)], 1);
  const std::string text = log.text();
  EXPECT_EQ(text.find("reason=kind"), text.rfind("reason=kind"));
  publisher.Write(SampleOf("V1", 1));
  bool received = false;
  EXPECT_TRUE(TakeUntil<ValveSampleMessage>(
      subscriber, {[&](const auto&, const auto&) { received = true; }, {}},
      [&] { return received; }));
}

}  // namespace
}  // namespace fdi::idl
