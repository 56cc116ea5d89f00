#include "idl/participant.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <netinet/in.h>

#include "base/error.h"
#include "base/headroom.h"
#include "base/passing_error.h"
#include "base/time_units.h"
#include "idl/interfaces.h"
#include "idl/library_log.h"
#include "idl/participant_impl.h"
#include "idl/security/key_folder.h"
#if FDI_FAST_DDS == 2
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv6TransportDescriptor.h>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.h>
#else
#include <fastdds/rtps/transport/ChainingTransport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.hpp>
#include <fastdds/rtps/transport/UDPv6TransportDescriptor.hpp>
#include <fastdds/rtps/transport/shared_mem/SharedMemTransportDescriptor.hpp>
#endif

namespace fdi::idl {
namespace {

namespace transport = eprosima::fastdds::rtps;
using transport::SharedMemTransportDescriptor;
using transport::UDPv4TransportDescriptor;
using transport::UDPv6TransportDescriptor;

// The port of discovery is 7400 + 250 domain [RTPS, 9.6], at most 65 535.
constexpr int kMaxDomain = 232;
constexpr int kMaxValvesLimit = 100000;
// If a profile names a peer without a port, so many participants of it are
// called: all that fit a domain and host. The library's default is 4.
constexpr std::uint32_t kInitialPeersRange = 120;
// The kernel's default of some 200 kB is the first queue to overflow, and what
// it drops has to be retransmitted. Capped by net.core.rmem_max.
constexpr std::uint32_t kReceiveBufferBytes = 4U << 20U;
// Larger than the 208 kB that the kernel queues for a host which does not
// answer (net.ipv4.neigh.default.unres_qlen_bytes); otherwise sending to all
// hosts blocks for up to 3 s until that host is given up. Capped by
// net.core.wmem_max, of which the kernel takes twice the value: its default
// suffices.
constexpr std::uint32_t kSendBufferBytes = 4U << 20U;
// Shared memory is slow with the library's default of 512 kB.
constexpr std::uint32_t kSegmentBytes = 64U << 20U;
constexpr std::uint32_t kPortQueueCapacity = 8192;
// More than what a participant with its endpoints takes at its start. Where a
// thread or memory is refused half-way, 3.1 ends the process with an assertion
// (UDPTransportInterface::clean), and 2.9 may throw in a destructor.
constexpr int kThreads = 16;
constexpr std::size_t kHeadroomBytes = 32U << 20U;
/// Sockets and pipes; with fewer the library opens what it can, and is deaf.
constexpr int kDescriptors = 16;
// Bounds topics, remote endpoints per topic, and participants without a key.
constexpr std::size_t kMaxRemembered = 64;

std::vector<std::string> Addresses(const std::string& interfaces) {
  std::vector<std::string> addresses;
  std::istringstream stream(interfaces);
  for (std::string address; std::getline(stream, address, ',');) {
    addresses.push_back(address);
  }
  return addresses;
}

void ValidateInterfaces(const std::string& interfaces) {
  if (interfaces == "all") {
    return;
  }
  const std::map<std::string, unsigned> local = LocalAddresses();
  const std::vector<std::string> addresses = Addresses(interfaces);
  for (const std::string& address : addresses) {
    if (!local.contains(address)) {
      std::string known;
      for (const auto& [each, index] : local) {
        known += " " + each;
      }
      in_addr ignored{};
      const std::string what = "--interface: '" + address +
                               "' is no IPv4 address of this machine, accepted "
                               "are all or, comma separated," +
                               known;
      // An address may come after us at boot; an invalid one will not.
      if (inet_pton(AF_INET, address.c_str(), &ignored) == 1) {
        throw PassingError(what);
      }
      throw ConfigError(what);
    }
  }
  if (addresses.empty()) {
    throw ConfigError("--interface is empty, accepted are addresses or all");
  }
}

// Participants in one process communicate as separate processes would.
void SetUpLibraryOnce() {
  static const bool done = [] {
    auto* const factory = dds::DomainParticipantFactory::get_instance();
#if FDI_FAST_DDS == 2
    constexpr const char* kSettings =
        "<dds xmlns=\"http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles\">"
        "<library_settings><intraprocess_delivery>OFF</intraprocess_delivery>"
        "</library_settings></dds>";
    factory->load_XML_profiles_string(
        kSettings, std::char_traits<char>::length(kSettings));
#else
    eprosima::fastdds::LibrarySettings settings;
    settings.intraprocess_delivery = eprosima::fastdds::INTRAPROCESS_OFF;
    factory->set_library_settings(settings);
#endif
    return true;
  }();
  static_cast<void>(done);
}

// Passes on what a library transport receives, without harmful datagrams.
class CheckedTransport : public transport::ChainingTransport {
 public:
  CheckedTransport(
      const std::shared_ptr<transport::TransportDescriptorInterface>& lower,
      std::shared_ptr<DatagramLog> log)
      : ChainingTransport(Chain(lower)), log_(std::move(log)) {}

  transport::TransportDescriptorInterface* get_configuration() override {
    return low_level_transport_->get_configuration();
  }

  // NOLINTBEGIN(readability-function-size): the library's parameters.
#if FDI_FAST_DDS == 2
  bool send(rtps::SenderResource* sender, const rtps::octet* buffer,
#else
  bool send(rtps::SenderResource* sender,
            const std::vector<rtps::NetworkBuffer>& buffer,
#endif
            std::uint32_t bytes, transport::LocatorsIterator* begin,
            transport::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& timeout) override {
    return sender->send(buffer, bytes, begin, end, timeout);
  }
  // NOLINTEND(readability-function-size)

  // Each port has a thread that calls this; what they share, `log_`, is thread
  // safe. `buffer` belongs to the transport, so changes need a copy.
  void receive(transport::TransportReceiverInterface* receiver,
               const rtps::octet* buffer, std::uint32_t bytes,
               const rtps::Locator_t& local,
               const rtps::Locator_t& remote) override {
#if FDI_FAST_DDS != 2 && defined FASTDDS_STATISTICS
    // Over shared memory Fast DDS 3.1 omits the statistics submessage at the
    // end but not its space, which contains stale memory.
    constexpr std::uint32_t kStatisticsBytes = 60;
    if (remote.kind == LOCATOR_KIND_SHM) {
      bytes -= std::min(bytes, kStatisticsBytes);
    }
#endif
    const CheckedDatagram checked = CheckDatagram(
        {buffer, bytes}, log_->pace(), WriterPace::Clock::now(), &log_->acks());
    log_->Count(checked.verdict, bytes, remote);
    if (checked.verdict != DatagramVerdict::kSound) {
      return;
    }
    const auto sound = static_cast<std::uint32_t>(checked.bytes);
    if (checked.as_it_is()) {
      receiver->OnDataReceived(buffer, sound, local, remote);
    } else {
      std::vector<rtps::octet> copy(buffer, buffer + sound);
      Amend(checked, copy);
      receiver->OnDataReceived(copy.data(), sound, local, remote);
    }
  }

 private:
  // For the base class, which creates a transport from `lower`.
  struct Chain : transport::ChainingTransportDescriptor {
    using ChainingTransportDescriptor::ChainingTransportDescriptor;
    transport::TransportInterface* create_transport() const override {
      return nullptr;
    }
  };

  std::shared_ptr<DatagramLog> log_;
};

// Keeps its descriptor type, by which the library looks for shared memory.
template <typename Descriptor>
struct Checked : Descriptor {
  Checked(const Descriptor& lower, std::shared_ptr<DatagramLog> datagrams)
      : Descriptor(lower), log(std::move(datagrams)) {}

  transport::TransportInterface* create_transport() const override {
    return new CheckedTransport(std::make_shared<Descriptor>(*this), log);
  }

  std::shared_ptr<DatagramLog> log;
};

template <typename Descriptor>
bool Wrap(std::shared_ptr<transport::TransportDescriptorInterface>& any,
          const std::shared_ptr<DatagramLog>& log) {
  const auto* lower = dynamic_cast<const Descriptor*>(any.get());
  if (lower != nullptr) {
    any = std::make_shared<Checked<Descriptor>>(*lower, log);
  }
  return lower != nullptr;
}

void SetTransports(const DdsOptions& options, dds::DomainParticipantQos& qos) {
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.clear();
  if (options.transport != "shm") {
    auto udp = std::make_shared<UDPv4TransportDescriptor>();
    udp->receiveBufferSize = kReceiveBufferBytes;
    udp->sendBufferSize = kSendBufferBytes;
    udp->maxInitialPeersRange = kInitialPeersRange;
    if (options.interfaces != "all") {
      udp->interfaceWhiteList = Addresses(options.interfaces);
    }
    qos.transport().user_transports.push_back(udp);
  }
  if (options.transport != "udp") {
    auto shm = std::make_shared<SharedMemTransportDescriptor>();
    shm->segment_size(kSegmentBytes);
    shm->port_queue_capacity(kPortQueueCapacity);
    qos.transport().user_transports.push_back(shm);
  }
}

// Wraps the transports, also those of a QoS file; TCP is left as it is.
void CheckTransports(const std::shared_ptr<DatagramLog>& log,
                     dds::TransportConfigQos& qos) {
  // The library would create its built-in transports itself, unchecked. The
  // same ones, UDPv4 and shared memory, stand in for them.
  if (std::exchange(qos.use_builtin_transports, false)) {
    auto udp = std::make_shared<UDPv4TransportDescriptor>();
    udp->sendBufferSize = qos.send_socket_buffer_size;
    udp->receiveBufferSize = qos.listen_socket_buffer_size;
    udp->maxInitialPeersRange = kInitialPeersRange;
    qos.user_transports.push_back(udp);
    qos.user_transports.push_back(
        std::make_shared<SharedMemTransportDescriptor>());
  }
  for (auto& each : qos.user_transports) {
    Wrap<UDPv4TransportDescriptor>(each, log) ||
        Wrap<UDPv6TransportDescriptor>(each, log) ||
        Wrap<SharedMemTransportDescriptor>(each, log);
  }
}

// For a file that is missing or wrong, create_participant() returns null and no
// reason; CheckKey() names both before the library sees the files.
std::optional<KeyInfo> CheckedKey(const std::filesystem::path& folder,
                                  const LogSink& log) {
  if (folder.empty()) {
    return std::nullopt;
  }
  const std::int64_t now = NowNs();
  KeyInfo key = CheckKey(folder, now);
  const std::int64_t days = (key.until_ns - now) / kNsPerDay;
  if (days < kDaysOfWarning && log) {
    log(LogLevel::kWarning, "security_key_expires name=" + key.name +
                                " days=" + std::to_string(days));
  }
  return key;
}

// Configures the plugins of DDS Security 1.1 with the files of one key.
void Secure(const std::filesystem::path& folder,
            dds::DomainParticipantQos& qos) {
  const std::string file =
      "file://" + std::filesystem::absolute(folder).string() + "/";
  const std::string auth = "dds.sec.auth.builtin.PKI-DH.";
  const std::string access = "dds.sec.access.builtin.Access-Permissions.";
  for (const auto& [name, value] :
       std::initializer_list<std::pair<std::string, std::string>>{
           {"dds.sec.auth.plugin", "builtin.PKI-DH"},
           {auth + "identity_ca", file + "ca.pem"},
           {auth + "identity_certificate", file + "cert.pem"},
           {auth + "private_key", file + "key.pem"},
           {"dds.sec.access.plugin", "builtin.Access-Permissions"},
           {access + "permissions_ca", file + "ca.pem"},
           {access + "governance", file + "governance.p7s"},
           {access + "permissions", file + "permissions.p7s"},
           {"dds.sec.crypto.plugin", "builtin.AES-GCM-GMAC"}}) {
    qos.properties().properties().emplace_back(name, value);
  }
}

dds::DomainParticipantQos MakeQos(const DdsOptions& options,
                                  const ProfileFile& profiles,
                                  const std::shared_ptr<DatagramLog>& datagrams,
                                  const std::string& name) {
  dds::DomainParticipantQos qos;
  // The profile is read first, because reading it replaces the whole QoS: what
  // it does not state gets the library's defaults.
  const std::set<std::string>* stated = profiles.Stated(kParticipantProfile);
  if (stated != nullptr) {
    Check(dds::DomainParticipantFactory::get_instance()
              ->get_participant_qos_from_profile(kParticipantProfile, qos),
          "get_participant_qos_from_profile");
  }
  const auto states = [&](const char* element) {
    return stated != nullptr && stated->contains(element);
  };
  qos.name(name);
  if (!states("userTransports") && !states("useBuiltinTransports")) {
    SetTransports(options, qos);
  }
  CheckTransports(datagrams, qos.transport());
  if (!options.security.empty()) {
    Secure(options.security, qos);
  }
  if (!states("builtin")) {
    auto& discovery = qos.wire_protocol().builtin.discovery_config;
    // By default a peer that died is noticed after 20 s. Five announcements in
    // a lease, so that four of them may be lost.
    discovery.leaseDuration = {5, 0};
    discovery.leaseDuration_announcementperiod = {1, 0};
  }
  return qos;
}

}  // namespace

TransportError::TransportError(const std::string& operation, int code)
    : std::runtime_error("DDS " + operation + " failed with code " +
                         std::to_string(code)),
      code_(code) {}

void Check(const ReturnCode& code, const std::string& operation) {
  if (code != return_code::RETCODE_OK) {
    throw TransportError(operation, NumberOf(code));
  }
}

void Validate(const DdsOptions& options) {
  if (options.domain < 0 || options.domain > kMaxDomain) {
    throw ConfigError("--domain is " + std::to_string(options.domain) +
                      ", accepted are 0 to " + std::to_string(kMaxDomain));
  }
  if (options.transport != "udp" && options.transport != "shm" &&
      options.transport != "default") {
    throw ConfigError("--transport is '" + options.transport +
                      "', accepted are udp, shm and default");
  }
  if (options.max_valves < 1 || options.max_valves > kMaxValvesLimit) {
    throw ConfigError("--max-valves is " + std::to_string(options.max_valves) +
                      ", accepted are 1 to " + std::to_string(kMaxValvesLimit));
  }
  ValidateInterfaces(options.interfaces);
}

void DatagramLog::Count(DatagramVerdict verdict, std::size_t bytes,
                        const rtps::Locator_t& sender) {
  const std::uint64_t before =
      counts_[static_cast<std::size_t>(verdict)].fetch_add(
          1, std::memory_order_relaxed);
  if (verdict != DatagramVerdict::kSound && before == 0 && log_) {
    std::ostringstream line;
    line << "datagram_refused reason=" << DatagramVerdictName(verdict)
         << " bytes=" << bytes << " from=" << sender;
    log_(LogLevel::kWarning, line.str());
  }
}

DatagramCounts DatagramLog::counts() const {
  DatagramCounts counts{};
  std::ranges::copy(counts_, counts.begin());
  return counts;
}

Participant::Impl::Impl(const DdsOptions& options, LogSink log,
                        const std::string& name)
    : options_(options),
      log_(std::move(log)),
      library_log_(log_),
      datagrams_(std::make_shared<DatagramLog>(log_)),
      profiles_(options.qos_file.empty() ? ProfileFile()
                                         : ProfileFile(options.qos_file)),
      key_(CheckedKey(options.security, log_)) {
  SetUpLibraryOnce();
  if (options_.transport != "shm") {
    interfaces_.emplace(options_.interfaces);
  }
  RequireDescriptors(kDescriptors);
  RequireHeadroom(kThreads, kHeadroomBytes);
  const dds::DomainParticipantQos qos =
      MakeQos(options_, profiles_, datagrams_, name);
  // The participant is active at once: its callbacks may come before `handle_`
  // is set and use only members initialised above. It listens only to
  // discovery; the status of an endpoint goes to the listener of that endpoint.
  handle_ = NotNull(
      dds::DomainParticipantFactory::get_instance()->create_participant(
          static_cast<std::uint32_t>(options_.domain), qos, this,
          dds::StatusMask::none()),
      "create_participant on domain " + std::to_string(options_.domain));
}

Participant::Impl::~Impl() {
  handle_->set_listener(nullptr);
  // A Participant outlives its endpoints, so only topics are left. They go
  // first: the library does not delete a participant that contains entities.
  for (const auto& [name, topic] : topics_) {
    handle_->delete_topic(topic);
  }
  dds::DomainParticipantFactory::get_instance()->delete_participant(handle_);
}

dds::Topic* Participant::Impl::TopicOf(const std::string& topic,
                                       const dds::TypeSupport& type) {
  const MutexLock lock(topics_mutex_);
  dds::Topic*& found = topics_[topic];
  if (found == nullptr) {
    Check(type.register_type(handle_), "register_type of " + topic);
    found = NotNull(handle_->create_topic(topic, type.get_type_name(),
                                          dds::TOPIC_QOS_DEFAULT),
                    "create_topic " + topic);
  }
  return found;
}

void Participant::Impl::ReportIncompatible(const std::string& topic,
                                           bool remote_is_writer,
                                           dds::QosPolicyId_t id,
                                           const PolicyTexts& ours) {
  // The library tells the policy, but neither the endpoint nor its value.
  // Shown is the newest endpoint of the topic whose value differs from ours.
  const auto own = ours.find(id);
  std::string theirs = "unknown";
  {
    const MutexLock lock(remotes_mutex_);
    for (const PolicyTexts& remote : remotes_[{topic, remote_is_writer}]) {
      const auto text = remote.find(id);
      if (own != ours.end() && text != remote.end() &&
          text->second != own->second) {
        theirs = text->second;
        break;
      }
    }
  }
  const std::string own_text = own == ours.end() ? "unknown" : own->second;
  if (!log_) {
    return;
  }
  log_(LogLevel::kWarning,
       "qos_incompatible topic=" + topic + " policy=" + PolicyName(id) +
           (remote_is_writer
                ? " requested_here=" + own_text + " offered_there=" + theirs
                : " offered_here=" + own_text + " requested_there=" + theirs));
}

bool Participant::Impl::PermitsPv(const char* topic) {
  const bool permitted = !key_ || key_->has_pv;
  if (!permitted && !told_of_key_.exchange(true)) {
    CountRefusedPermission();
    Log(LogLevel::kWarning,
        "security_key_without_pv name=" + key_->name + " topic=" + topic +
            " effect=\"no PV is sent or read\" try=\"fdi-keys renew\"");
  }
  return permitted;
}

void Participant::Impl::StorePolicies(const RemoteKey& key, PolicyTexts texts) {
  const MutexLock lock(remotes_mutex_);
  // Ours are few; others may use any number of names, also like ours.
  if (!key.first.starts_with("fdi/v") ||
      (remotes_.size() >= kMaxRemembered && !remotes_.contains(key))) {
    return;
  }
  std::deque<PolicyTexts>& known = remotes_[key];
  known.push_front(std::move(texts));
  if (known.size() > kMaxRemembered) {
    known.pop_back();
  }
}

// Logs only the first, because thousands may come and Fast DDS 3.1.2 refuses
// each of them repeatedly.
void Participant::Impl::onParticipantAuthentication(
    dds::DomainParticipant* /*participant*/,
    rtps::ParticipantAuthenticationInfo&& info) {
  using Info = rtps::ParticipantAuthenticationInfo;
  if (info.status != Info::UNAUTHORIZED_PARTICIPANT) {
    return;
  }
  {
    const MutexLock lock(remotes_mutex_);
    if (std::ranges::find(refused_guids_, info.guid) != refused_guids_.end()) {
      return;
    }
    refused_guids_.push_front(info.guid);
    if (refused_guids_.size() > kMaxRemembered) {
      refused_guids_.pop_back();
    }
  }
  if (refused_.fetch_add(1, std::memory_order_relaxed) == 0 && log_) {
    std::ostringstream line;
    line << "participant_refused reason=no_key_of_the_authority guid="
         << info.guid;
    log_(LogLevel::kWarning, line.str());
  }
}

#if FDI_FAST_DDS == 2
void Participant::Impl::on_publisher_discovery(
    dds::DomainParticipant* /*participant*/, rtps::WriterDiscoveryInfo&& info) {
  if (info.status == rtps::WriterDiscoveryInfo::DISCOVERED_WRITER) {
    StorePolicies({info.info.topicName().c_str(), true},
                  Describe(info.info.m_qos));
  }
}

void Participant::Impl::on_subscriber_discovery(
    dds::DomainParticipant* /*participant*/, rtps::ReaderDiscoveryInfo&& info) {
  if (info.status == rtps::ReaderDiscoveryInfo::DISCOVERED_READER) {
    StorePolicies({info.info.topicName().c_str(), false},
                  Describe(info.info.m_qos));
  }
}
#else
void Participant::Impl::on_data_writer_discovery(
    dds::DomainParticipant* /*participant*/, rtps::WriterDiscoveryStatus status,
    const RemoteWriterQos& info, bool& /*should_be_ignored*/) {
  if (status == rtps::WriterDiscoveryStatus::DISCOVERED_WRITER) {
    StorePolicies({info.topic_name.c_str(), true}, Describe(info));
  }
}

void Participant::Impl::on_data_reader_discovery(
    dds::DomainParticipant* /*participant*/, rtps::ReaderDiscoveryStatus status,
    const RemoteReaderQos& info, bool& /*should_be_ignored*/) {
  if (status == rtps::ReaderDiscoveryStatus::DISCOVERED_READER) {
    StorePolicies({info.topic_name.c_str(), false}, Describe(info));
  }
}
#endif

Participant::Participant(const DdsOptions& options, LogSink log,
                         const std::string& name) {
  Validate(options);
  impl_ = std::make_unique<Impl>(options, std::move(log), name);
}

Participant::~Participant() = default;

const DdsOptions& Participant::options() const {
  return impl_->options();
}

std::uint64_t Participant::refused_participants() const {
  return impl_->refused_participants();
}

void Participant::RequireInterfaces() const {
  impl_->RequireInterfaces();
}

DatagramCounts Participant::datagrams() const {
  return impl_->datagrams();
}

}  // namespace fdi::idl
