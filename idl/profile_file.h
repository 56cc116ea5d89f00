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
/// states; all others stay as in qos.cpp, so that a file about reliability does
/// not bring back the library's limit of ten valves.
///
/// Element names are those of Fast DDS XML: "reliability", "historyQos", ...
class ProfileFile {
 public:
  ProfileFile() = default;

  /// Reads `path` and hands it to the library, once per process.
  /// @throws ConfigError naming the file, and the profile or element, if it is
  ///   missing, not XML, or states what cannot be overridden.
  explicit ProfileFile(const std::string& path);

  /// `qos` with what the profile `name` states in its place, if there is one.
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
