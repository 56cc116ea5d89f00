#pragma once

#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include "idl/library_log.h"
#include "idl/participant.h"
#include "idl/profile_file.h"
#include "idl/qos_report.h"

/// Inside idl/ only.
namespace fdi::idl {

using ReturnCode = eprosima::fastrtps::types::ReturnCode_t;

/// @throws TransportError naming `operation` unless `code` is RETCODE_OK.
void Check(const ReturnCode& code, const std::string& operation);

/// `handle`, or @throws TransportError naming `operation` if it is null.
template <typename Handle>
Handle* NotNull(Handle* handle, const std::string& operation) {
  if (handle == nullptr) {
    Check(ReturnCode::RETCODE_ERROR, operation);
  }
  return handle;
}

class Participant::Impl
    : private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  Impl(const DdsOptions& options, LogSink log, const std::string& name);
  ~Impl() override;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// The topic called `topic`, made with its type at first use; lives as long
  /// as the participant.
  eprosima::fastdds::dds::Topic* TopicOf(
      const std::string& topic,
      const eprosima::fastdds::dds::TypeSupport& type);

  void Log(LogLevel level, const std::string& line) const;

  /// Logs that policy `id` of a remote endpoint on `topic` is incompatible with
  /// ours, with both sides.
  void ReportIncompatible(const std::string& topic, bool remote_is_writer,
                          eprosima::fastdds::dds::QosPolicyId_t id,
                          const PolicyTexts& ours);

  eprosima::fastdds::dds::DomainParticipant* operator->() { return handle_; }
  const DdsOptions& options() const { return options_; }
  const ProfileFile& profiles() const { return profiles_; }

 private:
  using RemoteKey = std::pair<std::string, bool>;  // Topic, is a writer.

  void on_publisher_discovery(
      eprosima::fastdds::dds::DomainParticipant* participant,
      eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(
      eprosima::fastdds::dds::DomainParticipant* participant,
      eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  void Remember(const RemoteKey& key, PolicyTexts texts);

  DdsOptions options_;
  LogSink log_;
  LibraryLog library_log_;
  ProfileFile profiles_;
  std::mutex remotes_mutex_;
  std::map<RemoteKey, std::deque<PolicyTexts>> remotes_;  // Newest first.
  std::mutex topics_mutex_;  // Apart, for it is held in calls of the library.
  std::map<std::string, eprosima::fastdds::dds::Topic*> topics_;
  eprosima::fastdds::dds::DomainParticipant* handle_{nullptr};
};

}  // namespace fdi::idl
