#include "idl/profile_file.h"

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <tinyxml2.h>

#include "base/error.h"
#include "base/mutex.h"
#include "base/passing_error.h"
#include "idl/participant_impl.h"
#include "idl/qos.h"

// The XML of Fast DDS, as far as it is accepted:
//
//     file        = profiles | root containing profiles
//     profiles    = {<transport_descriptors> | participant | writer | reader}
//     participant = <participant profile_name="fdi_participant">
//     writer      = <data_writer profile_name="ENDPOINT_writer">
//     reader      = <data_reader profile_name="ENDPOINT_reader">
//
// ENDPOINT is one of EndpointNames(); <publisher> and <subscriber> are other
// names of <data_writer> and <data_reader>. The file is parsed here as well as
// by the library, which fills in its defaults and does not tell which policies
// a profile states.
namespace fdi::idl {
namespace {

// Calls visit(element) for the child elements of `parent`.
template <typename Visit>
void ForEachChild(const tinyxml2::XMLElement& parent, Visit visit) {
  for (const auto* child = parent.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    visit(*child);
  }
}

// The policies under <qos>, <topic> and <rtps>, and the elements beside these.
std::set<std::string> PoliciesOf(const tinyxml2::XMLElement& endpoint) {
  std::set<std::string> policies;
  ForEachChild(endpoint, [&](const tinyxml2::XMLElement& element) {
    const std::string_view name = element.Name();
    if (name == "qos" || name == "topic" || name == "rtps") {
      ForEachChild(element, [&](const tinyxml2::XMLElement& policy) {
        policies.insert(policy.Name());
      });
    } else {
      policies.insert(element.Name());
    }
  });
  return policies;
}

// Calls visit(element, policy) for the policies that an endpoint profile may
// override: XML name and accessor.
template <typename Visit>
void ForEachPolicy(Visit visit) {
  visit(
      "reliability", [](auto& q) -> auto& { return q.reliability(); });
  visit(
      "durability", [](auto& q) -> auto& { return q.durability(); });
  visit(
      "deadline", [](auto& q) -> auto& { return q.deadline(); });
  visit(
      "liveliness", [](auto& q) -> auto& { return q.liveliness(); });
  visit(
      "lifespan", [](auto& q) -> auto& { return q.lifespan(); });
  visit(
      "historyQos", [](auto& q) -> auto& { return q.history(); });
  visit(
      "resourceLimitsQos",
      [](auto& q) -> auto& { return q.resource_limits(); });
  visit(
      "historyMemoryPolicy",
      [](auto& q) -> auto& { return q.endpoint().history_memory_policy; });
  visit(
      "unicastLocatorList",
      [](auto& q) -> auto& { return q.endpoint().unicast_locator_list; });
  visit(
      "multicastLocatorList",
      [](auto& q) -> auto& { return q.endpoint().multicast_locator_list; });
}

// Only in writers, or placed differently in writers than in readers.
constexpr const char* kPublishMode = "publishMode";
constexpr const char* kTimes = "times";

std::vector<std::string> Overridable() {
  std::vector<std::string> names;
  ForEachPolicy([&](const char* name, auto) { names.emplace_back(name); });
  names.emplace_back(kPublishMode);
  names.emplace_back(kTimes);
  return names;
}

// "accepted are a b c"
template <typename Names>
std::string Accepted(const Names& names) {
  std::string text = "accepted are";
  for (const std::string& name : names) {
    text += ' ' + name;
  }
  return text;
}

// Copies the policies common to both kinds of endpoint, each as a whole: parts
// that the profile does not state get the library's defaults, such as ten
// instances in resourceLimitsQos.
template <typename Qos>
void CopyStated(const std::set<std::string>& stated, const Qos& from, Qos& to) {
  ForEachPolicy([&](const char* name, auto policy) {
    if (stated.contains(name)) {
      policy(to) = policy(from);
    }
  });
}

// @throws ConfigError unless a profile `name` may override `elements`; valid
//   names are those of the topics with `suffix`.
void CheckProfile(const std::string& path, const std::string& name,
                  const std::set<std::string>& elements,
                  const std::string& suffix) {
  std::set<std::string> accepted{kParticipantProfile};
  if (!suffix.empty()) {
    accepted.clear();
    for (const std::string& endpoint : EndpointNames()) {
      accepted.insert(endpoint + suffix);
    }
  }
  if (!accepted.contains(name)) {
    throw ConfigError("QoS file '" + path + "': unknown profile '" + name +
                      "', " + Accepted(accepted));
  }
  const std::vector<std::string> overridable = Overridable();
  for (const std::string& element : elements) {
    if (!suffix.empty() &&
        std::ranges::find(overridable, element) == overridable.end()) {
      throw ConfigError(
          "QoS file '" + path + "': profile '" + name + "' states '" + element +
          "', which cannot be overridden; " + Accepted(overridable));
    }
  }
}

// The library keeps profiles by name for the lifetime of the process and
// refuses to load a file twice.
void LoadOnce(const std::string& path) {
  static Mutex mutex;
  static std::string loaded;
  const MutexLock lock(mutex);
  const std::string absolute = std::filesystem::absolute(path).string();
  if (loaded == absolute) {
    return;
  }
  if (!loaded.empty()) {
    throw ConfigError("QoS file '" + path + "': this process already uses '" +
                      loaded + "'");
  }
  if (dds::DomainParticipantFactory::get_instance()->load_XML_profiles_file(
          absolute) != return_code::RETCODE_OK) {
    throw ConfigError("QoS file '" + path +
                      "' has profiles that Fast DDS does not accept");
  }
  loaded = absolute;
}

}  // namespace

ProfileFile::ProfileFile(const std::string& path) {
  tinyxml2::XMLDocument document;
  errno = 0;
  if (document.LoadFile(path.c_str()) != tinyxml2::XML_SUCCESS) {
    if (MayPass(errno)) {
      throw PassingError("QoS file '" + path + "': cannot be read: " +
                         std::generic_category().message(errno));
    }
    throw ConfigError("QoS file '" + path + "': " + document.ErrorStr());
  }
  const tinyxml2::XMLElement* root = document.RootElement();
  const tinyxml2::XMLElement* profiles =
      root == nullptr ? nullptr
      : std::string_view(root->Name()) == "profiles"
          ? root
          : root->FirstChildElement("profiles");
  if (profiles == nullptr) {
    throw ConfigError("QoS file '" + path + "' has no <profiles> element");
  }
  ForEachChild(*profiles, [&](const tinyxml2::XMLElement& element) {
    const std::string kind = element.Name();
    if (kind == "transport_descriptors") {
      return;
    }
    const bool writer = kind == "data_writer" || kind == "publisher";
    const bool reader = kind == "data_reader" || kind == "subscriber";
    if (!writer && !reader && kind != "participant") {
      throw ConfigError("QoS file '" + path + "': unexpected <" + kind + ">");
    }
    const char* name = element.Attribute("profile_name");
    if (name == nullptr) {
      throw ConfigError("QoS file '" + path + "': a " + kind +
                        " without profile_name");
    }
    CheckProfile(path, name, stated_[name] = PoliciesOf(element),
                 writer   ? "_writer"
                 : reader ? "_reader"
                          : "");
  });
  // Last, because what the library has loaded it never forgets.
  LoadOnce(path);
}

const std::set<std::string>* ProfileFile::Stated(
    const std::string& name) const {
  const auto found = stated_.find(name);
  return found == stated_.end() ? nullptr : &found->second;
}

dds::DataWriterQos ProfileFile::Override(
    const std::string& name, dds::DataWriterQos qos,
    const dds::Publisher& publisher) const {
  if (const auto* stated = Stated(name)) {
    dds::DataWriterQos from;
    Check(publisher.get_datawriter_qos_from_profile(name, from),
          "get_datawriter_qos_from_profile " + name);
    CopyStated(*stated, from, qos);
    if (stated->contains(kPublishMode)) {
      qos.publish_mode() = from.publish_mode();
    }
    if (stated->contains(kTimes)) {
      qos.reliable_writer_qos().times = from.reliable_writer_qos().times;
    }
  }
  return qos;
}

dds::DataReaderQos ProfileFile::Override(
    const std::string& name, dds::DataReaderQos qos,
    const dds::Subscriber& subscriber) const {
  if (const auto* stated = Stated(name)) {
    dds::DataReaderQos from;
    Check(subscriber.get_datareader_qos_from_profile(name, from),
          "get_datareader_qos_from_profile " + name);
    CopyStated(*stated, from, qos);
    if (stated->contains(kTimes)) {
      qos.reliable_reader_qos().times = from.reliable_reader_qos().times;
    }
  }
  return qos;
}

}  // namespace fdi::idl
