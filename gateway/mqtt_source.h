#pragma once

#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "gateway/mqtt_client.h"
#include "gateway/reading_source.h"
#include "import/reading_lines.h"

namespace fdi::gateway {

/// Reads the payload of a topic: a number or a word, or JSON with the keys of
/// the topic. The texts of the result are those of `payload` or of `word`.
importer::Said ReadPayload(const LiveTopic& topic, std::string_view payload,
                           importer::StampReader& stamps, std::string& word);

/// Readings from a broker: a topic for each tag. One source, "mqtt": its
/// connection. That the connection lives tells nothing of the devices behind
/// the broker, which is why its tags are periodic unless their row says
/// otherwise.
///
/// A message that the broker had kept (retained) counts only with a time of its
/// own: otherwise nobody knows how old it is.
class MqttSource final : public ReadingSource {
 public:
  /// @throws as MqttClient.
  MqttSource(const MqttOptions& options, LogSink log);

  bool Poll(std::chrono::milliseconds timeout,
            const ReadingHandlers& handlers) override;
  void Use(const LiveTable& table) override;
  std::uint64_t dropped() const override { return client_.dropped(); }

 private:
  void TakeMessage(const MqttEvent& event, const ReadingHandlers& handlers);

  MqttClient client_;
  std::unordered_map<std::string, std::vector<LiveTopic>> topics_;
  std::vector<MqttEvent> events_;
  importer::StampReader stamps_;
  std::string word_;
};

}  // namespace fdi::gateway
