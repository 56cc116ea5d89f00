#include "idl/codec.h"
#include "idl/codec_fields.h"

namespace fdi::idl {

void Codec<ModelSetInfoMessage>::EncodeKey(const ModelSetInfoMessage& message,
                                           Wire& wire) {
  SetId(message.model_set, wire.model_set());
  wire.model_hash(message.model_hash);
}

namespace {

void EncodeLists(const ModelSetInfoMessage& message, v1::ModelSetInfo& wire) {
  RequireCount(message.channels.size(), kMaxChannels, "channels");
  wire.channels().resize(message.channels.size());
  for (std::size_t i = 0; i < message.channels.size(); ++i) {
    const ChannelSpec& channel = message.channels[i];
    v1::ChannelInfo& out = wire.channels()[i];
    SetText(channel.name, out.name(), "channel name");
    out.output(static_cast<std::uint8_t>(channel.output));
    out.lower_threshold(channel.lower_threshold);
    out.upper_threshold(channel.upper_threshold);
  }
  RequireCount(message.observers.size(), kMaxObservers, "observers");
  wire.observers().resize(message.observers.size());
  for (std::size_t i = 0; i < message.observers.size(); ++i) {
    const ObserverInfo& observer = message.observers[i];
    v1::ObserverInfo& out = wire.observers()[i];
    SetText(observer.name, out.name(), "observer name");
    out.fault(ToWireFault(observer.fault, "observer"));
    out.strength(observer.strength);
  }
  SetFaults(message.faults, wire.faults(), "faults");
  SetFaults(message.undetectable, wire.undetectable(), "undetectable");
  RequireCount(message.groups.size(), kMaxGroups, "groups");
  wire.groups().resize(message.groups.size());
  for (std::size_t i = 0; i < message.groups.size(); ++i) {
    SetFaults(message.groups[i], wire.groups()[i].faults(), "group");
  }
}

bool DecodeLists(const v1::ModelSetInfo& wire, ModelSetInfoMessage& message) {
  message.channels.clear();
  for (const v1::ChannelInfo& channel : wire.channels()) {
    if (channel.output() >= kSignalCount) {
      return false;
    }
    message.channels.push_back(
        {channel.name().c_str(), static_cast<Signal>(channel.output()),
         channel.lower_threshold(), channel.upper_threshold()});
  }
  message.observers.clear();
  for (const v1::ObserverInfo& observer : wire.observers()) {
    if (observer.fault() > kLastFault) {
      return false;
    }
    message.observers.push_back(
        {observer.name().c_str(), observer.fault(), observer.strength()});
  }
  message.groups.resize(wire.groups().size());
  for (std::size_t i = 0; i < wire.groups().size(); ++i) {
    if (!GetFaults(wire.groups()[i].faults(), message.groups[i])) {
      return false;
    }
  }
  return message.channels.size() <= kMaxChannels &&
         message.observers.size() <= kMaxObservers &&
         message.groups.size() <= kMaxGroups &&
         GetFaults(wire.faults(), message.faults) &&
         GetFaults(wire.undetectable(), message.undetectable);
}

}  // namespace

void Codec<ModelSetInfoMessage>::Encode(const ModelSetInfoMessage& message,
                                        Wire& wire) {
  EncodeKey(message, wire);
  wire.version(ToWireCount(message.version, "version"));
  wire.created_ns(message.created_ns);
  wire.sample_period_s(message.sample_period_s);
  wire.flow_unit(ToWire(message.flow_unit, v1::FLOW_T_PER_H, "flow_unit"));
  wire.required(message.required);
  wire.isolation_threshold(message.isolation_threshold);
  wire.isolation_fraction(message.isolation_fraction);
  wire.detection_samples(ToWireCount(message.detection_samples, "n_d"));
  wire.isolation_samples(ToWireCount(message.isolation_samples, "t_k"));
  wire.clearing_samples(ToWireCount(message.clearing_samples, "t_c"));
  wire.settling_samples(
      ToWireCount(message.settling_samples, "settling_samples"));
  EncodeLists(message, wire);
}

bool Codec<ModelSetInfoMessage>::Decode(const Wire& wire,
                                        ModelSetInfoMessage& message) {
  message.model_set = wire.model_set().c_str();
  message.model_hash = wire.model_hash();
  message.created_ns = wire.created_ns();
  message.sample_period_s = wire.sample_period_s();
  message.required = wire.required();
  message.isolation_threshold = wire.isolation_threshold();
  message.isolation_fraction = wire.isolation_fraction();
  return !message.model_set.empty() && wire.required() < (1U << kSignalCount) &&
         FromWire(wire.flow_unit(), v1::FLOW_T_PER_H, message.flow_unit) &&
         FromWireCount(wire.version(), message.version) &&
         FromWireCount(wire.detection_samples(), message.detection_samples) &&
         FromWireCount(wire.isolation_samples(), message.isolation_samples) &&
         FromWireCount(wire.clearing_samples(), message.clearing_samples) &&
         FromWireCount(wire.settling_samples(), message.settling_samples) &&
         DecodeLists(wire, message);
}

void Codec<MonitorStatusMessage>::EncodeKey(const MonitorStatusMessage& message,
                                            Wire& wire) {
  SetId(message.monitor, wire.monitor());
}

void Codec<MonitorStatusMessage>::Encode(const MonitorStatusMessage& message,
                                         Wire& wire) {
  EncodeKey(message, wire);
  SetText(message.software, wire.software(), "software");
  wire.started_ns(message.started_ns);
  wire.stamp_ns(message.stamp_ns);
  wire.health(ToWire(message.health, v1::HEALTH_FAILING, "health"));
  SetText(message.text, wire.text(), "text");
  RequireCount(message.counters.size(), kMaxCounters, "counters");
  wire.counters().resize(message.counters.size());
  for (std::size_t i = 0; i < message.counters.size(); ++i) {
    SetText(message.counters[i].first, wire.counters()[i].name(), "counter");
    wire.counters()[i].value(message.counters[i].second);
  }
}

bool Codec<MonitorStatusMessage>::Decode(const Wire& wire,
                                         MonitorStatusMessage& message) {
  message.monitor = wire.monitor().c_str();
  message.software = wire.software().c_str();
  message.started_ns = wire.started_ns();
  message.stamp_ns = wire.stamp_ns();
  message.text = wire.text().c_str();
  message.counters.clear();
  for (const v1::Counter& counter : wire.counters()) {
    message.counters.emplace_back(counter.name().c_str(), counter.value());
  }
  return !message.monitor.empty() && message.counters.size() <= kMaxCounters &&
         FromWire(wire.health(), v1::HEALTH_FAILING, message.health);
}

}  // namespace fdi::idl
