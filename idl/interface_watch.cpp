#include "idl/interface_watch.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>
#include <set>
#include <sstream>
#include <system_error>
#include <utility>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "base/mutex.h"
#include "base/passing_error.h"
#include "base/retry.h"

namespace fdi::idl {
namespace {

constexpr auto kPeriod = std::chrono::seconds(1);
// Of discovery [RTPS, 9.6.1.4.1]; the library's other sockets are in no group.
constexpr const char* kGroup = "239.255.0.1";

// Of the process: its participants have the same interfaces.
class Missing {
 public:
  void Set(const std::string& addresses) {
    const MutexLock lock(mutex_);
    addresses_ = addresses;
  }
  std::string Get() const {
    const MutexLock lock(mutex_);
    return addresses_;
  }

 private:
  mutable Mutex mutex_;
  std::string addresses_ GUARDED_BY(mutex_);
};

Missing& TheMissing() {
  static Missing missing;
  return missing;
}

std::string TextOf(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  return inet_ntop(AF_INET, &address, text.data(), text.size()) == nullptr
             ? std::string()
             : std::string(text.data());
}

std::set<std::string> Watched(const std::string& interfaces) {
  std::set<std::string> addresses;
  std::istringstream stream(interfaces);
  for (std::string address; std::getline(stream, address, ',');) {
    if (!address.starts_with("127.")) {
      addresses.insert(address);
    }
  }
  return addresses;
}

// The address that a UDP socket over IPv4 is bound to; nothing of another file.
std::optional<sockaddr_in> BoundTo(int socket) {
  int type = 0;
  socklen_t size = sizeof type;
  sockaddr_in address{};
  socklen_t length = sizeof address;
  if (getsockopt(socket, SOL_SOCKET, SO_TYPE, &type, &size) != 0 ||
      type != SOCK_DGRAM ||
      getsockname(socket, reinterpret_cast<sockaddr*>(&address), &length) !=
          0 ||
      address.sin_family != AF_INET || address.sin_port == 0) {
    return std::nullopt;
  }
  return address;
}

template <typename Use>
void ForEachUdpSocket(Use use) {
  std::error_code error;
  for (const auto& entry :
       std::filesystem::directory_iterator("/proc/self/fd", error)) {
    const int socket = std::atoi(entry.path().filename().c_str());
    if (const auto address = BoundTo(socket)) {
      use(socket, *address);
    }
  }
}

// Both are as if the library had opened the socket now. What a socket already
// has is set again without effect; a membership by the number of an interface
// that is gone would stay, and there may be 20, so it is dropped.
void Renew(int socket, const sockaddr_in& bound, const in_addr& own,
           unsigned old_index) {
  ip_mreqn group{};
  inet_pton(AF_INET, kGroup, &group.imr_multiaddr);
  const bool receives = bound.sin_addr.s_addr == group.imr_multiaddr.s_addr ||
                        (bound.sin_addr.s_addr == INADDR_ANY &&
                         (ntohs(bound.sin_port) - 7400) % 250 == 0);
  if (receives) {
    group.imr_ifindex = static_cast<int>(old_index);
    if (old_index != 0) {
      setsockopt(socket, IPPROTO_IP, IP_DROP_MEMBERSHIP, &group, sizeof group);
    }
    group.imr_ifindex = 0;
    group.imr_address = own;
    setsockopt(socket, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group);
  }
  in_addr from{};
  socklen_t size = sizeof from;
  if (getsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &from, &size) == 0 &&
      from.s_addr == own.s_addr) {
    setsockopt(socket, IPPROTO_IP, IP_MULTICAST_IF, &own, sizeof own);
  }
}

}  // namespace

std::map<std::string, unsigned> LocalAddresses() {
  ifaddrs* list = nullptr;
  if (getifaddrs(&list) != 0) {
    throw PassingError("the addresses of this machine cannot be listed: " +
                       std::generic_category().message(errno));
  }
  std::map<std::string, unsigned> addresses;
  for (const ifaddrs* each = list; each != nullptr; each = each->ifa_next) {
    if (each->ifa_addr != nullptr && each->ifa_addr->sa_family == AF_INET) {
      sockaddr_in address{};
      std::memcpy(&address, each->ifa_addr, sizeof address);
      addresses[TextOf(address.sin_addr)] = if_nametoindex(each->ifa_name);
    }
  }
  freeifaddrs(list);
  return addresses;
}

InterfaceWatch::InterfaceWatch(std::string interfaces, LogSink log)
    : interfaces_(std::move(interfaces)), log_(std::move(log)) {
  if (Watched(interfaces_).empty()) {
    return;
  }
  present_ = LocalAddresses();
  thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
}

InterfaceWatch::~InterfaceWatch() {
  thread_ = {};
  TheMissing().Set("");
}

void InterfaceWatch::Run(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    PauseUntil(stop, kPeriod);
    try {
      Look();
    } catch (const std::exception&) {  // No descriptor, say: a second later.
    }
  }
}

void InterfaceWatch::Look() {
  std::map<std::string, unsigned> now = LocalAddresses();
  const bool all = interfaces_ == "all";
  std::string missing;
  for (const std::string& address : Watched(interfaces_)) {
    if (!all && !now.contains(address)) {
      missing += (missing.empty() ? "" : ",") + address;
    }
  }
  for (const auto& [address, index] : now) {
    const auto before = present_.find(address);
    const unsigned old = before == present_.end() ? 0 : before->second;
    if (index == old || !(all || Watched(interfaces_).contains(address))) {
      continue;
    }
    in_addr own{};
    inet_pton(AF_INET, address.c_str(), &own);
    ForEachUdpSocket([&](int socket, const sockaddr_in& bound) {
      Renew(socket, bound, own, old);
    });
    if (log_) {
      log_(LogLevel::kWarning, "interface_renewed address=" + address);
    }
  }
  // What is missing keeps its last number, so that its memberships are dropped
  // when it is there again.
  now.merge(present_);
  present_ = std::move(now);
  if (missing != missing_) {
    if (!missing.empty() && log_) {
      log_(LogLevel::kWarning, "interface_missing address=" + missing);
    }
    TheMissing().Set(missing);
    missing_ = std::move(missing);
  }
}

std::string MissingInterfaces() {
  return TheMissing().Get();
}

}  // namespace fdi::idl
