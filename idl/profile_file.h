#pragma once

#include <map>
#include <set>
#include <string>

namespace fdi::idl {

/// Which policies a QoS file states, by profile. A profile overrides exactly
/// what it states; all else stays as in qos.cpp, so that a file about
/// reliability does not bring back the library's limit of ten valves.
///
/// Element names as in Fast DDS XML: "reliability", "historyQos", "times", ...
class ProfileFile {
 public:
  ProfileFile() = default;

  /// Reads `path` and hands it to the library, once per process.
  /// @throws ConfigError naming the file, and the profile or element, if it is
  ///   missing, not XML, or states what cannot be overridden.
  explicit ProfileFile(const std::string& path);

  /// The policies stated by a data_writer or data_reader profile; nullptr if
  /// there is no such profile.
  const std::set<std::string>* Writer(const std::string& profile) const;
  const std::set<std::string>* Reader(const std::string& profile) const;
  /// Likewise of the participant profile kParticipantProfile.
  const std::set<std::string>* ParticipantPolicies() const;

 private:
  std::map<std::string, std::set<std::string>> writers_;
  std::map<std::string, std::set<std::string>> readers_;
  std::map<std::string, std::set<std::string>> participants_;
};

inline constexpr const char* kParticipantProfile = "fdi_participant";

}  // namespace fdi::idl
