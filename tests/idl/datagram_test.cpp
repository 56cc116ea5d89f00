#include "idl/datagram.h"

#include <algorithm>
#include <cstring>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "idl/participant_impl.h"
#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using Bytes = std::vector<std::uint8_t>;

// eProsima's header: the library looks for statistics in theirs only.
Bytes Header() {
  constexpr std::uint8_t kStart[] = {'R', 'T', 'P', 'S', 2, 2, 1, 15};
  Bytes bytes(20, 7);
  std::ranges::copy(kStart, bytes.begin());
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

CheckedDatagram Check(const Bytes& message) {
  WriterPace pace;
  return CheckDatagram(message, pace, {});
}

DatagramVerdict VerdictOn(const Bytes& message) {
  return Check(message).verdict;
}

// An end of two submessages: it is well formed, and aborts the library.
Bytes StatisticsInFront() {
  return With(With(Header(), 0x80, Zeros(56)), 0x01, Zeros(4));
}

// Cyclone DDS sends this when an instance ends: no data, and no hash of the
// key.
TEST(DatagramTest, ABareKeyIsDeclaredAsData) {
  constexpr std::uint8_t kEnd = 0x0b;    // Little endian, parameters, key.
  constexpr std::uint8_t kWhole = 0x07;  // The same with data.
  const Bytes status{0x71, 0, 4, 0, 0, 0, 0, 3, 1, 0, 0, 0};
  const Bytes hash = Bytes{0x70, 0, 16, 0} + Zeros(16);
  const Bytes key = Bytes{0, 1, 0, 0, 3, 0, 0, 0, 'V', '1', 0, 0};
  const auto keys_in = [&](const Bytes& body, std::uint8_t flags) {
    return Check(With(With(Header(), 0x01, Zeros(4)), 0x15, body, flags))
        .bare_keys;
  };
  const std::vector<std::size_t> found{29};
  EXPECT_EQ(keys_in(Data(16) + status + key, kEnd), found);
  EXPECT_TRUE(keys_in(Data(16) + hash + status + key, kEnd).empty());
  EXPECT_TRUE(keys_in(Data(16) + status + key, kWhole).empty());
  Bytes of_discovery = Data(16) + status + key;
  of_discovery[11] = 0xc2;
  EXPECT_TRUE(keys_in(of_discovery, kEnd).empty());

  Bytes datagram = With(Header(), 0x15, Data(16) + status + key, kEnd);
  const CheckedDatagram checked = Check(datagram);
  ASSERT_EQ(checked.verdict, DatagramVerdict::kSound);
  Amend(checked, datagram);
  EXPECT_EQ(datagram, With(Header(), 0x15, Data(16) + status + key, kWhole));
}

// The count of an acknowledgement from `reader`, as it is handed over.
std::uint8_t CountOf(AckCounts& acks, std::uint8_t reader, std::uint8_t count,
                     bool first_word, bool little_endian) {
  const Bytes number =
      little_endian ? Bytes{count, 0, 0, 0} : Bytes{0, 0, 0, count};
  const Bytes base = Sequence(little_endian ? 4 : 7, first_word ? 0 : 1);
  Bytes body = Bytes{0, 0, reader, 0xc7} + Bytes{0, 0, 3, 0xc2} + base +
               Zeros(4) + number;
  Bytes datagram = With(Header(), 0x06, body, little_endian ? 1 : 0);
  if (!little_endian) {
    std::swap(datagram[22], datagram[23]);
  }
  WriterPace pace;
  const CheckedDatagram checked = CheckDatagram(datagram, pace, {}, &acks);
  EXPECT_EQ(checked.verdict, DatagramVerdict::kSound);
  Amend(checked, datagram);
  return datagram[datagram.size() - (little_endian ? 4 : 1)];
}

TEST(DatagramTest, AReaderThatCountsAnewGoesOnWhereItWas) {
  for (const bool little_endian : {true, false}) {
    AckCounts acks;
    const auto count = [&](std::uint8_t number, bool first_word = false,
                           std::uint8_t reader = 4) {
      return CountOf(acks, reader, number, first_word, little_endian);
    };
    EXPECT_EQ(count(1, true), 1);
    EXPECT_EQ(count(70), 70);
    EXPECT_EQ(count(69), 69);       // Overtaken.
    EXPECT_EQ(count(1, true), 71);  // Its first word, once more.
    EXPECT_EQ(count(2, true), 72);
    EXPECT_EQ(count(9), 79);
    EXPECT_EQ(count(2, true, 5), 2);  // Another reader.
    EXPECT_EQ(count(90), 160);
    EXPECT_EQ(count(3), 163);  // The first word was lost.
  }
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
      Check(With(With(pad, 0x81, Zeros(4)), 0x80, Zeros(56)));
  EXPECT_EQ(checked.verdict, DatagramVerdict::kSound);
  EXPECT_EQ(checked.bytes, pad.size());
  EXPECT_EQ(VerdictOn(StatisticsInFront()), DatagramVerdict::kKind);
}

// As Fast DDS 2.9.1 sends them when a datagram is full.
TEST(DatagramTest, AVendorsSubmessageAtTheEndMayBeCut) {
  const Bytes pad = With(Header(), 0x01, Zeros(4));
  Bytes cut = With(pad, 0x80, Zeros(56));
  cut.resize(cut.size() - 4);
  const CheckedDatagram checked = Check(cut);
  EXPECT_EQ(checked.verdict, DatagramVerdict::kSound);
  EXPECT_EQ(checked.bytes, pad.size());
}

TEST(DatagramTest, SequenceNumbersAreThoseOfWriters) {
  EXPECT_EQ(VerdictOn(With(Header(), 0x07, Heartbeat(Sequence(4, 9)))),
            DatagramVerdict::kSound);
  EXPECT_EQ(VerdictOn(With(Header(), 0x07, Heartbeat(Sequence(3, 0x7f)))),
            DatagramVerdict::kContent);
  EXPECT_EQ(VerdictOn(With(Header(), 0x08, Gap(Sequence(4, 9)) + Zeros(4))),
            DatagramVerdict::kSound);
  EXPECT_EQ(VerdictOn(With(Header(), 0x08, Gap(Zeros(8)) + Zeros(4))),
            DatagramVerdict::kContent);
}

TEST(DatagramTest, NoWriterLeapsAhead) {
  WriterPace pace;
  Bytes source = Zeros(20);
  source.back() = 1;  // A byte of the prefix.
  const Bytes other = With(Header(), 0x0c, source);
  const Bytes first = Zeros(8) + Sequence(4, 1) + Sequence(4, 9) + Zeros(4);
  const Bytes ahead = Zeros(8) + Sequence(0, 1) + Sequence(0, 1) + Zeros(4);
  const Bytes gap = Zeros(8) + Sequence(4, 1) + Sequence(6, 1) + Zeros(8);
  const auto verdict = [&](const Bytes& message) {
    return CheckDatagram(message, pace, {}).verdict;
  };
  EXPECT_EQ(verdict(With(Header(), 0x07, first)), DatagramVerdict::kSound);
  EXPECT_EQ(verdict(With(Header(), 0x07, ahead)), DatagramVerdict::kPace);
  EXPECT_EQ(verdict(With(Header(), 0x08, gap)), DatagramVerdict::kPace);
  Bytes data = Data(16);
  data[12] = 1;
  EXPECT_EQ(verdict(With(Header(), 0x15, data)), DatagramVerdict::kPace);
  // Met for the first time, a writer may stand anywhere.
  EXPECT_EQ(verdict(With(other, 0x07, ahead)), DatagramVerdict::kSound);
  EXPECT_EQ(verdict(With(Header(), 0x07, first)), DatagramVerdict::kSound);
}

// A heartbeat that tells of two holes, of which the second is too wide, comes
// again and again; the reader may still be told of a part of it.
TEST(DatagramTest, WhatIsRefusedCostsNothing) {
  WriterPace pace;
  Bytes near = Zeros(8) + Sequence(4, 1) + Sequence(4, 1) + Zeros(8);
  near[21] = 0x20;  // 8193.
  const Bytes wide = Zeros(8) + Sequence(4, 2) + Sequence(6, 1) + Zeros(8);
  const Bytes both = With(With(Header(), 0x08, near), 0x08, wide);
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(CheckDatagram(both, pace, {}).verdict, DatagramVerdict::kPace);
  }
  EXPECT_EQ(CheckDatagram(With(Header(), 0x08, near), pace, {}).verdict,
            DatagramVerdict::kSound);
}

WriterGuid Writer(std::uint8_t participant, std::uint8_t kind) {
  return {participant, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, kind};
}

TEST(WriterPaceTest, AWriterIsAheadByWhatItCanHaveWritten) {
  using std::chrono::hours;
  using std::chrono::seconds;
  WriterPace pace;
  const WriterGuid writer = Writer(1, 3);
  constexpr std::int64_t kMillion = 1'000'000;
  WriterPace::Clock::time_point now{hours(1)};
  std::int64_t number = 5'000 * kMillion;
  EXPECT_TRUE(pace.Admit(writer, number, 0, now));
  EXPECT_TRUE(pace.Admit(writer, 1, 0, now)) << "sent again";
  EXPECT_TRUE(pace.Admit(writer, number += kMillion, 0, now));
  EXPECT_FALSE(pace.Admit(writer, number + kMillion, 0, now)) << "no time for";
  now += seconds(1);
  EXPECT_TRUE(pace.Admit(writer, number += kMillion, 0, now));
  now += hours(24);
  EXPECT_FALSE(pace.Admit(writer, number + 10'000 * kMillion, 0, now));
  EXPECT_TRUE(pace.Admit(writer, number += 8'000 * kMillion, 0, now));
  // The unused part of a day is no start for a leap.
  EXPECT_TRUE(pace.Admit(writer, number + 1, 0, now += hours(24)));
  EXPECT_FALSE(pace.Admit(writer, number + 2 * kMillion, 0, now));
}

TEST(WriterPaceTest, DiscoveryStartsAtOne) {
  WriterPace pace;
  EXPECT_FALSE(pace.Admit(Writer(1, 0xc2), 10'000'000, 0, {}));
  EXPECT_TRUE(pace.Admit(Writer(1, 0xc2), 7, 0, {}));
  EXPECT_TRUE(pace.Admit(Writer(1, 0x03), 10'000'000, 0, {}));
}

TEST(WriterPaceTest, WhatWasLeftOutCounts) {
  WriterPace pace;
  EXPECT_TRUE(pace.Admit(Writer(1, 3), 20'000, 10'000, {}));
  EXPECT_FALSE(pace.Admit(Writer(1, 3), 20'000, 10'000, {}));
  EXPECT_TRUE(pace.Admit(Writer(2, 3), 20'000, 10'000, {}));
  // A budget that is spent to the last bit admits nothing.
  EXPECT_TRUE(pace.Admit(Writer(3, 3), 20'000, kLargestGap, {}));
  EXPECT_FALSE(pace.Admit(Writer(3, 3), 20'000, 1, {}));
}

TEST(WriterPaceTest, AFloodOfStrangersDoesNotMakeItForget) {
  WriterPace pace;
  EXPECT_TRUE(pace.Admit(Writer(1, 3), 1, 0, {}));
  for (std::uint32_t i = 0; i < 60'000; ++i) {
    WriterGuid stranger = Writer(2, 3);
    std::memcpy(&stranger[4], &i, sizeof i);
    pace.Admit(stranger, 1, 0, {});
    if (i % 30'000 == 0) {
      EXPECT_TRUE(pace.Admit(Writer(1, 3), 1, 0, {}));
    }
  }
  EXPECT_FALSE(pace.Admit(Writer(1, 3), 10'000'000, 0, {}));
}

TEST(DatagramTest, FragmentsAreOfDiscoveryAndFitIntoMemory) {
  const auto verdict = [](std::uint8_t writer, std::uint8_t units) {
    Bytes data = Data(28);
    data[11] = writer;
    const Bytes fragment{1, 0, 0, 0, 1, 0, 64, 0, 0, 1, units, 0};
    return VerdictOn(With(Header(), 0x16, data + fragment + Zeros(64)));
  };
  EXPECT_EQ(verdict(0xc2, 0), DatagramVerdict::kSound);
  EXPECT_EQ(verdict(0xc2, 16), DatagramVerdict::kContent);
  EXPECT_EQ(verdict(0x02, 0), DatagramVerdict::kContent);
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

void SendTo(const char* address, int port, const Bytes& datagram) {
  const int socket = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const in_addr loopback{htonl(INADDR_LOOPBACK)};
  setsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &loopback, sizeof loopback);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  to.sin_addr.s_addr = inet_addr(address);
  EXPECT_EQ(sendto(socket, datagram.data(), datagram.size(), 0,
                   reinterpret_cast<const sockaddr*>(&to), sizeof to),
            static_cast<ssize_t>(datagram.size()));
  close(socket);
}

// The ports of discovery [OMG formal/2022-04-01, 9.6.1].
int PortOf(const TestDomain& domain) {
  return 7400 + 250 * domain.id();
}

// To all participants of the domain, as those that look for others do.
void SendTo(const TestDomain& domain, const Bytes& datagram) {
  SendTo("239.255.0.1", PortOf(domain), datagram);
}

// To each of the participants that a process may have had, alone.
void SendToEach(const TestDomain& domain, const Bytes& datagram) {
  for (int number = 0; number < 20; ++number) {
    SendTo("127.0.0.1", PortOf(domain) + 10 + 2 * number, datagram);
  }
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

  SendTo(domain, StatisticsInFront());
  SendTo(domain, StatisticsInFront());
  SendTo(domain, Zeros(100));

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

// Without the check a thread of the library counts, and this test does not end.
TEST(DatagramTest, ParticipantOutlivesALeapInTheNameOfAPeer) {
  const TestDomain domain;
  Participant participant(domain.Options());
  Participant peer(domain.Options());
  Subscriber<ValveSampleMessage> subscriber(participant);
  Publisher<ValveSampleMessage> publisher(peer);
  ASSERT_TRUE(publisher.WaitForReaders(1, kPatience));
  // A writer that was not heard before is believed.
  ASSERT_TRUE(subscriber.WaitForWriters(1, kPatience));

  const auto& prefix = peer.impl()->guid().guidPrefix.value;
  Bytes message = Header();
  std::copy(std::begin(prefix), std::end(prefix), message.begin() + 8);
  // The writer of its endpoints says that what it still has begins at 2^39, for
  // the two hundredth time.
  const Bytes reader{0, 0, 3, 0xc7};
  const Bytes writer{0, 0, 3, 0xc2};
  SendToEach(domain, With(message, 0x07,
                          reader + writer + Sequence(0, 0x80) +
                              Sequence(0, 0x80) + Bytes{200, 0, 0, 0}));
  const auto refused = [&] {
    return participant
        .datagrams()[static_cast<std::size_t>(DatagramVerdict::kPace)];
  };
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (refused() == 0 && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_EQ(refused(), 1);
}

}  // namespace
}  // namespace fdi::idl
