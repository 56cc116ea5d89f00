#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "idl/participant.h"
#include "idl/wire.h"

namespace fdi::idl {

/// The QoS profile of a topic; both ends should agree.
enum class Profile {
  kLive,        ///< KEEP_LAST: keeps the newest, never waits for a reader.
  kLossless,    ///< KEEP_ALL: a slow reader slows the writer down.
  kBestEffort,  ///< ValveSample only: no retransmission.
};

struct PublisherOptions {
  Profile profile{Profile::kLive};
  int valves{0};  ///< Number of valves it publishes; 0: max_valves.
  /// Partitions to write to; "" is the default one, as is an empty list.
  std::vector<std::string> partitions{};
  /// A valve beyond this number takes the place of the one that was written
  /// longest ago, whose instance is disposed of; otherwise it is refused.
  bool replaces{false};
};

enum class WriteResult {
  kSent,
  kNotSent,        ///< Stopped or timed out while the reader was behind.
  kTooManyValves,  ///< Beyond PublisherOptions::valves.
};

struct PublisherStatus {
  std::uint64_t written{0};
  std::uint64_t retries{0};       ///< Times Write() waited for a full history.
  std::uint64_t refused{0};       ///< Writes answered with kTooManyValves.
  std::uint64_t incompatible{0};  ///< Readers with incompatible QoS.
  int matched{0};                 ///< Readers at present.
};

/// Writes one topic. Thread safe. Destroying it loses unacknowledged messages:
/// call WaitForAcknowledged() first.
///
/// Samples go out on two topics: fdi/v1/ValveSample and, for a valve from its
/// first PV on, fdi/v2/ValveSample. Where nobody reads version 2, or our key
/// does not permit it, they go out on version 1 without PV, which is logged
/// once. Readers count once.
///
/// Message is one of the eight of wire.h; no others are instantiated.
template <typename Message>
class Publisher {
 public:
  /// @throws TransportError if the library refuses the endpoint.
  explicit Publisher(Participant& participant,
                     const PublisherOptions& options = {});
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// Sends `message`. With kLossless it blocks until there is room, a stop is
  /// requested or `timeout` has passed; otherwise it does not block. The first
  /// PV of a valve may take a second.
  /// @throws DataError naming the field that is too long or out of range.
  WriteResult Write(
      const Message& message, std::stop_token stop = {},
      std::chrono::milliseconds timeout = std::chrono::milliseconds::max());

  /// Disposes the instance of `message` (for a valve: no more samples will
  /// follow). Only the key of `message` is used. Ignored if never written.
  void Dispose(const Message& message);
  /// Gives up the instance of `message`: it is disposed of, later readers get
  /// nothing of it, and its place is free once all readers have acknowledged
  /// that. Only the key of `message` is used. Ignored if never written.
  void Unregister(const Message& message);

  /// @returns whether at least `count` readers were matched in time.
  bool WaitForReaders(int count, std::chrono::milliseconds timeout) const;
  /// @returns whether all matched readers acknowledged everything in time.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout);
  PublisherStatus status() const;
  /// PublisherStatus::matched, at the cost of one atomic load.
  int matched() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Metadata of a received message.
struct Reception {
  std::int64_t sent_ns{0};          ///< UTC at the writer.
  std::int64_t received_ns{0};      ///< UTC here.
  std::uint64_t writer_id{0};       ///< Identifies the writer.
  std::uint64_t participant_id{0};  ///< Identifies the participant.
};

/// Outcome of the messages. None is lost silently.
struct SubscriberStatus {
  std::uint64_t received{0};  ///< Messages handed out.
  std::uint64_t ended{0};     ///< Ended instances handed out.
  /// Written since this subscriber exists and lost for good: overwritten by a
  /// live writer, or dropped on the way.
  std::uint64_t lost{0};
  std::uint64_t undecodable{0};  ///< Foreign data and unknown disposes.
  /// Lost messages of valves beyond max_valves, and the number of these valves
  /// (exact up to 65536).
  std::uint64_t rejected_instances{0};
  std::uint64_t refused_valves{0};
  /// Rejected while full: a reliable KEEP_ALL writer resends them, so this is
  /// back-pressure, not loss; messages that a live writer overwrites meanwhile
  /// are lost.
  std::uint64_t rejected_samples{0};
  std::uint64_t incompatible{0};  ///< Writers with incompatible QoS.
  std::uint64_t waiting{0};       ///< Messages queued for Take().
  int matched{0};  ///< Writers at present; for samples, publishers.
  int alive{0};    ///< Those of them that are alive.
};

/// Where the backlog of Take() is held once 16 MB are queued.
enum class Overflow {
  /// In the history of the library, which is scanned from the front for every
  /// message: slow beyond some thousand.
  kLibrary,
  /// On the wire: the participant stops receiving until there is room, and
  /// lossless writers wait. For a participant with this endpoint only, because
  /// its other endpoints receive nothing meanwhile, acknowledgements included.
  kOnTheWay,
};

template <typename Message>
struct Handlers {
  std::function<void(const Message&, const Reception&)> on_message;
  /// The publisher disposed this instance. Only the key of the message is set.
  std::function<void(const Message&, const Reception&)> on_ended;
};

/// Handlers that call `each` with every vector of a batch.
inline Handlers<DecisionBatchMessage> ForEachVector(
    std::function<void(const DecisionMessage&, const Reception&)> each) {
  return {[each = std::move(each)](const DecisionBatchMessage& batch,
                                   const Reception& reception) {
            for (const DecisionMessage& vector : batch.vectors) {
              each(vector, reception);
            }
          },
          {}};
}

/// Reads one topic, of samples both versions. Messages of one valve from one
/// writer are delivered in the order of writing; those of different valves as
/// they arrive, or valve by valve after a backlog. One thread calls Take();
/// status() and Interrupt() are thread safe.
template <typename Message>
class Subscriber {
 public:
  /// @param partitions to read, patterns as in fnmatch(); none: the default
  ///   one.
  /// @throws TransportError if the library refuses the endpoint.
  explicit Subscriber(Participant& participant,
                      Profile profile = Profile::kLive,
                      Overflow overflow = Overflow::kLibrary,
                      const std::vector<std::string>& partitions = {});
  ~Subscriber();
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  /// Delivers what has arrived, at most `limit` messages; if nothing has, waits
  /// up to `timeout` first. Messages that are not taken are queued, up to 16
  /// MB; beyond it writers wait (lossless) or overwrite (live). @returns the
  /// number of messages and disposes delivered.
  /// @throws what a handler throws; the next call continues with the next
  ///   message.
  int Take(const Handlers<Message>& handlers, std::chrono::milliseconds timeout,
           int limit = std::numeric_limits<int>::max());

  /// Makes the current Take(), or else the next one, return at once.
  void Interrupt();

  /// @returns whether at least `count` writers were matched in time.
  bool WaitForWriters(int count, std::chrono::milliseconds timeout) const;
  SubscriberStatus status() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

extern template class Publisher<ValveSampleMessage>;
extern template class Publisher<DecisionMessage>;
extern template class Publisher<DecisionBatchMessage>;
extern template class Publisher<FaultEvent>;
extern template class Publisher<ValveStateMessage>;
extern template class Publisher<ModelSetInfoMessage>;
extern template class Publisher<MonitorStatusMessage>;
extern template class Publisher<MonitorShare>;
extern template class Subscriber<ValveSampleMessage>;
extern template class Subscriber<DecisionMessage>;
extern template class Subscriber<DecisionBatchMessage>;
extern template class Subscriber<FaultEvent>;
extern template class Subscriber<ValveStateMessage>;
extern template class Subscriber<ModelSetInfoMessage>;
extern template class Subscriber<MonitorStatusMessage>;
extern template class Subscriber<MonitorShare>;

}  // namespace fdi::idl
