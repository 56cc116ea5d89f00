// Datagrams from the network: the check reads nothing outside of them, and what
// it lets through does not harm a participant, which gets each as it is. What
// has an even last byte of its prefix comes in the name of a matched peer.
#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include "idl/endpoint.h"
#include "idl/participant_impl.h"

namespace {

using fdi::idl::ValveSampleMessage;

class Target {
 public:
  Target() {
    // Each writer has said where it stands, as on a bus that runs.
    publisher_.WaitForReaders(1, kPatience);
    events_.WaitForReaders(1, kPatience);
    ValveSampleMessage sample;
    sample.valve_id = "V";
    publisher_.Write(sample);
    fdi::FaultEvent event;
    event.valve_id = "V";
    events_.Write(event);
    Await(subscriber_);
    Await(watcher_);
    const in_addr loopback{htonl(INADDR_LOOPBACK)};
    setsockopt(socket_, IPPROTO_IP, IP_MULTICAST_IF, &loopback,
               sizeof loopback);
  }

  void Receive(std::vector<std::uint8_t> datagram) {
    if (datagram.size() >= 20 && datagram[19] % 2 == 0) {
      const auto& peer = peer_.impl()->guid().guidPrefix;
      std::copy_n(static_cast<const std::uint8_t*>(peer.value), 12,
                  datagram.begin() + 8);
    }
    const int base = 7400 + 250 * options_.domain;
    Send("239.255.0.1", base, datagram);     // Discovery
    Send("127.0.0.1", base + 11, datagram);  // and samples.
    const auto deadline =
        std::chrono::steady_clock::now() + std::chrono::milliseconds(2);
    const std::uint64_t before = seen_;
    while (seen_ < before + 2 && std::chrono::steady_clock::now() < deadline) {
      const auto counts = participant_.datagrams();
      seen_ = std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
      std::this_thread::yield();
    }
    subscriber_.Take({}, std::chrono::milliseconds(0));
  }

 private:
  static constexpr std::chrono::seconds kPatience{30};

  template <typename Message>
  static void Await(fdi::idl::Subscriber<Message>& subscriber) {
    bool taken = false;
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!taken && std::chrono::steady_clock::now() < deadline) {
      subscriber.Take({[&](const auto&, const auto&) { taken = true; }, {}},
                      std::chrono::milliseconds(100));
    }
  }

  void Send(const char* address, int port,
            const std::vector<std::uint8_t>& datagram) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(port));
    to.sin_addr.s_addr = inet_addr(address);
    sendto(socket_, datagram.data(), datagram.size(), 0,
           reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }

  // Beside those of the tests.
  fdi::idl::DdsOptions options_{.domain = 1 + static_cast<int>(getpid() % 19)};
  fdi::idl::Participant participant_{options_};
  fdi::idl::Participant peer_{options_};
  fdi::idl::Subscriber<ValveSampleMessage> subscriber_{participant_};
  fdi::idl::Publisher<fdi::FaultEvent> events_{participant_};
  fdi::idl::Publisher<ValveSampleMessage> publisher_{peer_};
  fdi::idl::Subscriber<fdi::FaultEvent> watcher_{peer_};
  int socket_{::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
  std::uint64_t seen_{0};
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  static Target& target = *new Target;
  fdi::idl::WriterPace pace;
  const auto checked = fdi::idl::CheckDatagram({data, size}, pace, {});
  if (checked.bytes > size) {
    std::abort();
  }
  if (checked.verdict == fdi::idl::DatagramVerdict::kSound) {
    target.Receive({data, data + size});
  }
  return 0;
}
