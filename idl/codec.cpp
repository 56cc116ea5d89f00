#include "idl/codec.h"

#include <algorithm>
#include <concepts>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/field_list.h"
#include "base/printable.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/model/severity.h"

// Maps records to messages of fdi_v1.idl and fdi_v2.idl and back:
//
//     KeyFields(transfer, record, wire)   the members that are its key
//     Fields(transfer, record, wire)      all others
//
// each name every field once. A Transfer<true> copies the fields to the wire
// and throws at the first that does not fit; a Transfer<false> copies them from
// the wire, where any value may occur, and remembers whether one did not fit.
// Both apply the same checks.
namespace fdi::idl {
namespace {

static_assert(kMaxChannels == 16 && kMaxFaults == 64 && kMaxObservers == 128 &&
                  kModelSignalCount == 10 && kSignalCount == 11 &&
                  kLastFinding <= 255,
              "fdi_v1.idl and fdi_v2.idl cannot grow");

// LastOf(enumerator) is the last one of its enumeration. Enumerators have the
// same order on both sides, which the last ones prove.
#define FDI_LAST(OURS, WIRE)                                                 \
  static_assert(static_cast<unsigned>(OURS) == static_cast<unsigned>(WIRE)); \
  constexpr std::int64_t LastOf(decltype(OURS)) {                            \
    return static_cast<std::int64_t>(OURS);                                  \
  }
FDI_LAST(Signal::kPz, kModelSignalCount - 1)
FDI_LAST(SignalQuality::kBad, v1::SignalQuality::SIGNAL_BAD)
FDI_LAST(ValveMode::kCalibrating, v1::ValveMode::MODE_CALIBRATING)
FDI_LAST(FlowUnit::kTPerHour, v1::FlowUnit::FLOW_T_PER_H)
FDI_LAST(Intake::kPeriod, v1::Intake::INTAKE_PERIOD)
FDI_LAST(Quality::kUnassigned, v1::Quality::QUALITY_UNASSIGNED)
FDI_LAST(State::kIsolated, v1::State::STATE_ISOLATED)
// TransitionKind::kChanged is not on the wire: see OnTheBus().
FDI_LAST(TransitionKind::kClosed, v1::Transition::TRANSITION_CLOSED)
FDI_LAST(EndReason::kUnknown, v1::EndReason::END_UNKNOWN)
FDI_LAST(Health::kFailing, v1::Health::HEALTH_FAILING)
#undef FDI_LAST
static_assert(static_cast<unsigned>(SignalQuality::kBad) ==
                  static_cast<unsigned>(v2::SignalQuality::SIGNAL_BAD) &&
              static_cast<unsigned>(ValveMode::kCalibrating) ==
                  static_cast<unsigned>(v2::ValveMode::MODE_CALIBRATING) &&
              static_cast<unsigned>(FlowUnit::kTPerHour) ==
                  static_cast<unsigned>(v2::FlowUnit::FLOW_T_PER_H));

template <bool kEncodes>
class Transfer {
 public:
  // A field whose range follows from its type: enumerators, counts (int to
  // unsigned long), texts up to the bound of the IDL; all other types are
  // copied.
  template <typename Ours, typename Wire>
  void operator()(const char* field, Ours& ours, Wire&& wire) {
    using Plain = std::remove_const_t<Ours>;
    if constexpr (std::is_enum_v<Plain>) {
      Ranged(field, ours, wire, 0, LastOf(ours));
    } else if constexpr (std::same_as<Plain, int>) {
      Ranged(field, ours, wire, 0, std::numeric_limits<int>::max());
    } else if constexpr (!std::is_arithmetic_v<Plain>) {
      Text(field, ours, wire);
    } else if constexpr (kEncodes) {
      static_assert(std::same_as<Plain, std::remove_cvref_t<Wire>>);
      wire = ours;
    } else {
      static_assert(std::same_as<Plain, std::remove_cvref_t<Wire>>);
      ours = wire;
    }
  }

  // An integer or enumerator in low..high. A foreign enumerator may be any
  // 32-bit pattern.
  template <typename Ours, typename Wire>
  void Ranged(const char* field, Ours& ours, Wire&& wire, std::int64_t low,
              std::int64_t high) {
    std::int64_t value = 0;
    if constexpr (kEncodes) {
      value = static_cast<std::int64_t>(ours);
    } else {
      value = static_cast<std::int64_t>(wire);
    }
    if (value < low || value > high) {
      Refuse(field, " is " + std::to_string(value) + ", accepted are " +
                        (low == kMinStampNs ? "the years 1900 to 2100"
                                            : Range(low, high)));
    } else if constexpr (kEncodes) {
      wire = static_cast<std::remove_cvref_t<Wire>>(value);
    } else {
      ours = static_cast<Ours>(value);
    }
  }

  // The number of a fault or of a finding of the floor.
  template <typename Ours, typename Wire>
  void Fault(const char* field, Ours& ours, Wire&& wire) {
    const int fault = kEncodes ? ours : static_cast<int>(wire);
    if (!IsFault(fault) && !IsFinding(fault)) {
      Refuse(field, " is " + std::to_string(fault) + ", accepted are " +
                        Range(1, kLastFault) + " and " +
                        Range(kFirstFinding, kLastFinding));
    } else {
      Ranged(field, ours, wire, 1, kLastFinding);
    }
  }

  // The key text of an instance: not empty, no control characters.
  template <typename Ours, typename Wire>
  void Id(const char* field, Ours& ours, Wire& wire) {
    static_assert(Wire::max_size == kMaxIdLength);
    if constexpr (kEncodes) {
      ValidateId(ours);
    }
    Text(field, ours, wire);
    if (ours.empty() || !IsPrintable(ours)) {
      Refuse(field, " is empty, has control characters or is not UTF-8");
    }
  }

  // A list of records, of messages, or of fault numbers.
  template <typename Ours, typename Wire>
  void List(const char* field, Ours& ours, Wire&& wire, std::size_t most) {
    // The library does not enforce the bounds of a sequence: the count is
    // checked before anything is resized.
    const std::size_t count = kEncodes ? ours.size() : wire.size();
    if (!CountFits(field, count, most)) {
      return;
    }
    if constexpr (kEncodes) {
      wire.resize(count);
    } else {
      ours.resize(count);
    }
    for (std::size_t i = 0; i < count; ++i) {
      if constexpr (std::same_as<typename Ours::value_type, int>) {
        Fault(field, ours[i], wire[i]);
      } else {
        if constexpr (requires { ours[i].valve_id; }) {
          KeyFields(*this, ours[i], wire[i]);
        }
        Fields(*this, ours[i], wire[i]);
      }
    }
  }

  // The first `count` values of an array; the others become 0.
  template <typename Values, typename Count, typename Wire>
  void Array(const char* field, Values& values, Count& count, Wire&& wire) {
    const std::size_t used =
        kEncodes ? static_cast<std::size_t>(count) : wire.size();
    if (!CountFits(field, used, values.size())) {
      return;
    }
    if constexpr (kEncodes) {
      wire.assign(values.begin(), values.begin() + count);
    } else {
      count = static_cast<int>(used);
      std::ranges::fill(std::ranges::copy(wire, values.begin()).out,
                        values.end(), 0.0);
    }
  }

  void Require(const char* field, bool fits) {
    if (!fits) {
      Refuse(field, " does not fit the other fields");
    }
  }

  bool all_fit() const { return all_fit_; }

 private:
  template <typename Ours, typename Wire>
  void Text(const char* field, Ours& ours, Wire& wire) {
    // The library's texts of bounded length cut off silently what is too long.
    if constexpr (!kEncodes) {
      ours = wire.c_str();
    } else if (ours.size() > Wire::max_size ||
               ours.find('\0') != std::string::npos) {
      Refuse(field, " '" + ours + "' has " + std::to_string(ours.size()) +
                        " bytes, accepted are 0 to " +
                        std::to_string(Wire::max_size) + " without NUL");
    } else {
      wire = ours;
    }
  }

  bool CountFits(const char* field, std::size_t count, std::size_t most) {
    if (count <= most) {
      return true;
    }
    Refuse(field, " has " + std::to_string(count) + " entries, accepted are " +
                      Range(0, static_cast<std::int64_t>(most)));
    return false;
  }

  static std::string Range(std::int64_t low, std::int64_t high) {
    return std::to_string(low) + " to " + std::to_string(high);
  }

  void Refuse(const char* field, const std::string& reason) {
    if (kEncodes) {
      throw DataError(field + reason);
    }
    all_fit_ = false;
  }

  bool all_fit_{true};
};

// A T, const or not.
template <typename Given, typename T>
concept Is = std::same_as<std::remove_const_t<Given>, T>;

#define FDI_FIELD(name) t(#name, m.name, w.name());

template <typename Message>
void KeyFields(auto& t, Message& m, auto& w) {
  if constexpr (requires { m.valve_id; }) {
    t.Id("valve_id", m.valve_id, w.valve_id());
  } else if constexpr (requires { m.monitor; }) {
    t.Id("monitor", m.monitor, w.monitor());
  } else {
    t.Id("model_set", m.model_set, w.model_set());
    FDI_FIELD(model_hash)
  }
}

// A set of the first `count` signals.
template <typename Mask, typename Wire>
void SignalsField(auto& t, const char* field, Mask& mask, Wire&& wire,
                  std::size_t count = kModelSignalCount) {
  t.Ranged(field, mask, wire, 0, (1 << count) - 1);
}

// The wire object is used for one message after another, and nothing clears it
// in between: each function has to set every member of its type. Their order is
// free, because the library serialises them in that of the IDL.
template <typename Wire>
void Fields(auto& t, Is<ValveSampleMessage> auto& message, Wire& w) {
  constexpr bool kHasPv = requires {
    w.pv();
  };
  constexpr std::size_t kSignals = kHasPv ? kSignalCount : kModelSignalCount;
  auto& m = message.sample;
  FDI_FOR_EACH(FDI_FIELD, source_id, seq)
  t.Ranged("stamp_ns", m.stamp_ns, w.stamp_ns(), kMinStampNs, kMaxStampNs);
  const auto value = [&](Signal signal) -> auto& {
    return m.values[Index(signal)];
  };
  t("cv", value(Signal::kCv), w.cv());
  t("p1", value(Signal::kP1), w.p1());
  t("p2", value(Signal::kP2), w.p2());
  t("t1", value(Signal::kT1), w.t1());
  t("x", value(Signal::kX), w.x());
  t("f", value(Signal::kF), w.f());
  t("sp", value(Signal::kSp), w.sp());
  t("cvi", value(Signal::kCvi), w.cvi());
  t("ps", value(Signal::kPs), w.ps());
  t("pz", value(Signal::kPz), w.pz());
  if constexpr (kHasPv) {
    t("pv", value(Signal::kPv), w.pv());
  } else if constexpr (!std::is_const_v<std::remove_reference_t<decltype(m)>>) {
    m.values[Index(Signal::kPv)] = 0.0;
    m.quality[Index(Signal::kPv)] = SignalQuality::kGood;
  }
  SignalsField(t, "present", m.present, w.present(), kSignals);
  for (std::size_t i = 0; i < kSignals; ++i) {
    t("quality", m.quality[i], w.quality()[i]);
  }
  FDI_FOR_EACH(FDI_FIELD, mode, flow_unit, epoch)
}

void Fields(auto& t, Is<DecisionMessage> auto& message, auto& w) {
  t("model_hash", message.model_hash, w.model_hash());
  auto& m = message.verdict;
  FDI_FOR_EACH(FDI_FIELD, source_id, seq, stamp_ns, intake, initialised,
               quality, state, detected, confidence, normal_factor, isolated)
  t.Array("residuals", m.residuals, message.channel_count, w.residuals());
  t.Array("fault_factors", m.fault_factors, message.fault_count,
          w.fault_factors());
  t.Array("fault_strengths", m.strengths, message.fault_count,
          w.fault_strengths());
  // Both arrays set fault_count. If a foreign writer sends them in different
  // lengths, the count would be right for the second one only.
  t.Require("fault_strengths",
            w.fault_strengths().size() == w.fault_factors().size());
  t.Array("observer_factors", m.observer_factors, message.observer_count,
          w.observer_factors());
}

void Fields(auto& t, Is<DecisionBatchMessage> auto& m, auto& w) {
  t.List("vectors", m.vectors, w.vectors(), kMaxBatch);
}

void Fields(auto& t, Is<FaultCandidate> auto& m, auto& w) {
  t.Fault("candidates.fault", m.fault, w.fault());
  FDI_FOR_EACH(FDI_FIELD, factor, strength, isolated)
}

void Fields(auto& t, Is<FaultEvent> auto& m, auto& w) {
  FDI_FAULT_EVENT_FIELDS(FDI_FIELD)
  auto& transition = m.transition;
  t("transition", transition.kind, w.transition());
  t("end_reason", transition.reason, w.end_reason());
  t("stamp_ns", transition.stamp_ns, w.stamp_ns());
  t("detection_stamp_ns", transition.detection_stamp_ns,
    w.detection_stamp_ns());
  t("faults", transition.faults, w.faults());
  t("factor", transition.factor, w.factor());
  t("strength", transition.strength, w.strength());
  t.List("candidates", m.candidates, w.candidates(), kMaxFaults);
}

// Readers look the names of faults up in a catalogue.
bool AreFaults(const std::string& names) {
  bool known = true;
  for (std::size_t from = 0; known && from < names.size();) {
    const std::size_t end = std::min(names.find('|', from), names.size());
    const std::string name = names.substr(from, end - from);
    known = name == "unknown" || ParseFinding(name);
    from = end + 1;
  }
  return known;
}

void Fields(auto& t, Is<ValveStateMessage> auto& m, auto& w) {
  FDI_FOR_EACH(FDI_FIELD, monitor, as_of_ns, quality, state, partly,
               unconfirmed_ns, episode_id, fault, look_alikes, certainty, layer,
               strength, since_ns, unjudged_ns, why, model_set)
  t.Ranged("priority", m.priority, w.priority(), 0, kSeverityCount);
  t.Require("fault", AreFaults(m.fault) && AreFaults(m.look_alikes));
}

void Fields(auto& t, Is<ChannelSpec> auto& m, auto& w) {
  t("channels.name", m.name, w.name());
  t("channels.output", m.output, w.output());
  FDI_FOR_EACH(FDI_FIELD, lower_threshold, upper_threshold)
}

void Fields(auto& t, Is<ObserverInfo> auto& m, auto& w) {
  t("observers.name", m.name, w.name());
  t.Ranged("observers.fault", m.fault, w.fault(), 0, kLastFault);
  FDI_FIELD(strength)
}

// A group of indistinguishable faults.
void Fields(auto& t, Is<std::vector<int>> auto& m, auto& w) {
  t.List("groups.faults", m, w.faults(), kMaxFaults);
}

void Fields(auto& t, Is<ModelSetInfoMessage> auto& m, auto& w) {
  FDI_FOR_EACH(FDI_FIELD, version, created_ns, sample_period_s, flow_unit)
  SignalsField(t, "required", m.required, w.required());
  FDI_FOR_EACH(FDI_FIELD, isolation_threshold, isolation_fraction,
               detection_samples, isolation_samples, clearing_samples,
               settling_samples)
  t.List("channels", m.channels, w.channels(), kMaxChannels);
  t.List("observers", m.observers, w.observers(), kMaxObservers);
  t.List("faults", m.faults, w.faults(), kMaxFaults);
  t.List("undetectable", m.undetectable, w.undetectable(), kMaxFaults);
  t.List("groups", m.groups, w.groups(), kMaxGroups);
}

// A counter: name and total.
void Fields(auto& t, Is<std::pair<std::string, std::uint64_t>> auto& m,
            auto& w) {
  t("counters.name", m.first, w.name());
  t("counters.value", m.second, w.value());
}

void Fields(auto& t, Is<MonitorStatusMessage> auto& m, auto& w) {
  FDI_FOR_EACH(FDI_FIELD, software, started_ns, stamp_ns, health, text)
  t.List("counters", m.counters, w.counters(), kMaxCounters);
}

void Fields(auto& t, Is<MonitorShare> auto& m, auto& w) {
  FDI_FOR_EACH(FDI_FIELD, valves, partitions)
}

#undef FDI_FIELD

}  // namespace

template <typename Message, int kVersion>
void Codec<Message, kVersion>::EncodeKey(const Message& message, Wire& wire) {
  Transfer<true> transfer;
  KeyFields(transfer, message, wire);
}

template <typename Message, int kVersion>
void Codec<Message, kVersion>::Encode(const Message& message, Wire& wire) {
  Transfer<true> transfer;
  KeyFields(transfer, message, wire);
  Fields(transfer, message, wire);
}

template <typename Message, int kVersion>
bool Codec<Message, kVersion>::Decode(const Wire& wire, Message& message) {
  // Goes on after a field that does not fit: each field is bounded by itself.
  Transfer<false> transfer;
  KeyFields(transfer, message, wire);
  Fields(transfer, message, wire);
  return transfer.all_fit();
}

template struct Codec<ValveSampleMessage>;
template struct Codec<ValveSampleMessage, 2>;
template struct Codec<DecisionMessage>;
template struct Codec<DecisionBatchMessage>;
template struct Codec<FaultEvent>;
template struct Codec<ValveStateMessage>;
template struct Codec<ModelSetInfoMessage>;
template struct Codec<MonitorStatusMessage>;
template struct Codec<MonitorShare>;

}  // namespace fdi::idl
