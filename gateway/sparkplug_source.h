#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "gateway/mqtt_client.h"
#include "gateway/reading_source.h"
#include "gateway/sparkplug.pb.h"

namespace fdi::gateway {

/// Follows the edge nodes of a Sparkplug group and makes readings of their
/// metrics. A node or device is a source, "NODE" or "NODE/DEVICE": it lives
/// from its birth to its death, and its values stand meanwhile.
///
/// The tag of a metric is NODE/DEVICE/METRIC, DEVICE/METRIC or METRIC, the
/// first of them that the table has. Metrics without a tag are skipped.
///
/// A node of which a message is missing is not believed before its next birth,
/// which is asked for until it comes. One thread.
class SparkplugHost {
 public:
  using Clock = std::chrono::steady_clock;

  /// @param lag how far behind its clock a source that says nothing is taken to
  ///   be unchanged: a message may be on its way.
  /// @param send publishes a command.
  SparkplugHost(const std::string& group, std::chrono::nanoseconds lag,
                std::function<void(const Outgoing&)> send);

  /// Takes another set of tags.
  void Use(std::set<std::string, std::less<>> tags);
  void Take(const MqttEvent& message, Clock::time_point now,
            const ReadingHandlers& handlers);
  /// Tells which sources live, and asks for births that have not come. Call it
  /// often.
  void Beat(Clock::time_point now, const ReadingHandlers& handlers);
  /// The connection to the broker is lost: so is what all nodes said.
  void Lose(const ReadingHandlers& handlers);
  /// Asks all nodes for a birth, at once.
  void Greet(Clock::time_point now);

  std::string topics() const { return prefix_ + "#"; }

 private:
  struct Node {
    bool born{false};
    std::optional<std::uint64_t> bd_seq;
    std::uint64_t next_seq{0};
    std::optional<Clock::time_point> asked;
    bool wanted{false};  // From asking for a birth to its coming.
  };
  struct Metric {
    std::string tag;
    std::uint32_t type{0};
  };
  struct Source {
    std::unordered_map<std::string, Metric> metrics;  // With a tag, by name.
    // All of the birth, by alias; empty without a tag.
    std::unordered_map<std::uint64_t, std::string> names;
    std::int64_t stamp_ns{0};  // Its clock when it was heard last.
    Clock::time_point heard;
    std::size_t size() const { return metrics.size() + names.size(); }
  };
  struct Message {
    std::string_view type;
    std::string source;
    std::string node;
    sparkplug::Payload payload;
  };
  std::string Read(const MqttEvent& event, Message& message) const;
  std::string Follow(const Message& message, Node& node,
                     const ReadingHandlers& handlers);
  bool Learn(const Message& message);
  bool Tell(const Message& message, const Source& source,
            const ReadingHandlers& handlers);
  std::string TagOf(const std::string& source, const std::string& name) const;
  bool Owns(const std::string& source, const std::string& tag);
  using Ended = std::function<void(std::string_view)>;
  void EndNode(const std::string& name, Node& node, const Ended& ended);
  void Forget(const std::string& first, const std::string& last,
              const Ended& ended);
  void Ask(const std::string& name, Node& node, Clock::time_point now);

  std::string prefix_;
  std::chrono::nanoseconds lag_;
  std::function<void(const Outgoing&)> send_;
  std::set<std::string, std::less<>> tags_;
  std::map<std::string, Node> nodes_;
  std::map<std::string, Source> sources_;  // Nodes and devices that live.
  std::size_t kept_{0};                    // The sum of their sizes.
  std::unordered_map<std::string, std::string> owners_;  // Sources, by tag.
  Clock::time_point beat_;
};

/// Readings from the Sparkplug nodes of a broker.
class SparkplugSource final : public ReadingSource {
 public:
  /// @throws as MqttClient.
  SparkplugSource(const MqttOptions& options, std::chrono::nanoseconds lateness,
                  LogSink log);

  bool Poll(std::chrono::milliseconds timeout,
            const ReadingHandlers& handlers) override;
  void Use(const LiveTable& table) override;
  std::uint64_t dropped() const override { return client_.dropped(); }

 private:
  SparkplugHost host_;
  MqttClient client_;
  std::vector<MqttEvent> events_;
};

}  // namespace fdi::gateway
