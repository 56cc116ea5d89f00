#include "idl/codec.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"

namespace fdi::idl {
namespace {

// Enumerators stand in the same order on both sides; the last ones prove it.
template <typename Ours, typename Wire>
constexpr bool SameEnd(Ours ours, Wire wire) {
  return static_cast<unsigned>(ours) == static_cast<unsigned>(wire);
}
static_assert(SameEnd(SignalQuality::kBad, v1::SIGNAL_BAD));
static_assert(SameEnd(ValveMode::kCalibrating, v1::MODE_CALIBRATING));
static_assert(SameEnd(FlowUnit::kTPerHour, v1::FLOW_T_PER_H));
static_assert(SameEnd(Intake::kPeriod, v1::INTAKE_PERIOD));
static_assert(SameEnd(Quality::kUnassigned, v1::QUALITY_UNASSIGNED));
static_assert(SameEnd(State::kIsolated, v1::STATE_ISOLATED));
static_assert(SameEnd(TransitionKind::kClosed, v1::TRANSITION_CLOSED));
static_assert(SameEnd(EndReason::kUnknown, v1::END_UNKNOWN));
static_assert(SameEnd(Health::kFailing, v1::HEALTH_FAILING));
static_assert(kMaxChannels == 16 && kMaxFaults == 64 && kMaxObservers == 128,
              "fdi_v1.idl cannot grow");
static_assert(kSignalCount == 10, "fdi_v1.idl cannot grow");

template <typename Wire, typename Ours>
Wire ToWire(Ours value, Wire last, const char* field) {
  if (static_cast<unsigned>(value) > static_cast<unsigned>(last)) {
    throw DataError(std::string(field) + " is " +
                    std::to_string(static_cast<unsigned>(value)) +
                    ", accepted are 0 to " +
                    std::to_string(static_cast<unsigned>(last)));
  }
  return static_cast<Wire>(value);
}

// A foreign enumerator arrives as any 32-bit pattern.
template <typename Wire, typename Ours>
bool FromWire(const Wire& wire, Wire last, Ours& value) {
  using Raw = std::underlying_type_t<Wire>;
  const auto raw = static_cast<std::uint64_t>(static_cast<Raw>(wire));
  if (raw > static_cast<std::uint64_t>(static_cast<Raw>(last))) {
    return false;
  }
  value = static_cast<Ours>(raw);
  return true;
}

template <std::size_t N>
void SetText(const std::string& text, eprosima::fastrtps::fixed_string<N>& wire,
             const char* field) {
  if (text.size() > N || text.find('\0') != std::string::npos) {
    throw DataError(std::string(field) + " '" + text + "' has " +
                    std::to_string(text.size()) + " bytes, accepted are 0 to " +
                    std::to_string(N) + " without NUL");
  }
  wire = text;
}

template <std::size_t N>
void SetId(const std::string& id, eprosima::fastrtps::fixed_string<N>& wire) {
  static_assert(N == kMaxIdLength);
  ValidateId(id);
  wire = id;
}

void RequireCount(std::size_t count, std::size_t maximum, const char* field) {
  if (count > maximum) {
    throw DataError(std::string(field) + " has " + std::to_string(count) +
                    " entries, accepted are 0 to " + std::to_string(maximum));
  }
}

template <typename Array>
void SetArray(const Array& values, int count, std::vector<double>& wire,
              const char* field) {
  RequireCount(static_cast<std::size_t>(count), values.size(), field);
  wire.assign(values.begin(), values.begin() + count);
}

template <typename Array>
bool GetArray(const std::vector<double>& wire, Array& values) {
  if (wire.size() > values.size()) {
    return false;
  }
  std::ranges::fill(std::ranges::copy(wire, values.begin()).out, values.end(),
                    0.0);
  return true;
}

bool IsFault(int fault) {
  return fault >= 1 && fault <= kFaultCount;
}

std::uint8_t ToWireFault(int fault, const char* field) {
  if (!IsFault(fault) && fault != 0) {
    throw DataError(std::string(field) + " is fault " + std::to_string(fault) +
                    ", accepted are 0 to " + std::to_string(kFaultCount));
  }
  return static_cast<std::uint8_t>(fault);
}

void SetFaults(const std::vector<int>& faults, std::vector<std::uint8_t>& wire,
               const char* field) {
  RequireCount(faults.size(), kMaxFaults, field);
  wire.clear();
  for (const int fault : faults) {
    wire.push_back(ToWireFault(fault, field));
  }
}

bool GetFaults(const std::vector<std::uint8_t>& wire,
               std::vector<int>& faults) {
  if (wire.size() > kMaxFaults || !std::ranges::all_of(wire, IsFault)) {
    return false;
  }
  faults.assign(wire.begin(), wire.end());
  return true;
}

std::uint32_t ToWireCount(int count, const char* field) {
  if (count < 0) {
    throw DataError(std::string(field) + " is " + std::to_string(count) +
                    ", accepted are 0 and above");
  }
  return static_cast<std::uint32_t>(count);
}

bool FromWireCount(std::uint32_t wire, int& count) {
  count = static_cast<int>(wire);
  return wire <= static_cast<std::uint32_t>(std::numeric_limits<int>::max());
}

}  // namespace

void Codec<ValveSampleMessage>::EncodeKey(const ValveSampleMessage& message,
                                          Wire& wire) {
  SetId(message.valve_id, wire.valve_id());
}

void Codec<ValveSampleMessage>::Encode(const ValveSampleMessage& message,
                                       Wire& wire) {
  const Sample& sample = message.sample;
  EncodeKey(message, wire);
  wire.source_id(sample.source_id);
  wire.seq(sample.seq);
  wire.stamp_ns(sample.stamp_ns);
  wire.cv(sample[Signal::kCv]);
  wire.p1(sample[Signal::kP1]);
  wire.p2(sample[Signal::kP2]);
  wire.t1(sample[Signal::kT1]);
  wire.x(sample[Signal::kX]);
  wire.f(sample[Signal::kF]);
  wire.sp(sample[Signal::kSp]);
  wire.cvi(sample[Signal::kCvi]);
  wire.ps(sample[Signal::kPs]);
  wire.pz(sample[Signal::kPz]);
  wire.present(sample.present);
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    wire.quality()[i] = ToWire(sample.quality[i], v1::SIGNAL_BAD, "quality");
  }
  wire.mode(ToWire(sample.mode, v1::MODE_CALIBRATING, "mode"));
  wire.flow_unit(ToWire(sample.flow_unit, v1::FLOW_T_PER_H, "flow_unit"));
  wire.epoch(sample.epoch);
}

bool Codec<ValveSampleMessage>::Decode(const Wire& wire,
                                       ValveSampleMessage& message) {
  Sample& sample = message.sample;
  message.valve_id = wire.valve_id().c_str();
  sample.source_id = wire.source_id();
  sample.seq = wire.seq();
  sample.stamp_ns = wire.stamp_ns();
  sample.values = {wire.cv(), wire.p1(), wire.p2(),  wire.t1(), wire.x(),
                   wire.f(),  wire.sp(), wire.cvi(), wire.ps(), wire.pz()};
  sample.present = wire.present();
  sample.epoch = wire.epoch();
  bool known = true;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    known =
        FromWire(wire.quality()[i], v1::SIGNAL_BAD, sample.quality[i]) && known;
  }
  return known && !message.valve_id.empty() &&
         wire.present() < (1U << kSignalCount) &&
         FromWire(wire.mode(), v1::MODE_CALIBRATING, sample.mode) &&
         FromWire(wire.flow_unit(), v1::FLOW_T_PER_H, sample.flow_unit);
}

void Codec<DecisionMessage>::EncodeKey(const DecisionMessage& message,
                                       Wire& wire) {
  SetId(message.valve_id, wire.valve_id());
}

void Codec<DecisionMessage>::Encode(const DecisionMessage& message,
                                    Wire& wire) {
  const Verdict& verdict = message.verdict;
  EncodeKey(message, wire);
  wire.source_id(verdict.source_id);
  wire.seq(verdict.seq);
  wire.stamp_ns(verdict.stamp_ns);
  wire.model_hash(message.model_hash);
  wire.intake(ToWire(verdict.intake, v1::INTAKE_PERIOD, "intake"));
  wire.initialised(verdict.initialised);
  wire.quality(ToWire(verdict.quality, v1::QUALITY_UNASSIGNED, "quality"));
  wire.state(ToWire(verdict.state, v1::STATE_ISOLATED, "state"));
  wire.detected(verdict.detected);
  wire.confidence(verdict.confidence);
  wire.normal_factor(verdict.normal_factor);
  wire.isolated(verdict.isolated);
  SetArray(verdict.residuals, message.channel_count, wire.residuals(),
           "residuals");
  SetArray(verdict.fault_factors, message.fault_count, wire.fault_factors(),
           "fault_factors");
  SetArray(verdict.strengths, message.fault_count, wire.fault_strengths(),
           "fault_strengths");
  SetArray(verdict.observer_factors, message.observer_count,
           wire.observer_factors(), "observer_factors");
}

bool Codec<DecisionMessage>::Decode(const Wire& wire,
                                    DecisionMessage& message) {
  Verdict& verdict = message.verdict;
  message.valve_id = wire.valve_id().c_str();
  message.model_hash = wire.model_hash();
  message.channel_count = static_cast<int>(wire.residuals().size());
  message.fault_count = static_cast<int>(wire.fault_factors().size());
  message.observer_count = static_cast<int>(wire.observer_factors().size());
  verdict.source_id = wire.source_id();
  verdict.seq = wire.seq();
  verdict.stamp_ns = wire.stamp_ns();
  verdict.initialised = wire.initialised();
  verdict.detected = wire.detected();
  verdict.confidence = wire.confidence();
  verdict.normal_factor = wire.normal_factor();
  verdict.isolated = wire.isolated();
  verdict.transition_count = 0;
  return !message.valve_id.empty() &&
         wire.fault_strengths().size() == wire.fault_factors().size() &&
         FromWire(wire.intake(), v1::INTAKE_PERIOD, verdict.intake) &&
         FromWire(wire.quality(), v1::QUALITY_UNASSIGNED, verdict.quality) &&
         FromWire(wire.state(), v1::STATE_ISOLATED, verdict.state) &&
         GetArray(wire.residuals(), verdict.residuals) &&
         GetArray(wire.fault_factors(), verdict.fault_factors) &&
         GetArray(wire.fault_strengths(), verdict.strengths) &&
         GetArray(wire.observer_factors(), verdict.observer_factors);
}

void Codec<FaultEventMessage>::EncodeKey(const FaultEventMessage& message,
                                         Wire& wire) {
  SetId(message.valve_id, wire.valve_id());
}

void Codec<FaultEventMessage>::Encode(const FaultEventMessage& message,
                                      Wire& wire) {
  const Transition& transition = message.transition;
  EncodeKey(message, wire);
  wire.episode_id(message.episode_id);
  wire.source_id(message.source_id);
  wire.seq(message.seq);
  wire.transition(ToWire(transition.kind, v1::TRANSITION_CLOSED, "transition"));
  wire.end_reason(ToWire(transition.reason, v1::END_UNKNOWN, "end_reason"));
  wire.stamp_ns(transition.stamp_ns);
  wire.detection_stamp_ns(transition.detection_stamp_ns);
  wire.faults(transition.faults);
  wire.factor(transition.factor);
  wire.strength(transition.strength);
  RequireCount(message.candidates.size(), kMaxFaults, "candidates");
  wire.candidates().resize(message.candidates.size());
  for (std::size_t i = 0; i < message.candidates.size(); ++i) {
    const FaultCandidate& candidate = message.candidates[i];
    v1::FaultCandidate& out = wire.candidates()[i];
    out.fault(ToWireFault(candidate.fault, "candidate"));
    out.factor(candidate.factor);
    out.strength(candidate.strength);
    out.isolated(candidate.isolated);
  }
  SetText(message.model_set, wire.model_set(), "model_set");
  wire.model_version(ToWireCount(message.model_version, "model_version"));
  wire.model_hash(message.model_hash);
  wire.persisted(message.persisted);
}

bool Codec<FaultEventMessage>::Decode(const Wire& wire,
                                      FaultEventMessage& message) {
  Transition& transition = message.transition;
  message.valve_id = wire.valve_id().c_str();
  message.episode_id = wire.episode_id();
  message.source_id = wire.source_id();
  message.seq = wire.seq();
  transition.stamp_ns = wire.stamp_ns();
  transition.detection_stamp_ns = wire.detection_stamp_ns();
  transition.faults = wire.faults();
  transition.factor = wire.factor();
  transition.strength = wire.strength();
  message.model_set = wire.model_set().c_str();
  message.model_hash = wire.model_hash();
  message.persisted = wire.persisted();
  message.candidates.clear();
  for (const v1::FaultCandidate& candidate : wire.candidates()) {
    if (!IsFault(candidate.fault())) {
      return false;
    }
    message.candidates.push_back({candidate.fault(), candidate.factor(),
                                  candidate.strength(), candidate.isolated()});
  }
  return !message.valve_id.empty() && message.candidates.size() <= kMaxFaults &&
         FromWireCount(wire.model_version(), message.model_version) &&
         FromWire(wire.transition(), v1::TRANSITION_CLOSED, transition.kind) &&
         FromWire(wire.end_reason(), v1::END_UNKNOWN, transition.reason);
}

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
    if (observer.fault() > kFaultCount) {
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
