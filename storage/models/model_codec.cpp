#include "storage/models/model_codec.h"

#include <array>
#include <charconv>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include <openssl/evp.h>
#include <zlib.h>

#include "storage/database/bytes.h"

namespace fdi::storage {

// The bytes of a model set, little endian:
//
//   file    = "FDIM" format:uint32 length:uint64 payload crc:uint32
//   payload = the fields of ModelSet in the order of Fields() below
//
// The CRC-32 covers all bytes before it. Encoding: a double as its 64 bits; int
// as int32; int64 unchanged; bool, enumerations and masks of signals as uint8
// or uint16; a text as uint32 length and bytes; a list as uint32 count and its
// elements; an optional as a bool and, if it is true, its value; a struct as
// its fields. A new or moved field needs another kFormat.
namespace {

constexpr std::uint32_t kMagic = 0x4D494446;  // "FDIM"
// The formats 3 to 1027 were those of sets that were never released.
constexpr std::uint32_t kFormat = 1028;
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

template <typename A, Of<ReadEvery> T>
void Fields(A& a, T& every) {
  auto& [p1, p2, t1, x, f] = every;
  a(p1, p2, t1, x, f);
}

template <typename A, Of<FloorLimits::Rod> T>
void Fields(A& a, T& rod) {
  auto& [share, rate] = rod;
  a(share, rate);
}

template <typename A, Of<FloorLimits> T>
void Fields(A& a, T& floor) {
  auto& [delay, quick, slow, deviation, deviation_samples, stuck_travel,
         flow_gain, flow_exponent, flow_shape, dp_level, flow_high, flow_factor,
         flow_margin, flow_samples, flow_share] = floor;
  a(delay, quick, slow, deviation, deviation_samples, stuck_travel, flow_gain,
    flow_exponent, flow_shape, dp_level, flow_high, flow_factor, flow_margin,
    flow_samples, flow_share);
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

template <typename A, Of<ChannelSpec> T>
void Fields(A& a, T& channel) {
  auto& [name, output, lower_threshold, upper_threshold, windows] = channel;
  a(name, output, lower_threshold, upper_threshold,
    Limited{windows, kMaxWindows});
}

template <typename A, Of<FitBounds> T>
void Fields(A& a, T& fit) {
  auto& [lower_mean, upper_mean, upper_square] = fit;
  a(lower_mean, upper_mean, upper_square);
}

template <typename A, Of<ChannelObserver> T>
void Fields(A& a, T& channel) {
  auto& [model, difference, membership, residual_sd, correlation_time,
         interpolation_error, validation, fit] = channel;
  a(model, difference, membership, residual_sd, correlation_time,
    interpolation_error, validation, fit);
}

template <typename A, Of<Observer> T>
void Fields(A& a, T& observer) {
  auto& [name, fault, strength, channels, moved] = observer;
  a(name, fault, strength, Limited{channels, kMaxChannels}, moved);
}

template <typename A, Of<DecisionParameters> T>
void Fields(A& a, T& decision) {
  auto& [isolation_threshold, detection_samples, isolation_samples,
         isolation_fraction, join_fraction, reisolation_samples,
         clearing_samples, settling_samples, evidence_window, evidence_core,
         evidence_support, interpolation_allowance, early_error] = decision;
  a(isolation_threshold, detection_samples, isolation_samples,
    isolation_fraction, join_fraction, reisolation_samples, clearing_samples,
    settling_samples, evidence_window, evidence_core, evidence_support,
    interpolation_allowance, early_error);
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
         sample_period_s, flow_unit, validity, stuck, every, floor, decision,
         channels, observers, faults, groups, undetectable, training_runs,
         threshold_hours, false_alarms_per_hour, physics, position_as_command] =
      models;
  a(name, created_ns, software, preset, sample_period_s, flow_unit, validity,
    stuck, every, floor, decision, Limited{channels, kMaxChannels},
    Limited{observers, kMaxObservers}, Limited{faults, kMaxFaults},
    Limited{groups, kMaxFaults}, Limited{undetectable, kMaxFaults},
    Limited{training_runs, kMaxTrainingRuns}, threshold_hours,
    false_alarms_per_hour, Limited{physics, kMaxPhysics}, position_as_command);
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
  void Field(SignalMask value) { writer.Put(value); }
  void Field(const std::optional<FloorLimits>& floor) {
    Field(floor.has_value());
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
  explicit Decoder(ByteReader& reader) : reader_(reader) {}

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
  void Field(SignalMask& value) { value = reader_.Get<SignalMask>(); }
  void Field(std::optional<FloorLimits>& floor) {
    bool there = false;
    Field(there);
    if (there) {
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
};

std::uint32_t Checksum(std::span<const std::byte> bytes) {
  // crc32_z() takes a size_t; the length of crc32() has 32 bits only.
  return static_cast<std::uint32_t>(
      crc32_z(crc32(0, nullptr, 0),
              reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

}  // namespace

std::vector<std::byte> EncodeModelSet(const ModelSet& models) {
  Encoder payload;
  Fields(payload, models);
  ByteWriter writer;
  writer.Put(kMagic);
  writer.Put(kFormat);
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
  if (format != kFormat) {
    throw DataError(std::string(where) + ": format " + std::to_string(format) +
                    " is of another version of this program, which reads " +
                    std::to_string(kFormat) +
                    "; make the model set anew from stored runs, with "
                    "`fdi-trainer train` or `fdi-trainer onboard`");
  }
  if (reader.Get<std::uint64_t>() != bytes.size() - kFrame) {
    reader.Refuse("its length differs");
  }
  ByteReader payload(reader.TakeBytes(bytes.size() - kFrame), where);
  ModelSet models;
  Decoder decoder(payload);
  Fields(decoder, models);
  payload.ExpectEnd();
  models.content_hash = ContentHash(models);
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

}  // namespace fdi::storage
