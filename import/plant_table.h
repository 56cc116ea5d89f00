#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "diagnosis/model/valve_identity.h"
#include "import/csv.h"

namespace fdi::importer {

/// The kind of a tag of a loop.
enum class LoopTag { kOp, kPv, kSp, kMode, kX, kF, kP1, kP2, kT1 };
inline constexpr std::size_t kLoopTagCount = 9;
std::string_view LoopTagName(LoopTag tag);  ///< The key in the table: "op".

/// A tag as the table states it.
struct TagCell {
  std::string pattern{};  ///< Placeholders replaced; * stands for anything.
  bool own{false};        ///< Stated in the row itself, not as a default.
  std::string unit{};
  /// In the file. For op and x it is 0..100 %. Readings that are beyond it by a
  /// tenth are none.
  std::optional<std::pair<double, double>> range{};
};

/// A row of a plant's table: a valve or a loop.
struct PlantRow : ValveIdentity {
  std::string name;
  std::string place;  ///< For messages: "plant.csv:12".
  std::array<TagCell, kLoopTagCount> tags;
  Sense sense{Sense::kClosing};  ///< For op and x.
  std::string type{};            ///< Empty: data only.
  std::string group{};
  std::string file{};  ///< Empty: those of the table.
  std::string from{};  ///< A time, or seconds of the file; empty: its begin.
  std::string to{};
  std::vector<std::string> auto_words{};
  std::vector<std::string> manual_words{};
  std::string report{};   ///< "exception" or "periodic"; empty: not said.
  double max_age_s{0.0};  ///< With periodic; 0: not said.
  /// MQTT; {signal} is the key of a tag ("op"), {tag} the tag itself.
  std::string topic{};
  std::string value_key{};  ///< In the JSON of a payload.
  std::string time_key{};
  std::string error{};  ///< Error in the row; empty: none.

  const TagCell& operator[](LoopTag tag) const {
    return tags[static_cast<std::size_t>(tag)];
  }
  /// The tag of the flow: f, or pv of a flow loop; nothing if neither is there.
  std::optional<LoopTag> FlowTag() const;
};

/// The loops of a plant.
struct PlantTable {
  std::string source;
  std::vector<std::string> files;  ///< Patterns, relative to the table.
  std::string map;                 ///< As --map, --zone and --resample; empty:
  std::string zone;                ///< not stated.
  std::string resample;
  std::vector<PlantRow> rows;
};

/// Reads a table of loops. In CSV each row is a loop and the header has the
/// keys; rows with the name * hold defaults, for all or for their group. In
/// TOML:
///
///     files = ["export/*.csv"]
///     [defaults]                 # or [group.NAME]
///     op = "{loop}.OP"           # {loop} is the name of the row
///     [[loop]]
///     name = "FIC101"
///     type = "lublin-actuator-3"
///
/// docs/plant.md has all keys. An error in one row is its
/// PlantRow::error.
/// @throws NotFoundError, ConfigError or DataError if the file as a whole
///   cannot be read: syntax, no header, an unknown key of the header.
PlantTable ReadPlantTable(const std::filesystem::path& path);

/// The columns of a file, or the tags of a long one, for look-ups by name.
class TagNames {
 public:
  explicit TagNames(std::vector<std::string> names);

  /// The names that `pattern` means: in its spelling, else in any case; with *,
  /// all that match in any case. A name that occurs twice is given twice.
  std::vector<std::string> Find(const std::string& pattern) const;
  /// Up to four that contain `part`, else the first four.
  std::vector<std::string> Like(const std::string& part) const;
  const std::vector<std::string>& all() const { return names_; }

 private:
  std::vector<std::string> names_;
  std::vector<std::string> lower_;
  std::unordered_multimap<std::string, std::size_t> exact_;
  std::unordered_multimap<std::string, std::size_t> any_case_;
};

/// The columns of one file that are the tags of a row.
struct TagMatch {
  std::array<std::string, kLoopTagCount> columns;  ///< Empty: not there.
  std::vector<std::string> unmatched;              ///< "sp = FIC101.SP"
  std::vector<std::string> ambiguous;  ///< "op = FIC101.*: FIC101.OP, ..."
  std::string error;  ///< Why the row cannot be read from it; empty: it can.

  const std::string& operator[](LoopTag tag) const {
    return columns[static_cast<std::size_t>(tag)];
  }
};

/// A default pattern that is not there leaves its tag out; a tag of the row's
/// own, or op, is required, as is one of pv and x.
TagMatch MatchTags(const PlantRow& row, const TagNames& names,
                   const std::string& source);

/// The column of a tag whose values keep their own unit, as PV and SP do.
ColumnMapping OwnUnitColumn(const PlantRow& row, const TagMatch& match,
                            LoopTag tag, Signal signal);
/// `file`, the form of the file, with the columns of a row: as a loop (op, pv,
/// sp, x, mode) for the audit, or as a valve (op, x, flow, p1, p2, t1, mode).
/// @throws ConfigError naming an unknown unit and those that are accepted.
ColumnMap LoopColumns(const PlantRow& row, const TagMatch& match,
                      ColumnMap file);
ColumnMap ValveColumns(const PlantRow& row, const TagMatch& match,
                       ColumnMap file);

}  // namespace fdi::importer
