#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace fdi::storage {

/// Whether the models of a valve were made for the valve as it is now.
enum class BaselineState : std::uint8_t {
  kNone,         ///< Not onboarded: the models are the user's business.
  kProvisional,  ///< Onboarded in an earlier epoch: isolation is held.
  kValid,        ///< Onboarded in this epoch.
};
std::string_view BaselineStateName(BaselineState state);  ///< "none", ...

/// How a normal model fits the healthy valve.
struct ChannelFigures {
  std::string name;
  double rmse{0.0};  ///< [unit of the output]
  double bias{0.0};  ///< Mean residual [unit of the output].
  double vaf{0.0};   ///< [%]
};

/// What onboarding found of a valve in one epoch: the valve as it was found
/// and as it was left, side by side.
struct BaselineRecord {
  std::uint32_t epoch{0};
  std::string model_set;
  int version{0};
  double hours{0.0};  ///< Of healthy data.
  /// Fitted, by name, e.g. {"trim.kv_m3_h", 118.2}.
  std::vector<std::pair<std::string, double>> parameters{};
  std::vector<ChannelFigures> channels{};
  std::int64_t created_ns{0};  ///< UTC; filled when it is stored.
};

enum class ValveEventKind : std::uint8_t {
  kReplaced,
  kRepacked,
  kRecalibrated
};
std::string_view ValveEventKindName(ValveEventKind kind);  ///< "replaced", ...
/// @throws ConfigError naming the accepted names.
ValveEventKind ParseValveEventKind(std::string_view name);

/// What was done to a valve; it opens an epoch.
struct ValveEvent {
  std::uint32_t epoch{0};  ///< That it opened; filled when it is stored.
  ValveEventKind kind{ValveEventKind::kReplaced};
  std::string note{};
  std::int64_t at_ns{0};  ///< UTC.
  std::string who{};
};

/// The effects of the faults on a type of valve, apart from any valve's
/// baseline. The bytes are the trainer's.
struct ValveType {
  std::string name;
  std::int64_t created_ns{0};  ///< UTC; filled when it is stored.
  std::string summary{};       ///< One line for people.
  std::size_t size{0};         ///< Of `bytes`, which lists leave empty.
  std::vector<std::byte> bytes{};
};

}  // namespace fdi::storage
