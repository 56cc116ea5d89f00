#pragma once

#include <cstdint>
#include <string>

namespace fdi {

enum class OperatorActionKind : std::uint8_t { kAck, kLabel, kShelve };

/// An operator action on one monitor of a pair, for the history of the other,
/// as published on the topic OperatorAction.
struct OperatorAction {
  std::string monitor;  ///< The monitor that forwards it.
  OperatorActionKind kind{OperatorActionKind::kAck};
  std::uint64_t episode_id{0};  ///< For kAck and kLabel,
  std::string valve_id;         ///< for kShelve.
  std::string value;  ///< The label; for kShelve the fault, empty for any.
  std::int64_t stamp_ns{0};
  std::string who;
  std::string comment;
  std::string origin;
  /// End of a kShelve. For kAck: the stamp of the newest event that it covers;
  /// 0: not known.
  std::int64_t until_ns{0};
  std::int64_t ended_ns{0};  ///< Of kShelve: end, if unshelved early; else 0.
  std::string ended_by;
  std::string ended_origin;
};

}  // namespace fdi
