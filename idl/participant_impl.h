#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include "base/mutex.h"
#include "idl/fast_dds.h"
#include "idl/interfaces.h"
#include "idl/participant.h"
#include "idl/profile_file.h"
#include "idl/qos.h"
#include "idl/security/key_folder.h"

/// Inside idl/ only: shared by the endpoints of a participant.
namespace fdi::idl {

/// @throws TransportError naming `operation` unless `code` is RETCODE_OK.
void Check(const ReturnCode& code, const std::string& operation);

/// `handle`, or @throws TransportError naming `operation` if it is null.
template <typename Handle>
Handle* NotNull(Handle* handle, const std::string& operation) {
  if (handle == nullptr) {
    Check(return_code::RETCODE_ERROR, operation);
  }
  return handle;
}

/// Current UTC time.
inline std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// `timeout` from now; limited to a year to avoid overflow.
inline std::chrono::steady_clock::time_point DeadlineIn(
    std::chrono::milliseconds timeout) {
  const std::chrono::milliseconds longest = std::chrono::hours(24 * 365);
  return std::chrono::steady_clock::now() + std::min(timeout, longest);
}

/// Number of matched remote endpoints: set by a callback, awaited by other
/// threads.
class Matched {
 public:
  void Set(int count) {
    {
      const MutexLock lock(mutex_);
      count_.store(count);
    }
    changed_.notify_all();
  }

  int count() const { return count_.load(); }

  bool WaitFor(int count, std::chrono::milliseconds timeout) const {
    MutexLock lock(mutex_);
    return changed_.wait_until(lock, DeadlineIn(timeout),
                               [&] { return count_.load() >= count; });
  }

 private:
  mutable Mutex mutex_;
  mutable CondVar changed_;
  std::atomic<int> count_{0};
};

/// While an object exists, the DDS library's log goes to its `sink`, at most
/// one line per source location in 10 s; with several objects, to the newest.
/// Once one has existed, the library never writes to stdout.
class LibraryLog {
 public:
  explicit LibraryLog(LogSink sink);
  ~LibraryLog();
  LibraryLog(const LibraryLog&) = delete;
  LibraryLog& operator=(const LibraryLog&) = delete;

 private:
  LogSink sink_;
};

/// A participant's state of received datagrams: counts by verdict, and
/// positions of the writers. Thread safe.
class DatagramLog {
 public:
  explicit DatagramLog(LogSink log) : log_(std::move(log)) {}

  /// @param sender shown in the log.
  void Count(DatagramVerdict verdict, std::size_t bytes,
             const rtps::Locator_t& sender);
  DatagramCounts counts() const;
  WriterPace& pace() { return pace_; }
  AckCounts& acks() { return acks_; }

 private:
  LogSink log_;
  WriterPace pace_;
  AckCounts acks_;
  std::array<std::atomic<std::uint64_t>, kDatagramVerdictCount> counts_{};
};

/// The implementation of Participant, with the library's handle.
class Participant::Impl : private dds::DomainParticipantListener {
 public:
  Impl(const DdsOptions& options, LogSink log, const std::string& name);
  ~Impl() override;
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  /// The topic called `topic`, created with its type at first use; lives as
  /// long as the participant.
  dds::Topic* TopicOf(const std::string& topic, const dds::TypeSupport& type);

  /// Logs that policy `id` of a remote endpoint on `topic` is incompatible with
  /// ours, showing both sides.
  void ReportIncompatible(const std::string& topic, bool remote_is_writer,
                          dds::QosPolicyId_t id, const PolicyTexts& ours);

  /// True if our key permits `topic`, one of version 2. The first time that it
  /// does not, because it was made before, is logged and counted in
  /// RefusedPermissions().
  bool PermitsPv(const char* topic);

  void Log(LogLevel level, const std::string& line) const {
    if (log_) {
      log_(level, line);
    }
  }

  dds::DomainParticipant* operator->() { return handle_; }
  const DdsOptions& options() const { return options_; }
  const ProfileFile& profiles() const { return profiles_; }
  DatagramCounts datagrams() const { return datagrams_->counts(); }
  std::uint64_t refused_participants() const { return refused_; }
  void RequireInterfaces() const {
    if (interfaces_) {
      interfaces_->Require();
    }
  }

 private:
  using RemoteKey = std::pair<std::string, bool>;  // Topic, is a writer.

  void onParticipantAuthentication(
      dds::DomainParticipant* participant,
      rtps::ParticipantAuthenticationInfo&& info) override;
#if FDI_FAST_DDS == 2
  void on_publisher_discovery(dds::DomainParticipant* participant,
                              rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(dds::DomainParticipant* participant,
                               rtps::ReaderDiscoveryInfo&& info) override;
#else
  void on_data_writer_discovery(dds::DomainParticipant* participant,
                                rtps::WriterDiscoveryStatus status,
                                const RemoteWriterQos& info,
                                bool& should_be_ignored) override;
  void on_data_reader_discovery(dds::DomainParticipant* participant,
                                rtps::ReaderDiscoveryStatus status,
                                const RemoteReaderQos& info,
                                bool& should_be_ignored) override;
#endif
  void StorePolicies(const RemoteKey& key, PolicyTexts texts);

  DdsOptions options_;
  LogSink log_;
  LibraryLog library_log_;
  std::shared_ptr<DatagramLog> datagrams_;  // Shared with the transports.
  ProfileFile profiles_;
  std::optional<KeyInfo> key_;  // None: the bus is not secured.
  std::atomic<bool> told_of_key_{false};
  std::atomic<std::uint64_t> refused_{0};
  Mutex remotes_mutex_;
  std::map<RemoteKey, std::deque<PolicyTexts>> remotes_
      GUARDED_BY(remotes_mutex_);  // Newest first.
  std::deque<rtps::GUID_t> refused_guids_
      GUARDED_BY(remotes_mutex_);  // Newest first.
  Mutex topics_mutex_;             // Separate: held during library calls.
  std::map<std::string, dds::Topic*> topics_ GUARDED_BY(topics_mutex_);
  dds::DomainParticipant* handle_{nullptr};
  std::optional<Interfaces> interfaces_;  // None: only shared memory.
};

}  // namespace fdi::idl
