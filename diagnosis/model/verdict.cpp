#include "diagnosis/model/verdict.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace fdi {
namespace {

template <typename Enum, std::size_t N>
std::string_view NameOf(Enum value,
                        const std::array<std::string_view, N>& names) {
  const auto index = static_cast<std::size_t>(value);
  return index < N ? names[index] : std::string_view("invalid");
}

constexpr std::uint64_t kFnvOffset = 14695981039346656037ULL;
constexpr std::uint64_t kFnvPrime = 1099511628211ULL;

std::uint64_t HashByte(std::uint64_t hash, unsigned char byte) {
  return (hash ^ byte) * kFnvPrime;
}

std::uint64_t HashWord(std::uint64_t hash, std::uint64_t word) {
  for (int i = 0; i < 8; ++i) {
    hash = HashByte(hash, static_cast<unsigned char>(word >> (8 * i) & 0xFF));
  }
  return hash;
}

}  // namespace

std::string_view IntakeName(Intake intake) {
  return NameOf(intake,
                std::array<std::string_view, kIntakeCount>{
                    "accepted", "repeat", "late", "superseded", "bad_quality",
                    "not_finite", "range", "unit", "period"});
}

std::string_view QualityName(Quality quality) {
  return NameOf(quality,
                std::array<std::string_view, 8>{
                    "LIVE", "STALE", "BAD_INPUT", "SETTLING", "INHIBITED",
                    "UNCOVERED", "MODEL_UNSUITED", "UNASSIGNED"});
}

std::string_view StateName(State state) {
  return NameOf(
      state, std::array<std::string_view, 3>{"NORMAL", "DETECTED", "ISOLATED"});
}

std::string_view UnknownName(Unknown unknown) {
  return NameOf(unknown, std::array<std::string_view, 3>{"", "too_early",
                                                         "outside_known"});
}

std::string CoverageReasonsName(CoverageReasons reasons) {
  constexpr std::array<std::string_view, kCoverageReasonCount> kNames{
      "mode", "cv", "cv_step", "parked", "dp", "t1", "p1", "p2", "waiting"};
  std::string name;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if ((reasons >> i & 1U) != 0) {
      name += name.empty() ? "" : "|";
      name += kNames[i];
    }
  }
  return name;
}

std::string WhyUnjudged(Quality quality, Intake intake,
                        CoverageReasons reasons) {
  std::string why(QualityName(quality));
  if (reasons != 0) {
    why += " " + CoverageReasonsName(reasons);
  } else if (intake != Intake::kAccepted) {
    why.append(" ").append(IntakeName(intake));
  } else if (quality == Quality::kBadInput) {
    why += " no_readings";
  }
  return why;
}

std::string_view TransitionName(TransitionKind kind) {
  return NameOf(kind, std::array<std::string_view, 8>{
                          "DETECTED", "ISOLATED", "REISOLATED", "CLEARED",
                          "CLOSED", "CHANGED", "SECOND", "RAISED"});
}

std::string DriftValue(const SlowDrift& drift) {
  if (drift.now == 0.0) {
    return "";
  }
  std::array<char, 160> text{};
  std::snprintf(text.data(), text.size(),
                "X reads %.2g %% %s its model, growing by %.2g %% an hour for "
                "%.1f h",
                std::abs(drift.now), drift.now > 0.0 ? "above" : "below",
                std::abs(drift.slope), drift.hours);
  return text.data();
}

std::string SecondValue(const SecondFault& second, std::string names) {
  return !second.open         ? "none"
         : second.faults == 0 ? "unknown"
                              : std::move(names);
}

SecondFault ParseSecond(std::string_view value,
                        const std::vector<std::string>& faults) {
  SecondFault second;
  second.open = !value.empty() && value != "none";
  const std::string names = "|" + std::string(value) + "|";
  for (std::size_t bit = 0; bit < faults.size(); ++bit) {
    if (second.open && names.find("|" + faults[bit] + "|") != names.npos) {
      second.faults |= FaultSet{1} << bit;
    }
  }
  return second;
}

std::string_view EndReasonName(EndReason reason) {
  return NameOf(reason, std::array<std::string_view, 7>{
                            "", "cleared", "stream_ended", "stale_timeout",
                            "model_changed", "superseded", "unknown"});
}

std::string_view LayerName(Layer layer) {
  return NameOf(
      layer, std::array<std::string_view, 3>{"observers", "physics", "audit"});
}

Layer ParseLayer(std::string_view name) {
  for (const Layer layer : {Layer::kPhysics, Layer::kAudit}) {
    if (name == LayerName(layer)) {
      return layer;
    }
  }
  return Layer::kObservers;
}

std::uint64_t EpisodeId(std::string_view valve_id, std::uint64_t source_id,
                        std::int64_t detection_stamp_ns) {
  std::uint64_t hash = kFnvOffset;
  for (const char c : valve_id) {
    hash = HashByte(hash, static_cast<unsigned char>(c));
  }
  hash = HashWord(hash, source_id);
  return HashWord(hash, static_cast<std::uint64_t>(detection_stamp_ns));
}

}  // namespace fdi
