#include "idl/interfaces.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <sstream>
#include <system_error>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include "base/passing_error.h"

namespace fdi::idl {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kPeriod{1};

bool IsLoopback(const std::string& address) {
  return address.starts_with("127.");
}

std::string TextOf(const in_addr& address) {
  std::array<char, INET_ADDRSTRLEN> text{};
  return inet_ntop(AF_INET, &address, text.data(), text.size()) == nullptr
             ? std::string()
             : std::string(text.data());
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

Interfaces::Interfaces(const std::string& names)
    : all_(names == "all"), next_look_(Clock::now() + kPeriod) {
  const std::map<std::string, unsigned> local = LocalAddresses();
  std::istringstream stream(names);
  if (all_) {
    used_ = local;
  }
  for (std::string address; std::getline(stream, address, ',');) {
    if (!all_ && !IsLoopback(address) && local.contains(address)) {
      used_[address] = local.at(address);
    }
  }
}

void Interfaces::Require() const {
  if (Clock::now() < next_look_.load() || used_.empty()) {
    return;
  }
  next_look_ = Clock::now() + kPeriod;
  std::map<std::string, unsigned> now;
  try {
    now = LocalAddresses();
  } catch (const PassingError&) {
    return;  // No descriptor is free, say: nobody knows before the next look.
  }
  for (const auto& [address, index] : now) {
    const bool known = std::ranges::any_of(
        used_,
        [index = index](const auto& used) { return used.second == index; });
    if (all_ && !known) {
      throw PassingError("the interface of " + address +
                         " was not there at the start");
    }
  }
  for (const auto& [address, index] : used_) {
    const auto found = now.find(address);
    if (!all_ && found == now.end()) {
      throw PassingError("no interface has " + address + " any more");
    }
    if (!all_ && found->second != index) {
      throw PassingError("the interface of " + address + " was made anew");
    }
  }
}

}  // namespace fdi::idl
