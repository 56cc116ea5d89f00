#include "storage/models/model_codec.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <openssl/evp.h>
#include <zlib.h>

#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/observers/fit_window.h"
#include "storage/database/bytes.h"

namespace fdi::storage {

// The bytes of a model set, little endian:
//
//   file    = "FDIM" format:uint32 length:uint64 payload crc:uint32
//   format  = 3, + 1 with physics, + 2 with a floor, + 4 with a former drift,
//             + 8 with an interpolation allowance, + 16 with names before t_k,
//             + 32 with the trim of a floor, + 64 with a share of the flow that
//             is too little, + 128 with limits of a fit, + 256 if the command
//             is the position, + 512 if it may pass the end of its range; both
//             have no bytes
//   payload = the fields of ModelSet in the order of Fields() below, the floor
//             last; then [physics: list] [drift: of each channel] [allowance]
//             [early_error] [flow shape of the floor: list]
//             [flow_share] [fit: of each channel of each observer, and what its
//             fault moves: int32]
//
// The CRC-32 covers all bytes before it. Encoding: a double as its 64 bits; int
// as int32; int64 unchanged; bool and enumerations as uint8; a text as uint32
// length and bytes; a list as uint32 count and its elements; a struct as its
// fields. A new or moved field needs another kFormat. A part that is absent has
// no bytes, so that older sets keep their bytes and hash.
namespace {

constexpr std::uint32_t kMagic = 0x4D494446;  // "FDIM"
// Format 3, plus one of these for each of the parts appended behind the fields.
constexpr std::uint32_t kFormat = 3;
constexpr std::uint32_t kWithPhysics = 1;
constexpr std::uint32_t kWithFloor = 2;
constexpr std::uint32_t kWithDrift = 4;
constexpr std::uint32_t kWithAllowance = 8;
constexpr std::uint32_t kWithEarlyNames = 16;
constexpr std::uint32_t kWithFlowShape = 32;
constexpr std::uint32_t kWithFlowShare = 64;
constexpr std::uint32_t kWithFit = 128;
constexpr std::uint32_t kWithPosition = 256;
constexpr std::uint32_t kWithPassing = 512;
constexpr std::uint32_t kLastFormat =
    kFormat + kWithPhysics + kWithFloor + kWithDrift + kWithAllowance +
    kWithEarlyNames + kWithFlowShape + kWithFlowShare + kWithFit +
    kWithPosition + kWithPassing;
constexpr std::uint32_t kMaxPhysics = 256;
constexpr std::size_t kFrame =
    2 * sizeof(std::uint32_t) + sizeof(std::uint64_t) + sizeof(std::uint32_t);
constexpr std::uint32_t kMaxText = 4096;
constexpr std::uint32_t kMaxTrainingRuns = 65536;

template <typename T, typename Struct>
concept Of = std::same_as<std::remove_const_t<T>, Struct>;

/// A vector and its maximum length.
template <typename Vector>
struct Limited {
  Vector& values;
  std::uint32_t max;
};
template <typename Vector>
Limited(Vector&, std::uint32_t) -> Limited<Vector>;  // For clang 14.

// The fields of every struct, once for both directions. The bindings name all
// of them, so a new field does not compile until it is added here.

template <typename A, Of<SignalRange> T>
void Fields(A& a, T& range) {
  auto& [minimum, maximum] = range;
  a(minimum, maximum);
}

template <typename A, Of<ValidityRegion> T>
void Fields(A& a, T& region) {
  auto& [cv, cv_mean, cv_step, dp, t1, p1, p2, flow_cutoff, rearm_samples] =
      region;
  a(cv, cv_mean, cv_step, dp, t1, p1, p2, flow_cutoff, rearm_samples);
}

template <typename A, Of<StuckLimits> T>
void Fields(A& a, T& limits) {
  auto& [t1, p1, p2] = limits;
  a(t1, p1, p2);
}

template <typename A, Of<FloorLimits::Rod> T>
void Fields(A& a, T& rod) {
  auto& [share, rate] = rod;
  a(share, rate);
}

// Without the share of the flow, which is appended behind the other fields.
template <typename A, Of<FloorLimits> T>
void Fields(A& a, T& floor) {
  auto& [delay, quick, slow, deviation, deviation_samples, stuck_travel,
         flow_gain, flow_exponent, flow_shape, dp_level, flow_high, flow_factor,
         flow_margin, flow_samples, flow_share] = floor;
  a(delay, quick, slow, deviation, deviation_samples, stuck_travel, flow_gain,
    flow_exponent, dp_level, flow_high, flow_factor, flow_margin, flow_samples);
}

template <typename A, Of<Trapezoid> T>
void Fields(A& archive, T& trapezoid) {
  auto& [a, b, c, d] = trapezoid;
  archive(a, b, c, d);
}

template <typename A, Of<FuzzySet> T>
void Fields(A& a, T& set) {
  auto& [left_center, right_center, left_width, right_width] = set;
  a(left_center, right_center, left_width, right_width);
}

template <typename A, Of<Regressor> T>
void Fields(A& a, T& regressor) {
  auto& [signal, lag] = regressor;
  a(signal, lag);
}

template <typename A, Of<TsRule> T>
void Fields(A& a, T& rule) {
  auto& [antecedents, slopes, intercept, data_share, center, metric] = rule;
  a(Limited{antecedents, kMaxRegressors}, Limited{slopes, kMaxRegressors},
    intercept, data_share, Limited{center, kMaxRegressors},
    Limited{metric, kMaxRegressors * (kMaxRegressors + 1) / 2});
}

template <typename A, Of<TsModel> T>
void Fields(A& a, T& model) {
  auto& [output, parallel, regressors, regressor_min, regressor_max, output_min,
         output_max, saturation, rules] = model;
  a(output, parallel, Limited{regressors, kMaxRegressors},
    Limited{regressor_min, kMaxRegressors},
    Limited{regressor_max, kMaxRegressors}, output_min, output_max, saturation,
    Limited{rules, kMaxRules});
}

template <typename A, Of<ValidationFigures> T>
void Fields(A& a, T& figures) {
  auto& [mse, vaf, bias, samples] = figures;
  a(mse, vaf, bias, samples);
}

template <typename A, Of<WindowLimits> T>
void Fields(A& a, T& window) {
  auto& [length, lower_mean, upper_mean, upper_log_rms, activity_slope,
         log_activity, command] = window;
  a(length, lower_mean, upper_mean, upper_log_rms, activity_slope, log_activity,
    command);
}

// Without the former drift, which is appended behind the other fields.
template <typename A, Of<ChannelSpec> T>
void Fields(A& a, T& channel) {
  auto& [name, output, lower_threshold, upper_threshold, windows,
         former_drift] = channel;
  a(name, output, lower_threshold, upper_threshold,
    Limited{windows, kMaxWindows});
}

template <typename A, Of<FitBounds> T>
void Fields(A& a, T& fit) {
  auto& [lower_mean, upper_mean, upper_square] = fit;
  a(lower_mean, upper_mean, upper_square);
}

// Without the limits of the fit, which are appended behind the other fields.
template <typename A, Of<ChannelObserver> T>
void Fields(A& a, T& channel) {
  auto& [model, difference, membership, residual_sd, correlation_time,
         interpolation_error, validation, fit] = channel;
  a(model, difference, membership, residual_sd, correlation_time,
    interpolation_error, validation);
}

template <typename A, Of<Observer> T>
void Fields(A& a, T& observer) {
  auto& [name, fault, strength, channels, moved] = observer;
  a(name, fault, strength, Limited{channels, kMaxChannels});
}

template <typename A, Of<DecisionParameters> T>
void Fields(A& a, T& decision) {
  auto& [isolation_threshold, detection_samples, isolation_samples,
         isolation_fraction, join_fraction, reisolation_samples,
         clearing_samples, settling_samples, evidence_window, evidence_core,
         evidence_support, interpolation_allowance, early_error] = decision;
  // The last two are appended behind the fields.
  a(isolation_threshold, detection_samples, isolation_samples,
    isolation_fraction, join_fraction, reisolation_samples, clearing_samples,
    settling_samples, evidence_window, evidence_core, evidence_support);
}

template <typename A, Of<PhysicalValue> T>
void Fields(A& a, T& physical) {
  auto& [name, value] = physical;
  a(name, value);
}

template <typename A, Of<ModelSet> T>
void Fields(A& a, T& models) {
  // version and content_hash are assigned by the store.
  auto& [name, version, content_hash, created_ns, software, preset,
         sample_period_s, flow_unit, validity, stuck, floor, decision, channels,
         observers, faults, groups, undetectable, training_runs,
         threshold_hours, false_alarms_per_hour, physics, position_as_command,
         command_may_pass] = models;
  a(name, created_ns, software, preset, sample_period_s, flow_unit, validity,
    stuck, decision, Limited{channels, kMaxChannels},
    Limited{observers, kMaxObservers}, Limited{faults, kMaxFaults},
    Limited{groups, kMaxFaults}, Limited{undetectable, kMaxFaults},
    Limited{training_runs, kMaxTrainingRuns}, threshold_hours,
    false_alarms_per_hour, floor);
}

class Encoder {
 public:
  template <typename... T>
  void operator()(const T&... fields) {
    (Field(fields), ...);
  }
  ByteWriter writer;

 private:
  void Field(double value) { writer.Put(value); }
  void Field(std::int64_t value) { writer.Put(value); }
  void Field(int value) { writer.Put(static_cast<std::int32_t>(value)); }
  void Field(bool value) { writer.Put(static_cast<std::uint8_t>(value)); }
  void Field(Signal value) { writer.Put(static_cast<std::uint8_t>(value)); }
  void Field(FlowUnit value) { writer.Put(static_cast<std::uint8_t>(value)); }
  // No byte says whether there is a floor: the format does.
  void Field(const std::optional<FloorLimits>& floor) {
    if (floor) {
      Field(*floor);
    }
  }
  void Field(const std::string& text) {
    CheckSize(text.size(), kMaxText);
    writer.PutText(text);
  }
  template <typename T>
  void Field(const std::vector<T>& values) {
    Field(Limited<const std::vector<T>>{values, kMaxFaults});
  }
  template <typename Vector>
  void Field(const Limited<Vector>& limited) {
    CheckSize(limited.values.size(), limited.max);
    writer.Put(static_cast<std::uint32_t>(limited.values.size()));
    for (const auto& value : limited.values) {
      Field(value);
    }
  }
  template <typename Struct>
  requires std::is_aggregate_v<Struct>
  void Field(const Struct& value) { Fields(*this, value); }
  // The limits are those of the decoder: nothing is stored that could not be
  // read back.
  static void CheckSize(std::size_t size, std::uint32_t max) {
    Require(size <= max, "a model set holds more than its format can store");
  }
};

class Decoder {
 public:
  Decoder(ByteReader& reader, std::uint32_t format)
      : reader_(reader), format_(format) {}

  template <typename... T>
  void operator()(T&&... fields) {
    (Field(std::forward<T>(fields)), ...);
  }

 private:
  void Field(double& value) { value = reader_.GetDouble(); }
  void Field(std::int64_t& value) { value = reader_.Get<std::int64_t>(); }
  void Field(int& value) { value = reader_.Get<std::int32_t>(); }
  void Field(bool& value) { value = Small(1, "flag") != 0; }
  void Field(Signal& value) {
    value = static_cast<Signal>(Small(kModelSignalCount - 1, "signal"));
  }
  void Field(FlowUnit& value) {
    value = static_cast<FlowUnit>(
        Small(static_cast<std::uint8_t>(FlowUnit::kTPerHour), "flow unit"));
  }
  void Field(std::optional<FloorLimits>& floor) {
    if (((format_ - kFormat) & kWithFloor) != 0) {
      Field(floor.emplace());
    }
  }
  void Field(std::string& text) { text = reader_.GetText(kMaxText); }
  template <typename T>
  void Field(std::vector<T>& values) {
    Field(Limited<std::vector<T>>{values, kMaxFaults});
  }
  template <typename Vector>
  void Field(const Limited<Vector>& limited) {
    // A count beyond its limit is refused before memory is taken for it.
    limited.values.resize(reader_.GetCount(limited.max, "a count"));
    for (auto& value : limited.values) {
      Field(value);
    }
  }
  template <typename Struct>
  requires std::is_aggregate_v<Struct>
  void Field(Struct& value) { Fields(*this, value); }
  std::uint8_t Small(std::uint8_t max, const char* what) {
    const auto value = reader_.Get<std::uint8_t>();
    if (value > max) {
      reader_.Refuse(std::string(what) + " " + std::to_string(value));
    }
    return value;
  }

  ByteReader& reader_;
  std::uint32_t format_;
};

bool HasFormerDrift(const ModelSet& models) {
  return std::ranges::any_of(models.channels, [](const ChannelSpec& channel) {
    return channel.former_drift != std::array<double, 3>{};
  });
}

std::uint32_t Checksum(std::span<const std::byte> bytes) {
  // crc32_z() takes a size_t; the length of crc32() has 32 bits only.
  return static_cast<std::uint32_t>(
      crc32_z(crc32(0, nullptr, 0),
              reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// Sets made before findings had a number range of their own number them behind
// the 22 faults of that time.
void RenumberFindings(ModelSet& models) {
  constexpr int kBehindFaults = 23;
  if (!models.floor || std::ranges::any_of(models.faults, IsFinding)) {
    return;
  }
  for (int& fault : models.faults) {
    fault += fault >= kBehindFaults ? kFirstFinding - kBehindFaults : 0;
  }
}

}  // namespace

std::vector<std::byte> EncodeModelSet(const ModelSet& models) {
  Encoder payload;
  Fields(payload, models);
  if (!models.physics.empty()) {
    payload(Limited{models.physics, kMaxPhysics});
  }
  const bool drifts = HasFormerDrift(models);
  for (std::size_t c = 0; drifts && c < models.channels.size(); ++c) {
    const auto& [lower, upper, log_scale] = models.channels[c].former_drift;
    payload(lower, upper, log_scale);
  }
  const double allowance = models.decision.interpolation_allowance;
  if (allowance > 0.0) {
    payload(allowance);
  }
  const double early_error = models.decision.early_error;
  if (early_error > 0.0) {
    payload(early_error);
  }
  const bool shaped = models.floor && !models.floor->flow_shape.empty();
  if (shaped) {
    payload(models.floor->flow_shape);
  }
  const bool low_flow = models.floor && models.floor->flow_share > 0.0;
  if (low_flow) {
    payload(models.floor->flow_share);
  }
  const bool fits = JudgesFit(models);
  for (std::size_t o = 0; fits && o < models.observers.size(); ++o) {
    for (const ChannelObserver& channel : models.observers[o].channels) {
      payload(channel.fit);
    }
    payload(static_cast<std::int32_t>(models.observers[o].moved));
  }
  ByteWriter writer;
  writer.Put(kMagic);
  writer.Put(kFormat + (models.physics.empty() ? 0U : kWithPhysics) +
             (models.floor ? kWithFloor : 0U) + (drifts ? kWithDrift : 0U) +
             (allowance > 0.0 ? kWithAllowance : 0U) +
             (early_error > 0.0 ? kWithEarlyNames : 0U) +
             (shaped ? kWithFlowShape : 0U) + (low_flow ? kWithFlowShare : 0U) +
             (fits ? kWithFit : 0U) +
             (models.position_as_command ? kWithPosition : 0U) +
             (models.command_may_pass ? kWithPassing : 0U));
  writer.Put(static_cast<std::uint64_t>(payload.writer.size()));
  writer.Append(payload.writer.view().data(), payload.writer.size());
  writer.Put(Checksum(writer.view()));
  return writer.Take();
}

ModelSet DecodeModelSet(std::span<const std::byte> bytes,
                        std::string_view where) {
  ByteReader reader(bytes, where);
  if (bytes.size() < kFrame || reader.Get<std::uint32_t>() != kMagic) {
    throw DataError(std::string(where) + " is not a model set");
  }
  // The CRC-32 is checked before the format, so that a damaged format number is
  // not taken for that of a newer program.
  const std::size_t checked = bytes.size() - sizeof(std::uint32_t);
  ByteReader end(bytes.subspan(checked), where);
  if (end.Get<std::uint32_t>() != Checksum(bytes.first(checked))) {
    reader.Refuse("its CRC-32 differs");
  }
  const auto format = reader.Get<std::uint32_t>();
  if (format < kFormat || format > kLastFormat) {
    throw DataError(std::string(where) + ": format version " +
                    std::to_string(format) + ", this program reads " +
                    std::to_string(kFormat) + " to " +
                    std::to_string(kLastFormat) + "; train the model set anew");
  }
  if (reader.Get<std::uint64_t>() != bytes.size() - kFrame) {
    reader.Refuse("its length differs");
  }
  ByteReader payload(reader.TakeBytes(bytes.size() - kFrame), where);
  ModelSet models;
  Decoder decoder(payload, format);
  Fields(decoder, models);
  if (((format - kFormat) & kWithPhysics) != 0) {
    decoder(Limited{models.physics, kMaxPhysics});
  }
  if (((format - kFormat) & kWithDrift) != 0) {
    for (ChannelSpec& channel : models.channels) {
      auto& [lower, upper, log_scale] = channel.former_drift;
      decoder(lower, upper, log_scale);
    }
  }
  if (((format - kFormat) & kWithAllowance) != 0) {
    decoder(models.decision.interpolation_allowance);
  }
  if (((format - kFormat) & kWithEarlyNames) != 0) {
    decoder(models.decision.early_error);
  }
  if (((format - kFormat) & kWithFlowShape) != 0 && models.floor) {
    decoder(models.floor->flow_shape);
  }
  if (((format - kFormat) & kWithFlowShare) != 0) {
    if (!models.floor) {
      payload.Refuse("a share of the flow without a floor");
    }
    decoder(models.floor->flow_share);
  }
  if (((format - kFormat) & kWithFit) != 0) {
    for (Observer& observer : models.observers) {
      for (ChannelObserver& channel : observer.channels) {
        decoder(channel.fit);
      }
      std::int32_t moved = 0;
      decoder(moved);
      observer.moved = static_cast<SignalMask>(moved);
    }
  }
  models.position_as_command = ((format - kFormat) & kWithPosition) != 0;
  models.command_may_pass = ((format - kFormat) & kWithPassing) != 0;
  payload.ExpectEnd();
  models.content_hash = ContentHash(models);  // Of what is stored.
  RenumberFindings(models);
  return models;
}

std::uint64_t ContentHash(const ModelSet& models) {
  ModelSet content = models;
  content.created_ns = 0;
  content.software.clear();
  content.training_runs.clear();
  return Sha256Start(EncodeModelSet(content));
}

std::uint64_t Sha256Start(std::span<const std::byte> bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), nullptr,
                 EVP_sha256(), nullptr) != 1) {
    throw std::runtime_error("OpenSSL cannot compute SHA-256");
  }
  std::uint64_t hash = 0;
  for (int i = 0; i < 8; ++i) {
    hash = hash << 8U | digest[static_cast<std::size_t>(i)];
  }
  return hash;
}

std::string HashHex(std::uint64_t hash) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx",
                static_cast<unsigned long long>(hash));
  return text.data();
}

std::uint64_t HashOfHex(std::string_view text) {
  std::uint64_t hash = 0;
  std::from_chars(text.data(), text.data() + text.size(), hash, 16);
  return hash;
}

}  // namespace fdi::storage
