#include "idl/profile_file.h"

#include <filesystem>
#include <mutex>
#include <string_view>

#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <tinyxml2.h>

#include "diagnosis/error.h"
#include "idl/qos.h"

namespace fdi::idl {
namespace {

using eprosima::fastdds::dds::DomainParticipantFactory;
using Stated = std::map<std::string, std::set<std::string>>;

// Calls visit(element) for the child elements of `parent`.
template <typename Visit>
void ForEachChild(const tinyxml2::XMLElement& parent, Visit visit) {
  for (const auto* child = parent.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    visit(*child);
  }
}

// The policies under <qos> and <topic>, and what stands beside these.
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

void AddProfile(const std::string& path, const tinyxml2::XMLElement& element,
                Stated& stated) {
  const char* name = element.Attribute("profile_name");
  if (name == nullptr) {
    throw ConfigError("QoS file '" + path + "': a " + element.Name() +
                      " without profile_name");
  }
  stated[name] = PoliciesOf(element);
}

void CheckNames(const std::string& path, const Stated& stated,
                const std::set<std::string>& accepted,
                const std::set<std::string>& policies) {
  for (const auto& [name, elements] : stated) {
    if (!accepted.contains(name)) {
      std::string names;
      for (const std::string& each : accepted) {
        names += " " + each;
      }
      throw ConfigError("QoS file '" + path + "': unknown profile '" + name +
                        "', accepted are" + names);
    }
    for (const std::string& element : elements) {
      if (!policies.empty() && !policies.contains(element)) {
        throw ConfigError("QoS file '" + path + "': profile '" + name +
                          "' states '" + element +
                          "', which cannot be overridden");
      }
    }
  }
}

// The library keeps profiles by name for the life of the process and refuses
// the same file twice.
void LoadOnce(const std::string& path) {
  static std::mutex mutex;
  static std::string loaded;
  const std::lock_guard lock(mutex);
  const std::string absolute = std::filesystem::absolute(path).string();
  if (loaded == absolute) {
    return;
  }
  if (!loaded.empty()) {
    throw ConfigError("QoS file '" + path + "': this process already uses '" +
                      loaded + "'");
  }
  if (DomainParticipantFactory::get_instance()->load_XML_profiles_file(
          absolute) != eprosima::fastrtps::types::ReturnCode_t::RETCODE_OK) {
    throw ConfigError("QoS file '" + path +
                      "' has profiles that Fast DDS does not accept");
  }
  loaded = absolute;
}

const std::set<std::string>* Find(const Stated& stated,
                                  const std::string& name) {
  const auto found = stated.find(name);
  return found == stated.end() ? nullptr : &found->second;
}

}  // namespace

ProfileFile::ProfileFile(const std::string& path) {
  tinyxml2::XMLDocument document;
  if (document.LoadFile(path.c_str()) != tinyxml2::XML_SUCCESS) {
    throw ConfigError("QoS file '" + path + "': " + document.ErrorStr());
  }
  const tinyxml2::XMLElement* root = document.RootElement();
  const tinyxml2::XMLElement* profiles =
      std::string_view(root->Name()) == "profiles"
          ? root
          : root->FirstChildElement("profiles");
  if (profiles == nullptr) {
    throw ConfigError("QoS file '" + path + "' has no <profiles> element");
  }
  ForEachChild(*profiles, [&](const tinyxml2::XMLElement& element) {
    const std::string_view kind = element.Name();
    if (kind == "data_writer" || kind == "publisher") {
      AddProfile(path, element, writers_);
    } else if (kind == "data_reader" || kind == "subscriber") {
      AddProfile(path, element, readers_);
    } else if (kind == "participant") {
      AddProfile(path, element, participants_);
    } else if (kind != "transport_descriptors") {
      throw ConfigError("QoS file '" + path + "': unexpected <" +
                        std::string(kind) + ">");
    }
  });
  CheckNames(path, writers_, WriterProfileNames(), OverridablePolicies());
  CheckNames(path, readers_, ReaderProfileNames(), OverridablePolicies());
  CheckNames(path, participants_, {kParticipantProfile}, {});
  LoadOnce(path);
}

const std::set<std::string>* ProfileFile::Writer(
    const std::string& profile) const {
  return Find(writers_, profile);
}

const std::set<std::string>* ProfileFile::Reader(
    const std::string& profile) const {
  return Find(readers_, profile);
}

const std::set<std::string>* ProfileFile::ParticipantPolicies() const {
  return Find(participants_, kParticipantProfile);
}

}  // namespace fdi::idl
