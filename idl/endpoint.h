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

/// Which QoS of the topic; both ends of a topic should agree.
enum class Profile {
  kLive,        ///< Of system.md: keeps the newest, never waits for a reader.
  kLossless,    ///< KEEP_ALL: a slow reader slows the writer down.
  kBestEffort,  ///< ValveSample only: no retransmission.
};

struct PublisherOptions {
  Profile profile{Profile::kLive};
  int valves{0};  ///< How many this publisher speaks for; 0: max_valves.
  /// Where it writes; "" is the usual partition, and none means that one.
  std::vector<std::string> partitions{};
};

enum class WriteResult {
  kSent,
  kNotSent,        ///< Stopped or timed out while the reader was behind.
  kTooManyValves,  ///< Beyond PublisherOptions::valves.
};

struct PublisherStatus {
  std::uint64_t written{0};
  std::uint64_t retries{0};       ///< Times a full history made Write() wait.
  std::uint64_t refused{0};       ///< Writes answered with kTooManyValves.
  std::uint64_t incompatible{0};  ///< Readers with a QoS that cannot be met.
  int matched{0};                 ///< Readers now.
};

/// Writes one topic. Thread safe. What is on the way when it is destroyed is
/// lost: call WaitForAcknowledged() first.
///
/// Message is one of the nine of wire.h; there are no others.
template <typename Message>
class Publisher {
 public:
  /// @throws TransportError if the library refuses the endpoint.
  explicit Publisher(Participant& participant,
                     const PublisherOptions& options = {});
  ~Publisher();
  Publisher(const Publisher&) = delete;
  Publisher& operator=(const Publisher&) = delete;

  /// Sends `message`. With kLossless it waits until there is room, a stop is
  /// requested or `timeout` has passed; otherwise it does not wait.
  /// @throws DataError naming what in `message` is too long or out of range.
  WriteResult Write(
      const Message& message, std::stop_token stop = {},
      std::chrono::milliseconds timeout = std::chrono::milliseconds::max());

  /// Ends the stream of the instance of `message` (for a valve: no samples will
  /// follow). Only the key of `message` counts. Nothing if never written.
  void Dispose(const Message& message);

  /// @returns whether at least `count` readers are matched in time.
  bool WaitForReaders(int count, std::chrono::milliseconds timeout) const;
  /// @returns whether all matched readers have all that was written in time.
  bool WaitForAcknowledged(std::chrono::milliseconds timeout);
  PublisherStatus status() const;
  /// PublisherStatus::matched, at the cost of one load.
  int matched() const;
  /// Readers that came since the start, gone or not.
  int came() const;
  /// Readers that come from now on are not given what was written before.
  void Forget();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What DDS says about a received message.
struct Reception {
  std::int64_t sent_ns{0};          ///< UTC at the writer.
  std::int64_t received_ns{0};      ///< UTC here.
  std::uint64_t writer_id{0};       ///< Differs between writers of one domain.
  std::uint64_t participant_id{0};  ///< The same for all of one participant.
};

/// What became of the messages. Nothing is lost in silence.
struct SubscriberStatus {
  std::uint64_t received{0};  ///< Messages handed out.
  std::uint64_t ended{0};     ///< Ended instances handed out.
  /// Written since this subscriber exists, and will never come: overwritten by
  /// a live writer, or dropped on the way.
  std::uint64_t lost{0};
  std::uint64_t undecodable{0};  ///< What we never send, and unknown ends.
  /// Messages of valves beyond max_valves: lost, and how many valves (exact
  /// up to 65536).
  std::uint64_t rejected_instances{0};
  std::uint64_t refused_valves{0};
  /// Full: sent again by a reliable KEEP_ALL writer, so back-pressure rather
  /// than loss; what a live writer overwrites meanwhile is counted as lost.
  std::uint64_t rejected_samples{0};
  std::uint64_t incompatible{0};  ///< Writers that offer less than is asked.
  std::uint64_t waiting{0};       ///< Messages that Take() is behind with.
  int matched{0};                 ///< Writers now.
  int alive{0};                   ///< Of these, writers that show life.
};

/// Where messages are that Take() is behind with, once 16 MB wait for it.
enum class Overflow {
  /// In the history of the library, which it searches from the front with every
  /// message that comes: slow beyond some thousand.
  kLibrary,
  /// On the way: nothing is received until there is room, and lossless writers
  /// wait. For a participant with this endpoint alone: no other one of it
  /// receives meanwhile, acknowledgements included.
  kOnTheWay,
};

template <typename Message>
struct Handlers {
  std::function<void(const Message&, const Reception&)> on_message;
  /// The publisher ended this instance. Only the key of the message is set.
  std::function<void(const Message&, const Reception&)> on_ended;
};

/// Handlers that call `each` with every vector of a batch.
inline Handlers<DecisionBatchMessage> EachVector(
    std::function<void(const DecisionMessage&, const Reception&)> each) {
  return {[each = std::move(each)](const DecisionBatchMessage& batch,
                                   const Reception& reception) {
            for (const DecisionMessage& vector : batch.vectors) {
              each(vector, reception);
            }
          },
          {}};
}

/// Reads one topic. The messages of one valve from one writer come in the order
/// of writing; those of different valves as they arrive, or valve by valve
/// where many have waited. One thread takes; status() and Interrupt() are
/// thread safe.
template <typename Message>
class Subscriber {
 public:
  /// @param partitions where to read, patterns as of fnmatch(); none: the
  ///   usual one.
  /// @throws TransportError if the library refuses the endpoint.
  explicit Subscriber(Participant& participant,
                      Profile profile = Profile::kLive,
                      Overflow overflow = Overflow::kLibrary,
                      const std::vector<std::string>& partitions = {});
  ~Subscriber();
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  /// Hands out what has arrived, at most `limit`; if nothing has, waits up to
  /// `timeout` first. What is not taken waits here, up to 16 MB; from then on
  /// the writers wait (lossless) or overwrite (live).
  /// @returns how many messages and ends were handed out.
  /// @throws what a handler throws; the next message comes with the next call.
  int Take(const Handlers<Message>& handlers, std::chrono::milliseconds timeout,
           int limit = std::numeric_limits<int>::max());

  /// Makes a Take() that waits, or the next one, return at once.
  void Interrupt();

  /// @returns whether at least `count` writers are matched in time.
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
extern template class Publisher<ModelSetInfoMessage>;
extern template class Publisher<MonitorStatusMessage>;
extern template class Publisher<PairState>;
extern template class Publisher<OperatorAction>;
extern template class Publisher<MonitorShare>;
extern template class Subscriber<ValveSampleMessage>;
extern template class Subscriber<DecisionMessage>;
extern template class Subscriber<DecisionBatchMessage>;
extern template class Subscriber<FaultEvent>;
extern template class Subscriber<ModelSetInfoMessage>;
extern template class Subscriber<MonitorStatusMessage>;
extern template class Subscriber<PairState>;
extern template class Subscriber<OperatorAction>;
extern template class Subscriber<MonitorShare>;

}  // namespace fdi::idl
