#pragma once

#include <string>
#include <utility>

#include "fdi_v1.h"
#include "fdi_v1PubSubTypes.h"
#include "idl/wire.h"

/// Inside idl/ only: plain messages to generated types and back.
namespace fdi::idl {

/// Names and conversions of one topic. Encode() throws DataError naming the
/// field that does not fit; Decode() answers false for what no publisher of
/// ours sends (an enumerator, a size, a fault out of range), `message` being
/// unspecified then. EncodeKey() fills the key members only.
template <typename Message>
struct Codec;

template <>
struct Codec<ValveSampleMessage> {
  using Wire = v1::ValveSample;
  using Type = v1::ValveSamplePubSubType;
  static constexpr const char* kTopic = "fdi/v1/ValveSample";
  static void EncodeKey(const ValveSampleMessage& message, Wire& wire);
  static void Encode(const ValveSampleMessage& message, Wire& wire);
  static bool Decode(const Wire& wire, ValveSampleMessage& message);
  using Key = std::string;
  static const Key& KeyOf(const ValveSampleMessage& message) {
    return message.valve_id;
  }
  static void SetKey(const Key& key, ValveSampleMessage& message) {
    message.valve_id = key;
  }
};

template <>
struct Codec<DecisionMessage> {
  using Wire = v1::DecisionVector;
  using Type = v1::DecisionVectorPubSubType;
  static constexpr const char* kTopic = "fdi/v1/DecisionVector";
  static void EncodeKey(const DecisionMessage& message, Wire& wire);
  static void Encode(const DecisionMessage& message, Wire& wire);
  static bool Decode(const Wire& wire, DecisionMessage& message);
  using Key = std::string;
  static const Key& KeyOf(const DecisionMessage& message) {
    return message.valve_id;
  }
  static void SetKey(const Key& key, DecisionMessage& message) {
    message.valve_id = key;
  }
};

template <>
struct Codec<FaultEventMessage> {
  using Wire = v1::FaultEvent;
  using Type = v1::FaultEventPubSubType;
  static constexpr const char* kTopic = "fdi/v1/FaultEvent";
  static void EncodeKey(const FaultEventMessage& message, Wire& wire);
  static void Encode(const FaultEventMessage& message, Wire& wire);
  static bool Decode(const Wire& wire, FaultEventMessage& message);
  using Key = std::string;
  static const Key& KeyOf(const FaultEventMessage& message) {
    return message.valve_id;
  }
  static void SetKey(const Key& key, FaultEventMessage& message) {
    message.valve_id = key;
  }
};

template <>
struct Codec<ModelSetInfoMessage> {
  using Wire = v1::ModelSetInfo;
  using Type = v1::ModelSetInfoPubSubType;
  static constexpr const char* kTopic = "fdi/v1/ModelSetInfo";
  static void EncodeKey(const ModelSetInfoMessage& message, Wire& wire);
  static void Encode(const ModelSetInfoMessage& message, Wire& wire);
  static bool Decode(const Wire& wire, ModelSetInfoMessage& message);
  using Key = std::pair<std::string, std::uint64_t>;
  static Key KeyOf(const ModelSetInfoMessage& message) {
    return {message.model_set, message.model_hash};
  }
  static void SetKey(const Key& key, ModelSetInfoMessage& message) {
    message.model_set = key.first;
    message.model_hash = key.second;
  }
};

template <>
struct Codec<MonitorStatusMessage> {
  using Wire = v1::MonitorStatus;
  using Type = v1::MonitorStatusPubSubType;
  static constexpr const char* kTopic = "fdi/v1/MonitorStatus";
  static void EncodeKey(const MonitorStatusMessage& message, Wire& wire);
  static void Encode(const MonitorStatusMessage& message, Wire& wire);
  static bool Decode(const Wire& wire, MonitorStatusMessage& message);
  using Key = std::string;
  static const Key& KeyOf(const MonitorStatusMessage& message) {
    return message.monitor;
  }
  static void SetKey(const Key& key, MonitorStatusMessage& message) {
    message.monitor = key;
  }
};

}  // namespace fdi::idl
