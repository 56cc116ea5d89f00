#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/sample.h"

namespace fdi::importer {

/// The content of a column. Both pressures are kPressure until words or sizes
/// tell them apart; kValve is the tag of a valve, its command or its position.
enum class Role {
  kOther,  ///< No signal: a pressure difference, a speed, a limit of an alarm.
  kSetpoint,
  kSupply,
  kCommand,
  kPosition,
  kLevel,
  kTemperature,
  kUpstream,
  kDownstream,
  kPressure,
  kFlow,
  kValve,
  kMode,
  kMeasured,  ///< The process value of its tag, whatever that measures.
};

/// The role of a column by its name, the text below it and its unit.
struct RoleGuess {
  std::optional<Role> role;
  bool by_word{false};  ///< Not by the letters of a tag, which are less sure.
  /// The role of the last part by itself: kMeasured of FIC101.PV.
  std::optional<Role> attribute;
  std::string unit;  ///< As the name or the text below it states it.
  std::string tag;   ///< "FIC101." of FIC101.PV; empty: no tag is in front.
  std::optional<Role> of_tag;  ///< By the letters of the tag.
  /// Beside a flow, a pressure or a temperature: a set point is in its unit.
  bool of_measurement{false};
  /// The tag of a controller of flow, such as "FC101", which may be all that
  /// its output is called.
  bool of_controller{false};
};

/// @param name as in the header.
/// @param about lines of units and descriptions below or above the name.
/// @param part of the name: what other columns do not have, too.
RoleGuess RoleOf(const std::string& name, const std::string& about,
                 const std::string& part);

/// The signal of a valve that a role stands for; nothing for a level and the
/// like. kPressure stands for P1, kValve for X.
std::optional<Signal> SignalOf(Role role);

/// The names of the columns of one table without what all of them end or begin
/// with ("FT." and ".F_CV"), which is no evidence.
/// @param abouts of each, which tell apart names such as "Value (2)".
std::vector<std::string> DistinctParts(const std::vector<std::string>& names,
                                       const std::vector<std::string>& abouts);

}  // namespace fdi::importer
