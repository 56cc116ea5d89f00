#include "gateway/sparkplug_node.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

#include "base/time_text.h"
#include "diagnosis/model/severity.h"
#include "gateway/valve_states.h"

namespace fdi::gateway {
namespace {

using report::Json;
using sparkplug::Payload;

constexpr std::int64_t kNsPerMs = 1'000'000;

// DeviceHealthEnumeration of OPC 10000-100 by its numbers.
constexpr std::array<std::string_view, 5> kHealths{
    "NORMAL", "FAILURE", "CHECK_FUNCTION", "OFF_SPEC", "MAINTENANCE_REQUIRED"};
// 250 to 1000 in equal steps, as gateway/opcua/valves.mjs has them.
constexpr int kSeverityStep = 250;

// The metrics, and the keys of the state that they show.
struct Shown {
  const char* name;
  sparkplug::DataType type;
  const char* key;
};
constexpr std::array<Shown, 9> kShown{{
    {"DeviceHealth", sparkplug::INT32, "health"},
    {"Description", sparkplug::STRING, "description"},
    {"Fault", sparkplug::STRING, "fault"},
    {"FaultName", sparkplug::STRING, "name"},
    {"Certainty", sparkplug::STRING, "certainty"},
    {"Strength", sparkplug::DOUBLE, "strength_pct"},
    {"Severity", sparkplug::UINT16, "priority"},
    {"Since", sparkplug::DATE_TIME, "since_utc"},
    {"Check", sparkplug::STRING, "check"},
}};

sparkplug::Metric& AddMetric(const char* name, sparkplug::DataType type,
                             Payload& payload) {
  sparkplug::Metric& metric = *payload.add_metrics();
  metric.set_name(name);
  metric.set_type(type);
  return metric;
}

void Show(const Json& state, const Shown& shown, Payload& payload) {
  sparkplug::Metric& metric = AddMetric(shown.name, shown.type, payload);
  const Json value = state.value(shown.key, Json());
  if (value.is_null()) {
    metric.set_null(true);
  } else if (shown.type == sparkplug::STRING) {
    metric.set_string_value(value.get<std::string>());
  } else if (shown.type == sparkplug::DOUBLE) {
    metric.set_double_value(value.get<double>());
  } else if (shown.type == sparkplug::DATE_TIME) {
    metric.set_long_value(static_cast<std::uint64_t>(
        ParseTime(value.get<std::string>(), true) / kNsPerMs));
  } else if (shown.type == sparkplug::UINT16) {
    metric.set_int_value(static_cast<std::uint32_t>(
        kSeverityStep * (kSeverityCount + 1 - value.get<int>())));
  } else {
    metric.set_int_value(static_cast<std::uint32_t>(
        std::ranges::find(kHealths, value.get<std::string>()) -
        kHealths.begin()));
  }
}

std::string Encoded(Payload& payload) {
  payload.set_stamp(static_cast<std::uint64_t>(NowNs() / kNsPerMs));
  for (sparkplug::Metric& metric : *payload.mutable_metrics()) {
    metric.set_stamp(payload.stamp());
  }
  return payload.SerializeAsString();
}

}  // namespace

// The number of a connection is not that of one before this start, whose death
// the broker may publish late.
SparkplugNode::SparkplugNode(const std::string& group, const std::string& site)
    : prefix_("spBv1.0/" + group + "/"),
      node_(TopicLevel(site)),
      bd_seq_(static_cast<std::uint64_t>(NowNs() / 1'000'000'000)) {}

std::string SparkplugNode::Topic(const char* type,
                                 const std::string& device) const {
  return prefix_ + type + "/" + node_ + (device.empty() ? "" : "/" + device);
}

Outgoing SparkplugNode::Will() {
  ++bd_seq_;
  return Death();
}

Outgoing SparkplugNode::Death() const {
  Payload payload;
  AddMetric("bdSeq", sparkplug::INT64, payload).set_long_value(bd_seq_ % 256);
  return {Topic("NDEATH", ""), Encoded(payload), false, 1};
}

// QoS 0, by the specification: a message that comes twice is out of order.
Outgoing SparkplugNode::Next(const char* type, const std::string& device,
                             Payload payload) {
  payload.set_seq(std::exchange(seq_, (seq_ + 1) % 256));
  return {Topic(type, device), Encoded(payload), false, 0};
}

Outgoing SparkplugNode::Birth() {
  seq_ = 0;
  devices_.clear();
  Payload payload;
  AddMetric("bdSeq", sparkplug::INT64, payload).set_long_value(bd_seq_ % 256);
  AddMetric("Node Control/Rebirth", sparkplug::BOOLEAN, payload)
      .set_bool_value(false);
  AddMetric("Monitor", sparkplug::STRING, payload).set_null(true);
  return Next("NBIRTH", "", std::move(payload));
}

bool SparkplugNode::AsksForBirth(const std::string& payload) {
  Payload command;
  return command.ParseFromString(payload) &&
         std::ranges::any_of(command.metrics(), [](const auto& metric) {
           return metric.name() == "Node Control/Rebirth" &&
                  metric.bool_value();
         });
}

std::vector<Outgoing> SparkplugNode::Tell(const Outgoing& message) {
  if (!message.retained) {
    return {};  // An event; the state tells what came of it.
  }
  Json state = Json::parse(message.payload);
  const bool is_valve = state.contains("valve_id");
  const bool gone = is_valve && !state.contains("state");
  const std::string name =
      is_valve ? TopicLevel(state["valve_id"].get<std::string>()) : "";
  auto& [lives, told] =
      devices_.try_emplace(name, Device{!is_valve, {}}).first->second;
  const bool birth = !lives && (!gone || told.empty());
  Payload payload;
  if (!is_valve) {
    Show(state, {"Monitor", sparkplug::STRING, "monitor"}, payload);
  } else {
    if (const Json reason = state.value("reason", Json()); !reason.is_null()) {
      state["description"] = reason;
    }
    for (const Shown& shown : kShown) {
      Show(state, shown, payload);
    }
  }
  told.resize(static_cast<std::size_t>(payload.metrics_size()));
  Payload changed;
  for (std::size_t i = 0; i < told.size(); ++i) {
    const sparkplug::Metric& metric = payload.metrics(static_cast<int>(i));
    if (birth || metric.SerializeAsString() != told[i]) {
      told[i] = metric.SerializeAsString();
      *changed.add_metrics() = metric;
    }
  }
  std::vector<Outgoing> out;
  if (changed.metrics_size() > 0 && (birth || lives)) {
    out.push_back(Next(birth      ? "DBIRTH"
                       : is_valve ? "DDATA"
                                  : "NDATA",
                       name, std::move(changed)));
  }
  if (gone && (birth || lives)) {
    out.push_back(Next("DDEATH", name, {}));
  }
  lives = !gone;
  return out;
}

}  // namespace fdi::gateway
