#include "gateway/mqtt_source.h"

#include <array>
#include <utility>

#include <nlohmann/json.hpp>

namespace fdi::gateway {
namespace {

using nlohmann::json;

constexpr std::string_view kSource = "mqtt";
constexpr std::size_t kMaxPayload = 64U << 10U;

// The member of this name, or else the first of the usual ones that is there.
const json* Find(const json& object, const std::string& key,
                 const std::array<const char*, 3>& usual) {
  if (!key.empty()) {
    const auto found = object.find(key);
    return found == object.end() ? nullptr : &*found;
  }
  for (const char* name : usual) {
    if (const auto found = object.find(name); found != object.end()) {
      return &*found;
    }
  }
  return nullptr;
}

std::vector<std::string> NamesOf(const auto& topics) {
  std::vector<std::string> names;
  for (const auto& [name, tags] : topics) {
    names.push_back(name);
  }
  return names;
}

}  // namespace

importer::Said ReadPayload(const LiveTopic& topic, std::string_view payload,
                           importer::StampReader& stamps, std::string& word) {
  importer::Said said;
  said.kind = importer::Said::Kind::kReading;
  said.reading.tag = topic.tag;
  said.reading.source = kSource;
  const auto refuse = [&](const std::string& why) {
    said.kind = importer::Said::Kind::kWrong;
    said.why = why + ": " + std::string(payload.substr(0, 60));
    return said;
  };
  if (payload.size() > kMaxPayload) {
    return refuse("a payload of more than 64 KiB");
  }
  const std::size_t first = payload.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) {
    said.reading.quality = SignalQuality::kBad;
    return said;
  }
  if (payload[first] != '{') {
    word =
        payload.substr(first, payload.find_last_not_of(" \t\r\n") + 1 - first);
    importer::SetValue(word, said.reading);
    return said;
  }
  const json object = json::parse(payload, nullptr, false);
  if (!object.is_object()) {
    return refuse("not a JSON object");
  }
  const json* const value =
      Find(object, topic.value_key, {"value", "v", "val"});
  if (value == nullptr) {
    // A payload of several signals need not have all of them.
    said.kind = topic.value_key.empty() ? importer::Said::Kind::kWrong
                                        : importer::Said::Kind::kNothing;
    said.why = "no key \"value\"; state its name in the row: value = \"...\"";
    return said;
  }
  if (value->is_number()) {
    said.reading.value = value->get<double>();
  } else if (value->is_null()) {
    said.reading.quality = SignalQuality::kBad;
  } else {
    word = value->is_string() ? value->get<std::string>() : value->dump();
    importer::SetValue(word, said.reading);
  }
  if (const json* const quality =
          Find(object, "", {"quality", "q", "status"})) {
    importer::SetQuality(
        quality->is_string() ? quality->get<std::string>() : quality->dump(),
        said.reading);
  }
  if (const json* const time =
          Find(object, topic.time_key, {"time", "ts", "t"})) {
    said.reading.stamp_ns =
        time->is_string()
            ? stamps.Read(time->get_ref<const std::string&>())
            : stamps.Read(time->is_number() ? time->get<double>() : -1.0);
    if (!said.reading.stamp_ns) {
      return refuse("its time is none");
    }
  }
  return said;
}

MqttSource::MqttSource(const MqttOptions& options, LogSink log)
    : client_(options, {}, std::move(log)) {
  client_.Start();
}

void MqttSource::Use(const LiveTable& table) {
  auto former = std::exchange(topics_, {});
  for (const LiveTopic& topic : table.topics) {
    topics_[topic.topic].push_back(topic);
  }
  // A topic that is as it was is left alone: its broker would send again what
  // it has retained.
  auto changed = topics_;
  std::erase_if(changed, [&](const auto& topic) {
    const auto before = former.find(topic.first);
    return before != former.end() && before->second == topic.second;
  });
  for (const auto& [name, tags] : topics_) {
    former.erase(name);
  }
  if (client_.connected()) {
    client_.Unsubscribe(NamesOf(former));
    client_.Subscribe(NamesOf(changed));
  }
}

bool MqttSource::Poll(std::chrono::milliseconds timeout,
                      const ReadingHandlers& handlers) {
  client_.Take(events_, timeout);
  for (const MqttEvent& event : events_) {
    switch (event.kind) {
      case MqttEvent::Kind::kConnected:
        client_.Subscribe(NamesOf(topics_));
        break;
      case MqttEvent::Kind::kLost:
        handlers.ended(kSource);
        break;
      case MqttEvent::Kind::kMessage:
        TakeMessage(event, handlers);
        break;
    }
  }
  return true;
}

void MqttSource::TakeMessage(const MqttEvent& event,
                             const ReadingHandlers& handlers) {
  const auto found = topics_.find(event.topic);
  if (found == topics_.end()) {
    return;  // It was on its way when the table changed.
  }
  for (const LiveTopic& topic : found->second) {
    const importer::Said said =
        ReadPayload(topic, event.payload, stamps_, word_);
    if (said.kind == importer::Said::Kind::kWrong) {
      handlers.wrong(event.topic, said.why);
      return;
    }
    if (said.kind == importer::Said::Kind::kReading &&
        (!event.retained || said.reading.stamp_ns)) {
      handlers.reading(said.reading);
    }
  }
}

}  // namespace fdi::gateway
