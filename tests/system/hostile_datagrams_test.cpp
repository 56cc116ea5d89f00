// Datagrams that no participant sends, to all ports of the domain, against the
// built fdi-monitor. FDI_ATTACK_SECONDS=600 is the long form.

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <random>
#include <set>
#include <sstream>
#include <thread>

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include "idl/datagram.h"
#include "idl/writer_pace.h"
#include "tests/idl/rtps_messages.h"
#include "tests/system/attack.h"
#include "tests/system/honest_valve.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

using Clock = std::chrono::steady_clock;

/// A UDP socket, as the kernel sees it.
struct Socket {
  int port{0};
  bool multicast{false};
  std::uint64_t drops{0};  ///< For want of room.
};

std::set<std::string> OpenFiles(const std::string& process) {
  std::set<std::string> files;
  for (const auto& entry :
       std::filesystem::directory_iterator("/proc/" + process + "/fd")) {
    std::error_code gone;
    files.insert(std::filesystem::read_symlink(entry, gone).string());
  }
  return files;
}

/// Those of process `pid` without those that it has from us.
std::vector<Socket> UdpSockets(pid_t pid) {
  const std::set<std::string> theirs = OpenFiles(std::to_string(pid));
  const std::set<std::string> ours = OpenFiles("self");
  std::vector<Socket> sockets;
  std::ifstream table("/proc/net/udp");
  std::string line;
  for (std::getline(table, line); std::getline(table, line);) {
    std::istringstream words(line);
    const std::vector<std::string> word(
        (std::istream_iterator<std::string>(words)), {});
    const std::string inode = "socket:[" + word.at(9) + "]";
    if (theirs.contains(inode) && !ours.contains(inode)) {
      sockets.push_back({std::stoi(word.at(1).substr(9), nullptr, 16),
                         !word.at(1).starts_with("0100007F"),
                         std::stoull(word.at(12))});
    }
  }
  return sockets;
}

/// Hears the announcements of a domain, and sends what it likes to its ports.
class Wire {
 public:
  explicit Wire(int domain) : base_(7400 + 250 * domain) {
    const int yes = 1;
    setsockopt(in_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    const sockaddr_in port = Address("239.255.0.1", base_);
    EXPECT_EQ(bind(in_, reinterpret_cast<const sockaddr*>(&port), sizeof port),
              0);
    const ip_mreq group{port.sin_addr, {htonl(INADDR_LOOPBACK)}};
    EXPECT_EQ(
        setsockopt(in_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group),
        0);
    const timeval patience{2, 0};
    setsockopt(in_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    setsockopt(out_, IPPROTO_IP, IP_MULTICAST_IF, &group.imr_interface,
               sizeof group.imr_interface);
  }
  ~Wire() {
    close(in_);
    close(out_);
  }
  Wire(const Wire&) = delete;
  Wire& operator=(const Wire&) = delete;

  std::string Hear() {
    std::string datagram(65'536, '\0');
    const ssize_t size = recv(in_, datagram.data(), datagram.size(), 0);
    datagram.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
    return datagram;
  }
  /// To discovery and to the samples of the first four participants.
  void Send(const std::string& datagram) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(datagram.data());
    const bool refused =
        idl::CheckDatagram({bytes, datagram.size()}, pace_, Clock::now())
            .verdict != idl::DatagramVerdict::kSound;
    SendTo("239.255.0.1", base_, datagram, refused);
    for (int port = base_ + 10; port < base_ + 18; ++port) {
      SendTo("127.0.0.1", port, datagram, refused);
    }
  }
  /// Number of datagrams to `socket` that its owner has to refuse.
  std::uint64_t unsound(const Socket& socket) const {
    const auto found = unsound_.find(socket.port);
    return found == unsound_.end() || socket.multicast != (socket.port == base_)
               ? 0
               : found->second;
  }

 private:
  static sockaddr_in Address(const char* host, int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = inet_addr(host);
    return address;
  }
  void SendTo(const char* host, int port, const std::string& datagram,
              bool refused) {
    const sockaddr_in to = Address(host, port);
    const bool sent =
        sendto(out_, datagram.data(), datagram.size(), MSG_DONTWAIT,
               reinterpret_cast<const sockaddr*>(&to), sizeof to) >= 0;
    unsound_[port] += sent && refused;
  }

  int base_;
  idl::WriterPace pace_;
  std::map<int, std::uint64_t> unsound_;
  int in_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  int out_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
};

/// One of the seeds with some bytes changed, taken out, doubled or mixed with
/// those of another, from one of a thousand participants.
class Mutator {
 public:
  static inline const std::string kPrefix = std::string(12, 'w');

  explicit Mutator(std::vector<std::string> seeds) : seeds_(std::move(seeds)) {
    for (std::string& seed : seeds_) {
      Rename(seed, kPrefix);
    }
  }

  std::string Next() {
    std::string bytes = seeds_[Below(seeds_.size())];
    std::string stranger = kPrefix;
    stranger[10] = static_cast<char>(Below(4));
    stranger[11] = static_cast<char>(Below(256));
    Rename(bytes, stranger);
    for (std::size_t changes = Below(4); changes > 0; --changes) {
      const std::size_t at = 20 + Below(bytes.size() - 20 + 1);
      switch (at == bytes.size() ? 3 : Below(5)) {
        case 0:
          bytes[at] = static_cast<char>(Below(256));
          break;
        case 1:
          bytes[at] = static_cast<char>(bytes[at] ^ (1U << Below(8)));
          break;
        case 2:
          bytes.erase(at, 1 + Below(16));
          break;
        case 3: {
          const std::string& other = seeds_[Below(seeds_.size())];
          bytes.insert(at, other, 20, Below(other.size()));
          break;
        }
        default:
          bytes.replace(at, 4, std::string(4, Below(2) == 0 ? '\xff' : '\0'));
      }
    }
    return bytes;
  }

 private:
  // The sender's prefix, wherever it stands: who speaks in the name of a peer
  // can forge what that peer says.
  static void Rename(std::string& bytes, const std::string& prefix) {
    const std::string old = bytes.substr(8, 12);
    for (std::size_t at = 8; (at = bytes.find(old, at)) != std::string::npos;
         at += prefix.size()) {
      bytes.replace(at, prefix.size(), prefix);
    }
  }
  std::size_t Below(std::size_t count) { return random_() % count; }

  std::vector<std::string> seeds_;
  std::mt19937_64 random_{5};
};

using HostileDatagramsTest = MonitorFixture;

TEST_F(HostileDatagramsTest, MutationsHarmNoHonestValve) {
  StoreModels(data_, LinearModels());
  const auto monitor = StartMonitor();
  HonestValve honest(domain_.id());
  Wire wire(domain_.id());
  std::vector<std::string> seeds;
  for (auto& [name, message] : idl::RtpsMessages(std::string(100, '\1'))) {
    seeds.push_back(message.replace(8, 12, Mutator::kPrefix));
  }
  for (int i = 0; i < 6; ++i) {
    seeds.push_back(wire.Hear());
    ASSERT_GT(seeds.back().size(), 100U);
  }
  Mutator mutator(std::move(seeds));

  std::uint64_t sent = 0;
  for (const auto end = Clock::now() + AttackTime(); Clock::now() < end;) {
    for (int i = 0; i < 10; ++i, ++sent) {
      wire.Send(mutator.Next());
    }
    TakeFor(std::chrono::milliseconds(10));
  }
  const HonestValve::Delays delays = honest.Stop();
  std::cout << "datagrams: " << sent << " sent; " << delays << "; memory "
            << PeakMemory(monitor->pid()) << " MB\n";

  // Peers send sound datagrams, so that all the refused ones are ours. The pace
  // of a writer forbids a few more or less, depending on when it was heard.
  std::uint64_t unsound = 0;
  std::uint64_t dropped = 0;
  for (const Socket& socket : UdpSockets(monitor->pid())) {
    unsound += wire.unsound(socket);
    dropped += socket.drops;
  }
  const std::uint64_t few = unsound / 1000;
  EXPECT_GT(unsound, sent);
  EXPECT_TRUE(Await([&] {
    return counters_["dds_refused_datagrams"] + dropped + few >= unsound;
  }));
  EXPECT_LE(counters_["dds_refused_datagrams"], unsound + few);
  std::cout << "datagrams: " << unsound << " unsound ones reached the monitor, "
            << counters_["dds_refused_datagrams"] << " refused, " << dropped
            << " dropped by the kernel\n";
  ExpectPunctual(delays);
  EXPECT_LT(PeakMemory(monitor->pid()), kMaxMemory);
  monitor->Signal(SIGTERM);
  EXPECT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
}

}  // namespace
}  // namespace fdi::monitor
