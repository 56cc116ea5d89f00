#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "storage/history_types.h"

namespace fdi::storage {

/// An alarm that somebody does not want to be told of until a time.
struct Shelf {
  std::int64_t shelf_id{0};
  std::string valve_id;
  std::optional<std::string> fault;  ///< As in fault_history; none: any.
  std::int64_t from_ns{0};
  std::int64_t until_ns{0};
  std::string who;
  std::string comment;
  std::string origin;  ///< "fdi-store anna@host", "console 127.0.0.1", ...
  /// Set if it was ended before its time, by whom and from where.
  std::optional<std::int64_t> ended_ns;
  std::string ended_by;
  std::string ended_origin;
};

/// [from, until), unless it was ended before.
bool InForce(const Shelf& shelf, std::int64_t now_ns);

/// `shelf` is for this valve and this answer. A shelved fault covers episodes
/// with just this answer: not those that are not isolated, nor another set.
bool Covers(const Shelf& shelf, const Episode& episode);

/// States of an alarm in ANSI/ISA-18.2-2016 (IEC 62682), alarm state
/// transition diagram. An episode is the alarm; its condition has returned to
/// normal once it was cleared or has ended for another reason.
enum class AlarmState {
  kUnacked,          ///< In alarm, nobody has acknowledged it.
  kAcked,            ///< In alarm, acknowledged.
  kReturnedUnacked,  ///< Returned to normal before anybody acknowledged it.
  kNormal,           ///< Returned to normal and acknowledged.
  kShelved,          ///< Out of the way for a limited time.
};

/// "UNACK", "ACKED", "RTN_UNACK", "NORMAL", "SHELVED".
std::string_view AlarmStateName(AlarmState state);

/// Shelving hides any other state, which comes back when it ends.
AlarmState AlarmStateOf(bool active, bool acknowledged, bool shelved = false);
AlarmState AlarmStateOf(const Episode& episode, bool shelved = false);

/// An episode as an operator sees it.
struct Alarm {
  Episode episode;
  AlarmState state{AlarmState::kUnacked};  ///< Without its shelf.
  /// In force now; of several the one that lasts longest.
  std::optional<Shelf> shelf;
};

/// `episodes` in their order, with those of `shelves` that are in force.
std::vector<Alarm> AsAlarms(std::vector<Episode> episodes,
                            const std::vector<Shelf>& shelves,
                            std::int64_t now_ns);

}  // namespace fdi::storage
