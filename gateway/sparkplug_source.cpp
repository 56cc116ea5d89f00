#include "gateway/sparkplug_source.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/time_text.h"
#include "import/reading_lines.h"

namespace fdi::gateway {
namespace {

using std::chrono::nanoseconds;

// Longer than a node takes to answer; short beside the hours of a plant.
constexpr std::chrono::seconds kAskAgain(10);
constexpr std::chrono::milliseconds kBeat(200);
// A birth of 10 000 metrics has 0.6 MB.
constexpr std::size_t kMaxBirth = 1U << 20U;
// These three bound the memory that made-up names and aliases take: 200 bytes a
// metric are 100 MB.
constexpr std::size_t kMaxTopic = 1024;
constexpr std::size_t kMaxSources = 10'000;
constexpr std::size_t kMaxMetrics = 500'000;
// By the specification; 0 is bad, 500 stale.
constexpr std::uint64_t kGoodQuality = 192;
// 2200-01-01 [ms]: stamps beyond it are that, which leaves room for sums.
constexpr std::uint64_t kLastStamp = 7'258'118'400'000;
constexpr const char* kAsked = "; a rebirth is asked for";

std::int64_t StampOf(std::uint64_t ms) {
  return static_cast<std::int64_t>(std::min(ms, kLastStamp)) * 1'000'000;
}

std::optional<std::uint64_t> BdSeqOf(const sparkplug::Payload& payload) {
  for (const sparkplug::Metric& metric : payload.metrics()) {
    if (metric.name() == "bdSeq") {
      return metric.has_long_value() ? metric.long_value() : metric.int_value();
    }
  }
  return std::nullopt;
}

bool IsGood(const sparkplug::Metric& metric) {
  const auto& keys = metric.properties().keys();
  const auto& values = metric.properties().values();
  const auto at = std::ranges::find(keys, "Quality") - keys.begin();
  if (at >= values.size()) {
    return true;
  }
  const sparkplug::PropertyValue& value = values[static_cast<int>(at)];
  return (value.has_long_value() ? value.long_value() : value.int_value()) ==
         kGoodQuality;
}

// Nothing if it has none. Integers with a sign are the two's complement of the
// width of their type.
std::optional<double> NumberOf(const sparkplug::Metric& metric,
                               std::uint32_t type) {
  switch (metric.value_case()) {
    case sparkplug::Metric::kFloatValue:
      return metric.float_value();
    case sparkplug::Metric::kDoubleValue:
      return metric.double_value();
    case sparkplug::Metric::kBoolValue:
      return metric.bool_value() ? 1.0 : 0.0;
    case sparkplug::Metric::kLongValue:
      return type == sparkplug::INT64
                 ? static_cast<double>(
                       static_cast<std::int64_t>(metric.long_value()))
                 : static_cast<double>(metric.long_value());
    case sparkplug::Metric::kIntValue:
      break;
    default:
      return std::nullopt;
  }
  const std::uint32_t bits = metric.int_value();
  return type == sparkplug::INT8    ? static_cast<std::int8_t>(bits)
         : type == sparkplug::INT16 ? static_cast<std::int16_t>(bits)
         : type == sparkplug::INT32 ? static_cast<std::int32_t>(bits)
                                    : static_cast<double>(bits);
}

std::string NameOf(const sparkplug::Metric& metric) {
  return metric.has_name()    ? metric.name()
         : metric.has_alias() ? "alias " + std::to_string(metric.alias())
                              : "a metric with no name and no alias";
}

// @returns why the metric is no reading.
std::string Convert(const sparkplug::Metric& metric, std::uint32_t type,
                    importer::TagReading& reading) {
  if (metric.historical()) {
    return "it is historical, and no reading of now";
  }
  const bool text = type == sparkplug::STRING || type == sparkplug::TEXT;
  const bool null =
      metric.null() || metric.value_case() == sparkplug::Metric::VALUE_NOT_SET;
  if (type > sparkplug::TEXT || type == sparkplug::DATE_TIME ||
      (!null && text != metric.has_string_value())) {
    return "data type " + std::to_string(type) +
           " is neither number nor text, or the value is not of that type";
  }
  if (text && !null) {
    importer::SetValue(metric.string_value(), reading);
  } else {
    reading.value = NumberOf(metric, type);
  }
  if (null || !IsGood(metric)) {
    reading.quality = SignalQuality::kBad;
  }
  return {};
}

}  // namespace

SparkplugHost::SparkplugHost(const std::string& group, nanoseconds lag,
                             std::function<void(const Outgoing&)> send)
    : prefix_("spBv1.0/" + group + "/"), lag_(lag), send_(std::move(send)) {}

void SparkplugHost::Use(std::set<std::string, std::less<>> tags) {
  tags_ = std::move(tags);
  owners_.clear();
}

void SparkplugHost::Greet(Clock::time_point now) {
  for (auto& [name, node] : nodes_) {
    node.asked.reset();
    Ask(name, node, now);
  }
}

// Beat() asks a node again that does not answer.
void SparkplugHost::Ask(const std::string& name, Node& node,
                        Clock::time_point now) {
  node.wanted = true;
  if (node.asked && now - *node.asked < kAskAgain) {
    return;
  }
  node.asked = now;
  sparkplug::Payload payload;
  payload.set_stamp(static_cast<std::uint64_t>(NowNs() / 1'000'000));
  sparkplug::Metric& metric = *payload.add_metrics();
  metric.set_name("Node Control/Rebirth");
  metric.set_stamp(payload.stamp());
  metric.set_type(sparkplug::BOOLEAN);
  metric.set_bool_value(true);
  send_({prefix_ + "NCMD/" + name, payload.SerializeAsString(), false, 0});
}

void SparkplugHost::Take(const MqttEvent& event, Clock::time_point now,
                         const ReadingHandlers& handlers) {
  static constexpr std::array<std::string_view, 6> kTypes{
      "NBIRTH", "NDATA", "NDEATH", "DBIRTH", "DDATA", "DDEATH"};
  std::string_view rest = event.topic;
  rest.remove_prefix(std::min(prefix_.size(), rest.size()));
  Message message;
  message.type = rest.substr(0, rest.find('/'));
  if (std::ranges::find(kTypes, message.type) == kTypes.end()) {
    return;  // A command, or the state of another host.
  }
  message.source = rest.substr(std::min(message.type.size() + 1, rest.size()));
  std::string why = Read(event, message);
  if (!why.empty()) {
    handlers.wrong(event.topic, why);
    return;
  }
  if (nodes_.size() >= kMaxSources && !nodes_.contains(message.node)) {
    std::erase_if(nodes_, [](const auto& node) { return !node.second.born; });
  }
  Node& node = nodes_[message.node];
  bool ask = false;
  if (why = Follow(message, node, handlers); !why.empty()) {
    ask = message.type != "NDEATH";
    handlers.wrong(ask ? message.node : event.topic,
                   ask ? message.source + ": " + why : why);
  } else if (const auto source = sources_.find(message.source);
             source != sources_.end()) {
    source->second.stamp_ns = message.payload.has_stamp()
                                  ? StampOf(message.payload.stamp())
                                  : NowNs();
    source->second.heard = now;
    ask = !Tell(message, source->second, handlers);
  }
  if (ask) {
    Ask(message.node, node, now);
  }
}

// @returns why the message cannot be read.
std::string SparkplugHost::Read(const MqttEvent& event,
                                Message& message) const {
  message.node = message.source.substr(0, message.source.find('/'));
  const auto slashes = std::ranges::count(message.source, '/');
  if (message.node.empty() || event.topic.size() > kMaxTopic ||
      slashes != (message.type.front() == 'D' ? 1 : 0)) {
    return "no topic of Sparkplug B of up to 1 KiB";
  }
  if (event.retained) {
    return "the broker had kept it, and nobody knows whether it stands";
  }
  if (event.payload.size() > kMaxBirth ||
      !message.payload.ParseFromString(event.payload)) {
    return "no payload of Sparkplug B of up to 1 MiB";
  }
  if (sources_.size() >= kMaxSources && !sources_.contains(message.source)) {
    return "there are 10 000 nodes and devices already";
  }
  return {};
}

// Births, deaths and the order of messages.
// @returns why the message cannot be used.
std::string SparkplugHost::Follow(const Message& message, Node& node,
                                  const ReadingHandlers& handlers) {
  const sparkplug::Payload& payload = message.payload;
  if (message.type == "NDEATH") {
    const auto bd_seq = BdSeqOf(payload);
    if (node.born && node.bd_seq && bd_seq != node.bd_seq) {
      return "its bdSeq is not that of the birth, " +
             std::to_string(*node.bd_seq) + ": another connection died";
    }
    EndNode(message.node, node, handlers.ended);
    node.wanted = false;  // Nobody is there to answer.
    return {};
  }
  std::string why;
  if (message.type == "NBIRTH") {
    // Devices give birth after their node. One that does not falls silent.
    EndNode(message.node, node, {});
    node.born = true;
    node.wanted = false;
    node.bd_seq = BdSeqOf(payload);
  } else if (!node.born) {
    why = "no NBIRTH has come";
  } else if (payload.has_seq() && payload.seq() != node.next_seq) {
    why = "seq " + std::to_string(payload.seq()) + " instead of " +
          std::to_string(node.next_seq) + ": a message is missing";
  } else if (message.type == "DDATA" && !sources_.contains(message.source)) {
    why = "no DBIRTH has come";
  }
  if (why.empty() && message.type.ends_with("BIRTH") && !Learn(message)) {
    why = "the group has more than 500 000 metrics";
  }
  if (!why.empty()) {
    // A change may have been missed: its births count no more. Without new
    // ones its sources fall silent.
    EndNode(message.node, node, {});
    return why + kAsked;
  }
  node.next_seq =
      ((payload.has_seq() ? payload.seq() : node.next_seq) + 1) % 256;
  if (message.type == "DDEATH") {
    Forget(message.source, message.source, {});
    handlers.ended(message.source);
  }
  return {};
}

void SparkplugHost::EndNode(const std::string& name, Node& node,
                            const Ended& ended) {
  node.born = false;
  Forget(name, name, ended);
  Forget(name + '/', name + "/\xFF", ended);  // Names are UTF-8: no 0xFF.
}

// The sources from `first` to `last`, both included.
void SparkplugHost::Forget(const std::string& first, const std::string& last,
                           const Ended& ended) {
  auto at = sources_.lower_bound(first);
  while (at != sources_.end() && at->first <= last) {
    kept_ -= at->second.size();
    if (ended) {
      ended(at->first);
    }
    at = sources_.erase(at);
  }
}

void SparkplugHost::Lose(const ReadingHandlers& handlers) {
  for (auto& [name, node] : nodes_) {
    EndNode(name, node, handlers.ended);
  }
}

std::string SparkplugHost::TagOf(const std::string& source,
                                 const std::string& name) const {
  std::string tag = source + '/' + name;
  while (!tags_.contains(tag)) {
    if (tag.size() <= name.size()) {
      return {};
    }
    tag.erase(0, tag.find('/') + 1);
  }
  return tag;
}

// @returns false if there are too many metrics with it.
bool SparkplugHost::Learn(const Message& message) {
  Forget(message.source, message.source, {});
  Source& source = sources_[message.source];
  for (const sparkplug::Metric& metric : message.payload.metrics()) {
    const std::string tag = TagOf(message.source, metric.name());
    if (!tag.empty()) {
      source.metrics[metric.name()] = {tag, metric.type()};
    }
    if (metric.has_alias()) {
      source.names[metric.alias()] = tag.empty() ? "" : metric.name();
    }
  }
  kept_ += source.size();
  return kept_ <= kMaxMetrics;
}

// False if another source that lives has the tag.
bool SparkplugHost::Owns(const std::string& source, const std::string& tag) {
  std::string& owner = owners_[tag];
  if (owner != source && !sources_.contains(owner)) {
    owner = source;
  }
  return owner == source;
}

// @returns false if a metric with a tag or an alias is none of the birth.
bool SparkplugHost::Tell(const Message& message, const Source& source,
                         const ReadingHandlers& handlers) {
  bool known = true;
  const sparkplug::Payload& payload = message.payload;
  const bool birth = message.type.ends_with("BIRTH");
  for (const sparkplug::Metric& metric : payload.metrics()) {
    const auto alias = metric.has_alias() ? source.names.find(metric.alias())
                                          : source.names.end();
    const bool has_alias = alias != source.names.end();
    const auto found = source.metrics.find(
        metric.has_name() || !has_alias ? metric.name() : alias->second);
    if (found == source.metrics.end()) {
      // A metric without a tag is kept by its alias only.
      const bool skip =
          birth ||
          (metric.has_name() ? TagOf(message.source, metric.name()).empty()
                             : has_alias);
      if (!skip) {
        handlers.wrong(message.source,
                       NameOf(metric) + " is none of its birth" + kAsked);
        known = false;
      }
      continue;
    }
    const auto& [tag, type] = found->second;
    importer::TagReading reading;
    reading.tag = tag;
    reading.source = message.source;
    // A birth says what stands now, whenever it last changed.
    if (payload.has_stamp() || metric.has_stamp()) {
      reading.stamp_ns =
          StampOf((birth && payload.has_stamp()) || !metric.has_stamp()
                      ? payload.stamp()
                      : metric.stamp());
    }
    std::string why = Convert(metric, type, reading);
    if (!Owns(message.source, tag)) {
      why = owners_[tag] + " and " + message.source +
            " have it; write NODE/DEVICE/METRIC in the table";
    }
    if (why.empty()) {
      handlers.reading(reading);
    } else {
      handlers.wrong(tag, why);
    }
  }
  return known;
}

void SparkplugHost::Beat(Clock::time_point now,
                         const ReadingHandlers& handlers) {
  if (now - beat_ < kBeat) {
    return;
  }
  beat_ = now;
  for (auto& [name, node] : nodes_) {
    if (node.wanted) {
      Ask(name, node, now);
    }
  }
  for (const auto& [name, source] : sources_) {
    if (!source.metrics.empty()) {
      const nanoseconds since = now - source.heard - lag_;
      handlers.alive(name, source.stamp_ns + since.count());
    }
  }
}

// A half of the lateness leaves the other half for stamps that differ.
SparkplugSource::SparkplugSource(const MqttOptions& options,
                                 nanoseconds lateness, LogSink log)
    : host_(options.sparkplug, lateness / 2,
            [this](const Outgoing& message) { client_.Publish(message); }),
      client_(options, {}, std::move(log)) {
  client_.Start();
}

// A birth says the values of tags that are new in the table.
void SparkplugSource::Use(const LiveTable& table) {
  host_.Use(TagsOf(table));
  host_.Greet(SparkplugHost::Clock::now());
}

bool SparkplugSource::Poll(std::chrono::milliseconds timeout,
                           const ReadingHandlers& handlers) {
  client_.Take(events_, timeout);
  const auto now = SparkplugHost::Clock::now();
  for (const MqttEvent& event : events_) {
    if (event.kind == MqttEvent::Kind::kMessage) {
      host_.Take(event, now, handlers);
    } else if (event.kind == MqttEvent::Kind::kLost) {
      host_.Lose(handlers);
    } else {
      client_.Subscribe({host_.topics()});
      host_.Greet(now);
    }
  }
  host_.Beat(now, handlers);
  return true;
}

}  // namespace fdi::gateway
