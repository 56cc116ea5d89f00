#include "idl/codec.h"

#include "idl/codec_fields.h"

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

bool StampFits(std::int64_t stamp_ns) {
  return stamp_ns >= kMinStampNs && stamp_ns <= kMaxStampNs;
}

std::int64_t CheckedStamp(std::int64_t stamp_ns) {
  if (!StampFits(stamp_ns)) {
    throw DataError("stamp_ns is " + std::to_string(stamp_ns) +
                    ", accepted are the years 1900 to 2100");
  }
  return stamp_ns;
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
  wire.stamp_ns(CheckedStamp(sample.stamp_ns));
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
  return known && !message.valve_id.empty() && StampFits(sample.stamp_ns) &&
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

}  // namespace fdi::idl
