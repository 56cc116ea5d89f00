#pragma once

#include <map>
#include <set>
#include <string>

#include <fastdds/dds/domain/qos/DomainParticipantQos.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "idl/fast_dds.h"

/// Inside idl/ only.
namespace fdi::idl {

/// The QoS file of --qos. A profile overrides exactly the policies that it
/// states; the others stay as in qos.cpp, so that a file about reliability does
/// not reset the library's limit of ten valves.
///
/// Element names are those of Fast DDS XML: "reliability", "historyQos", ...
class ProfileFile {
 public:
  ProfileFile() = default;

  /// Reads `path` and loads it into the library, once per process.
  /// @throws ConfigError naming the file, and the profile or element, if it is
  ///   missing, invalid, or states a policy that cannot be overridden.
  explicit ProfileFile(const std::string& path);

  /// `qos` with the policies that the profile `name` states, if there is one.
  /// @throws TransportError
  dds::DataWriterQos Override(const std::string& name, dds::DataWriterQos qos,
                              const dds::Publisher& publisher) const;
  dds::DataReaderQos Override(const std::string& name, dds::DataReaderQos qos,
                              const dds::Subscriber& subscriber) const;

  /// The policies that the profile `name` states; nullptr if there is none.
  const std::set<std::string>* Stated(const std::string& name) const;

 private:
  std::map<std::string, std::set<std::string>> stated_;  // By profile.
};

inline constexpr const char* kParticipantProfile = "fdi_participant";

}  // namespace fdi::idl
