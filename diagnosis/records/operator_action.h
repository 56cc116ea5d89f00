#pragma once

#include <cstdint>
#include <string>

namespace fdi {

enum class OperatorActionKind : std::uint8_t { kAck, kLabel, kShelve };

/// What an operator did on one monitor of a pair, for the history of the other
/// one: what the topic OperatorAction carries.
struct OperatorAction {
  std::string monitor;  ///< That brings it.
  OperatorActionKind kind{OperatorActionKind::kAck};
  std::uint64_t episode_id{0};  ///< Of kAck and kLabel,
  std::string valve_id;         ///< of kShelve.
  std::string value;  ///< The label; of kShelve the fault, empty for any.
  std::int64_t stamp_ns{0};
  std::string who;
  std::string comment;
  std::string origin;
  std::int64_t until_ns{0};  ///< Of kShelve, as what follows.
  std::int64_t ended_ns{0};  ///< Taken off the shelf before its time; or 0.
  std::string ended_by;
  std::string ended_origin;
};

}  // namespace fdi
