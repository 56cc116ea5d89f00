#include "import/plant_table.h"

#include <algorithm>
#include <map>
#include <span>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "base/toml_reader.h"
#include "diagnosis/model/valve_costs.h"
#include "import/tag_map.h"

// Both forms of the table, TOML and CSV, are first read into a RawTable: cells
// of text by key, the defaults apart from the rows. RowReader makes the rows
// from it, so that a key means the same in both forms. An error in
// one row stays with that row; one in the file or its defaults is
// thrown.
namespace fdi::importer {
namespace {

using NamedCells = std::map<std::string, std::string>;

constexpr std::array<std::string_view, kLoopTagCount> kTagNames = {
    "op", "pv", "sp", "mode", "x", "f", "p1", "p2", "t1"};
constexpr std::string_view kOtherKeys[] = {
    "name",  "sense", "service",     "type",     "grade",    "group",   "file",
    "from",  "to",    "auto",        "manual",   "report",   "max_age", "topic",
    "value", "time",  "description", "location", "document", "costs"};
// Tells rows without a model set from those with a forgotten type.
constexpr std::string_view kDataOnly = "data only";

// All keys of a row. A tag has a unit and a range, but the mode, which is
// words.
std::vector<std::string> KnownKeys() {
  std::vector<std::string> keys(std::begin(kOtherKeys), std::end(kOtherKeys));
  for (const std::string_view tag : kTagNames) {
    keys.emplace_back(tag);
    if (tag != "mode") {
      keys.push_back(std::string(tag) + "_unit");
      keys.push_back(std::string(tag) + "_range");
    }
  }
  return keys;
}

bool IsKnown(const std::string& key) {
  static const std::vector<std::string> kKeys = KnownKeys();
  return std::ranges::find(kKeys, key) != kKeys.end();
}

// The words of a list. Three separators are accepted, because in CSV one of
// them may separate the cells; lists of TOML arrive with commas.
std::vector<std::string> Words(const std::string& text) {
  std::vector<std::string> words;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end =
        std::min(text.find_first_of(",;|", begin), text.size());
    const std::string word = text.substr(begin, end - begin);
    const std::size_t first = word.find_first_not_of(' ');
    if (first != std::string::npos) {
      words.push_back(
          word.substr(first, word.find_last_not_of(' ') + 1 - first));
    }
    begin = end + 1;
  }
  return words;
}

// Reads one row, with the defaults behind it.
class RowReader {
 public:
  RowReader(const NamedCells& own, std::span<const NamedCells* const> defaults)
      : own_(own), defaults_(defaults) {}

  // Name and group come first: they fill the placeholders of the tags and
  // files.
  PlantRow Read(std::string place) {
    row_.place = std::move(place);
    row_.name = Cell("name");
    CheckName();
    row_.group = Cell("group");
    ReadTags();
    ReadKind();
    ReadIdentity();
    row_.file = Filled(Cell("file"));
    row_.from = Cell("from");
    row_.to = Cell("to");
    row_.auto_words = Words(Cell("auto"));
    row_.manual_words = Words(Cell("manual"));
    ReadLive();
    return std::move(row_);
  }

 private:
  // Only the first mistake is reported: later ones may just follow from it.
  void Refuse(const std::string& what) {
    if (row_.error.empty()) {
      row_.error = what;
    }
  }

  bool IsOwn(const std::string& key) const {
    const auto found = own_.find(key);
    return found != own_.end() && !found->second.empty();
  }

  // "-" in a row takes a default away.
  std::string Cell(const std::string& key) const {
    if (IsOwn(key)) {
      const std::string& cell = own_.at(key);
      return cell == "-" ? "" : cell;
    }
    for (const NamedCells* cells : defaults_) {
      const auto found = cells->find(key);
      if (found != cells->end() && !found->second.empty()) {
        return found->second;
      }
    }
    return {};
  }

  // Replaces {loop} and {group}. The search goes on behind what was filled in,
  // so a brace in a name is not taken for a placeholder.
  // @param live leaves {signal} and {tag}, which differ from tag to tag.
  std::string Filled(std::string text, bool live = false) {
    std::size_t begin = 0;
    while ((begin = text.find('{', begin)) != std::string::npos) {
      const std::size_t end = text.find('}', begin);
      const std::string key = text.substr(begin + 1, end - begin - 1);
      if (live && (key == "signal" || key == "tag")) {
        begin = end;
        continue;
      }
      if (end == std::string::npos || (key != "loop" && key != "group")) {
        Refuse(Quoted(text) +
               " has a placeholder other than {loop} and "
               "{group}; correct it, or write the tag itself");
        return text;
      }
      const std::string& value = key == "loop" ? row_.name : row_.group;
      text.replace(begin, end + 1 - begin, value);
      begin += value.size();
    }
    return text;
  }

  // The name becomes the pattern of the valve's entry in models.db, where a
  // star or a question mark would match other valves, too.
  void CheckName() {
    const std::string& name = row_.name;
    if (name.empty()) {
      Refuse("the row has no name; type name = the id of its valve or loop");
    } else if (name.find_first_of("*?") != std::string::npos) {
      Refuse("the name " + Quoted(name) + " has * or ?; a row is one loop");
    } else if (std::ranges::any_of(name, [](unsigned char c) {
                 return c < ' ' || c == 0x7F;
               })) {
      Refuse("the name " + Quoted(name) + " has a control character");
    }
  }

  void ReadTags() {
    for (std::size_t i = 0; i < kLoopTagCount; ++i) {
      const std::string key(kTagNames[i]);
      TagCell& tag = row_.tags[i];
      tag.pattern = Filled(Cell(key));
      // A tag that the row itself states has to be in the file; one of a
      // default may be missing (MatchTags).
      tag.own = IsOwn(key);
      tag.unit = Cell(key + "_unit");
      if (const std::string range = Cell(key + "_range"); !range.empty()) {
        const std::size_t dots = range.find("..");
        const auto low = ParseNumber(range.substr(0, dots));
        const auto high =
            dots == std::string::npos
                ? std::nullopt
                : ParseNumber(std::string_view(range).substr(dots + 2));
        if (low && high && *low < *high) {
          tag.range = std::pair(*low, *high);
        } else {
          Refuse(key + "_range is " + Quoted(range) +
                 "; type LOW..HIGH, such as 0..100 or 4..20");
        }
      }
    }
  }

  void ReadKind() {
    const std::string sense = Lower(Cell("sense"));
    if (!sense.empty() && sense != "closing" && sense != "opening") {
      Refuse("sense is " + Quoted(sense) + "; type closing or opening");
    }
    row_.sense = sense == "opening" ? Sense::kOpening : Sense::kClosing;
    const std::string service = Cell("service");
    if (!service.empty()) {
      row_.service = {static_cast<char>(service.front() & ~0x20)};
      if (service.size() != 1 || std::string_view("FPLTA").find(row_.service) ==
                                     std::string_view::npos) {
        row_.service.clear();
        Refuse("service is " + Quoted(service) +
               "; type one letter, F, P, L, "
               "T or A");
      }
    }
    row_.type = Cell("type");
    if (SameName(row_.type, kDataOnly) || SameName(row_.type, "data_only")) {
      row_.type.clear();
    }
    if (const std::string grade = Cell("grade"); !grade.empty()) {
      if (grade == "1" || grade == "2" || grade == "3") {
        row_.grade = grade.front() - '0';
      } else {
        Refuse("grade is " + Quoted(grade) +
               "; type 1 (most important), 2 or "
               "3");
      }
    }
  }

  void ReadIdentity() {
    row_.description = Filled(Cell("description"));
    row_.location = Filled(Cell("location"));
    row_.document = Filled(Cell("document"));
    row_.costs = Cell("costs");
    try {
      ParseCosts(row_.costs);
    } catch (const ConfigError& error) {
      Refuse(error.what());
    }
  }

  // Reads how the tags come while the plant runs.
  void ReadLive() {
    row_.report = Lower(Cell("report"));
    if (!row_.report.empty() && row_.report != "exception" &&
        row_.report != "periodic") {
      Refuse("report is " + Quoted(row_.report) +
             "; type exception or periodic");
    }
    if (const std::string age = Cell("max_age"); !age.empty()) {
      try {
        row_.max_age_s = 1e-9 * static_cast<double>(ParseDuration(age));
      } catch (const ConfigError& error) {
        Refuse("max_age: " + std::string(error.what()));
      }
    }
    row_.topic = Filled(Cell("topic"), true);
    row_.value_key = Filled(Cell("value"), true);
    row_.time_key = Filled(Cell("time"), true);
  }

  const NamedCells& own_;
  std::span<const NamedCells* const> defaults_;
  PlantRow row_;
};

// The rows of either form, and their defaults: for all under "".
struct RawTable {
  struct Row {
    std::string place;
    NamedCells cells;
    std::string error;
  };
  std::map<std::string, NamedCells> defaults;
  std::vector<Row> rows;
};

// A cell is that of the row, else of its group, else of the defaults of all.
// The group itself may be a default of all, so it is found out before the rest.
// If rows share a name, all but the first are refused.
std::vector<PlantRow> RowsOf(const RawTable& raw) {
  static const NamedCells kNone;
  std::vector<PlantRow> rows;
  std::map<std::string, std::string> places;  // By name.
  const auto defaults_of = [&](const std::string& group) {
    const auto found = raw.defaults.find(group);
    return found == raw.defaults.end() ? &kNone : &found->second;
  };
  for (const RawTable::Row& from : raw.rows) {
    const auto own = from.cells.find("group");
    const NamedCells* all = defaults_of("");
    const std::string group = own != from.cells.end() && !own->second.empty()
                                  ? own->second
                              : all->contains("group") ? all->at("group")
                                                       : "";
    const NamedCells* chain[] = {group.empty() ? &kNone : defaults_of(group),
                                 all};
    PlantRow row = RowReader(from.cells, chain).Read(from.place);
    if (!from.error.empty()) {
      row.error = from.error;
    }
    const auto [first, added] = places.try_emplace(row.name, row.place);
    if (!added && !row.name.empty()) {
      row.error = "the name " + Quoted(row.name) + " is that of " +
                  first->second + ", too; give one of the two another name";
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

// A number, a range or a list of the file as text, as in a cell of CSV.
std::string CellOf(TomlReader& table, const std::string& key) {
  // The reader refuses a value of another type, so the types are tried in turn.
  const auto tried = [](const auto& read) -> std::optional<std::string> {
    try {
      return read();
    } catch (const ConfigError&) {
      return std::nullopt;
    }
  };
  if (auto text = tried([&] { return table.Text(key).value_or(""); })) {
    return *text;
  }
  if (auto text =
          tried([&] { return NumberText(table.Number(key).value_or(0.0)); })) {
    return *text;
  }
  if (auto text = tried([&] {
        const std::vector<double> range = table.Numbers(key);
        if (range.size() != 2) {
          throw ConfigError("not a range");
        }
        return NumberText(range[0]) + ".." + NumberText(range[1]);
      })) {
    return *text;
  }
  return Listed(table.Texts(key));  // Or refused, with file and line.
}

std::string UnknownKey(const std::string& key) {
  return "unknown key " + Quoted(key) + "; there are " + Listed(KnownKeys());
}

NamedCells CellsOf(TomlReader& table, std::string& error) {
  NamedCells cells;
  for (const std::string& key : table.Keys()) {
    if (!IsKnown(key)) {
      error = UnknownKey(key);
      continue;
    }
    try {
      cells[key] = CellOf(table, key);
    } catch (const ConfigError& refused) {
      error = refused.what();
    }
  }
  return cells;
}

NamedCells DefaultsOf(TomlReader table) {
  std::string error;
  NamedCells cells = CellsOf(table, error);
  if (!error.empty()) {
    throw ConfigError("defaults: " + error);
  }
  return cells;
}

RawTable ReadToml(TomlReader& file, PlantTable& table) {
  for (const std::string& key : file.Keys()) {
    constexpr std::string_view kKeys[] = {
        "files", "map", "zone", "resample", "defaults", "group", "loop"};
    if (std::ranges::find(kKeys, key) == std::end(kKeys)) {
      file.Refuse(key,
                  "is unknown; there are files, map, zone, resample, "
                  "[defaults], [group.NAME] and [[loop]]");
    }
  }
  table.files = file.Texts("files");
  table.map = file.Text("map").value_or("");
  table.zone = file.Text("zone").value_or("");
  table.resample = file.Text("resample").value_or("");
  RawTable raw;
  if (auto defaults = file.Table("defaults")) {
    raw.defaults[""] = DefaultsOf(std::move(*defaults));
  }
  if (auto groups = file.Table("group")) {
    for (const std::string& name : groups->Keys()) {
      raw.defaults[name] = DefaultsOf(std::move(*groups->Table(name)));
    }
  }
  for (TomlReader& loop : file.Tables("loop")) {
    RawTable::Row& row = raw.rows.emplace_back();
    row.cells = CellsOf(loop, row.error);
    row.place = table.source + " [[loop]] " + std::to_string(raw.rows.size());
  }
  return raw;
}

// True if a line that begins with # may be a row, with a name like #12.
bool MayBeRow(std::string_view line, char separator, std::size_t columns) {
  CsvCells cells(separator);
  return columns > 1 && cells.TakeLine(line) && cells.cells().size() >= columns;
}

// The rows of a CSV. A line that begins with # is a comment, unless a quoted
// cell is open; one with the cells of a row is left out as a row with an error.
// The separator is found out from the first fifty lines, the
// first row is the header, and rows with the name * are defaults: of the group
// that they name, or of all.
RawTable ReadCells(const std::string& text, const PlantTable& table) {
  std::vector<std::string_view> lines;
  for (std::string_view rest = text; !rest.empty();) {
    const std::size_t end = std::min(rest.find('\n'), rest.size() - 1);
    lines.push_back(rest.substr(0, end + (rest[end] == '\n' ? 0 : 1)));
    rest.remove_prefix(end + 1);
  }
  std::vector<std::string_view> first;
  for (const std::string_view line : lines) {
    if (!line.empty() && !line.starts_with('#') && first.size() < 50) {
      first.push_back(line);
    }
  }
  const char separator = FindSeparator(first);
  CsvCells reader(separator);
  std::vector<std::string> keys;
  RawTable raw;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool comment = !reader.open() && lines[i].starts_with('#');
    if ((comment && !MayBeRow(lines[i], separator, keys.size())) ||
        !reader.TakeLine(lines[i]) || reader.blank()) {
      continue;
    }
    if (keys.empty()) {
      for (const std::string& cell : reader.cells()) {
        keys.push_back(Lower(cell));
        if (!cell.empty() && !IsKnown(keys.back())) {
          throw DataError(table.source + ":" + std::to_string(i + 1) + ": " +
                          UnknownKey(cell));
        }
      }
      continue;
    }
    reader.Trim(keys.size());
    RawTable::Row row;
    row.place = table.source + ":" + std::to_string(i + 1);
    if (reader.cells().size() > keys.size()) {
      row.error = "the row has " + std::to_string(reader.cells().size()) +
                  " cells, the header " + std::to_string(keys.size()) +
                  "; put text with separators in quotes";
    }
    if (comment) {
      row.error =
          "it begins with #, as a comment does, and has the cells of a row: "
          "put a name with # in quotes, or leave the row out";
    }
    for (std::size_t c = 0; c < std::min(keys.size(), reader.cells().size());
         ++c) {
      row.cells[keys[c]] = reader.cells()[c];
    }
    if (const auto name = row.cells.find("name");
        name != row.cells.end() && name->second == "*") {
      if (!row.error.empty()) {
        throw DataError(row.place + ": " + row.error);
      }
      const std::string group = row.cells["group"];
      row.cells.erase("name");
      raw.defaults[group] = std::move(row.cells);
    } else {
      raw.rows.push_back(std::move(row));
    }
  }
  if (reader.open()) {
    throw DataError(table.source + ": a quote is open at the end of the file");
  }
  return raw;
}

}  // namespace

std::string_view LoopTagName(LoopTag tag) {
  return kTagNames[static_cast<std::size_t>(tag)];
}

std::optional<LoopTag> PlantRow::FlowTag() const {
  if (!(*this)[LoopTag::kF].pattern.empty()) {
    return LoopTag::kF;
  }
  return service == "F" && !(*this)[LoopTag::kPv].pattern.empty()
             ? std::optional(LoopTag::kPv)
             : std::nullopt;
}

PlantTable ReadPlantTable(const std::filesystem::path& path) {
  PlantTable table;
  table.source = path.string();
  RawTable raw;
  if (SameName(path.extension().string(), ".toml")) {
    TomlReader file(path);
    raw = ReadToml(file, table);
  } else {
    raw = ReadCells(ReadTextFile(path), table);
  }
  table.rows = RowsOf(raw);
  if (table.rows.empty()) {
    throw DataError(table.source +
                    ": no loop; expected rows below a header with name, op, "
                    "pv, ... or [[loop]] in TOML");
  }
  return table;
}

// Two columns of a file may have one name, hence the multimaps. That makes the
// name ambiguous for the rows that use it, but the file can still be read.
TagNames::TagNames(std::vector<std::string> names) : names_(std::move(names)) {
  for (std::size_t i = 0; i < names_.size(); ++i) {
    lower_.push_back(Lower(names_[i]));
    exact_.emplace(names_[i], i);
    any_case_.emplace(lower_.back(), i);
  }
}

// The same spelling wins over other cases, and both win over stars, so that a
// tag can be stated which has a star in its own name.
std::vector<std::string> TagNames::Find(const std::string& pattern) const {
  std::vector<std::size_t> found;
  const auto look_up = [&](const auto& names, const std::string& name) {
    const auto [begin, end] = names.equal_range(name);
    for (auto at = begin; at != end; ++at) {
      found.push_back(at->second);
    }
  };
  look_up(exact_, pattern);
  const std::string lower = Lower(pattern);
  if (found.empty()) {
    look_up(any_case_, lower);
  }
  if (found.empty() && pattern.find('*') != std::string::npos) {
    for (std::size_t i = 0; i < lower_.size(); ++i) {
      if (MatchesStars(lower, lower_[i])) {
        found.push_back(i);
      }
    }
  }
  std::ranges::sort(found);
  std::vector<std::string> names;
  for (const std::size_t i : found) {
    names.push_back(names_[i]);
  }
  return names;
}

std::vector<std::string> TagNames::Like(const std::string& part) const {
  constexpr std::size_t kShown = 4;
  const std::string lower = Lower(part);
  std::vector<std::string> like;
  for (std::size_t i = 0; i < names_.size() && like.size() < kShown; ++i) {
    if (!lower.empty() && lower_[i].find(lower) != std::string::npos) {
      like.push_back(names_[i]);
    }
  }
  if (like.empty()) {
    like.assign(names_.begin(),
                names_.begin() + static_cast<std::ptrdiff_t>(
                                     std::min(kShown, names_.size())));
  }
  return like;
}

// Every tag is looked up even if an earlier one was refused: the dry run lists
// all that is not there or ambiguous, while the row is refused for the first.
TagMatch MatchTags(const PlantRow& row, const TagNames& names,
                   const std::string& source) {
  TagMatch match;
  const auto refuse = [&](const std::string& what) {
    if (match.error.empty()) {
      match.error = what;
    }
  };
  for (std::size_t i = 0; i < kLoopTagCount; ++i) {
    const TagCell& tag = row.tags[i];
    const std::string key(kTagNames[i]);
    if (tag.pattern.empty()) {
      continue;
    }
    const std::string stated = key + " = " + tag.pattern;
    const std::vector<std::string> found = names.Find(tag.pattern);
    if (found.size() > 1) {
      const std::vector<std::string> shown(
          found.begin(),
          found.begin() + std::min<std::ptrdiff_t>(
                              4, static_cast<std::ptrdiff_t>(found.size())));
      match.ambiguous.push_back(stated + ": " + Listed(shown));
      refuse(stated + " matches " + std::to_string(found.size()) +
             " columns of " + source + " (" + Listed(shown) +
             "); type the one that is meant");
    } else if (found.empty()) {
      match.unmatched.push_back(stated);
      if (tag.own || i == static_cast<std::size_t>(LoopTag::kOp)) {
        refuse(stated + " is not in " + source + ", which has " +
               Listed(names.Like(row.name)) + "; correct " + key +
               ", or the file");
      }
    } else {
      match.columns[i] = found.front();
    }
  }
  if (row[LoopTag::kOp].pattern.empty()) {
    refuse("op is not stated; type op = the tag of the controller's output");
  }
  if (match[LoopTag::kPv].empty() && match[LoopTag::kX].empty()) {
    refuse("neither pv nor x is in " + source + ", which has " +
           Listed(names.Like(row.name)) +
           "; type pv = the tag of the measured "
           "value");
  }
  for (std::size_t i = 0; i < kLoopTagCount; ++i) {
    for (std::size_t k = i + 1; k < kLoopTagCount; ++k) {
      // In a flow loop f may repeat pv.
      const bool flow = i == static_cast<std::size_t>(LoopTag::kPv) &&
                        k == static_cast<std::size_t>(LoopTag::kF);
      if (!match.columns[i].empty() && match.columns[i] == match.columns[k] &&
          !flow) {
        refuse(std::string(kTagNames[i]) + " and " + std::string(kTagNames[k]) +
               " are both " + match.columns[i] + "; correct one of them");
      }
    }
  }
  return match;
}

namespace {

// Readings that are beyond the range by a tenth are none.
void Bound(const std::optional<std::pair<double, double>>& range,
           ColumnMapping& mapping) {
  if (range) {
    const double margin = 0.1 * (range->second - range->first);
    mapping.lowest = range->first - margin;
    mapping.highest = range->second + margin;
  }
}

// The reading in the unit of the signal; see ReadUnit() of tag_map.cpp. The
// range of op and x is spread over 0..100 %, whatever the unit, and is 4..20
// for mA. For the others the range only bounds what counts as a reading.
ColumnMapping MappingOf(const PlantRow& row, LoopTag tag, Signal signal,
                        const std::string& column, ColumnMap& map) {
  const TagCell& cell = row[tag];
  ColumnMapping mapping;
  mapping.column = column;
  mapping.signal = signal;
  const bool percent = signal == Signal::kCv || signal == Signal::kX;
  const std::string name = cell.unit.empty() && signal != Signal::kF
                               ? std::string(SignalUnit(signal))
                               : cell.unit;
  const auto unit = FindUnit(signal, name == "mA" && percent ? "%" : name);
  if (!unit) {
    throw ConfigError(
        std::string(LoopTagName(tag)) + "_unit is " +
        (name.empty() ? std::string("missing") : Quoted(name)) +
        "; accepted are" + UnitNames(signal) +
        (IsGasUnit(name)
             ? "; a flow at standard conditions is not converted: "
               "name the unit in which it is a mass, or type " +
                   std::string(tag == LoopTag::kF ? "f" : "service") +
                   " = -, and the flow is left out"
             : ""));
  }
  mapping.scale = unit->scale;
  mapping.offset = unit->offset;
  mapping.unit = name;
  auto range = cell.range;
  if (name == "mA" && !range) {
    range = std::pair(4.0, 20.0);
  }
  if (range && percent) {
    mapping.scale = 100.0 / (range->second - range->first);
    mapping.offset = -range->first * mapping.scale;
  }
  Bound(range, mapping);
  if (percent) {
    mapping.sense = row.sense;
  }
  if (signal == Signal::kF) {
    map.flow_unit = unit->flow_unit;
  }
  return mapping;
}

void SetMode(const PlantRow& row, const TagMatch& match, ColumnMap& map) {
  map.mode_column = match[LoopTag::kMode];
  for (const std::string& word : row.auto_words) {
    map.mode_words.emplace(word, ValveMode::kAuto);
  }
  for (const std::string& word : row.manual_words) {
    map.mode_words.emplace(word, ValveMode::kManual);
  }
}

}  // namespace

ColumnMapping OwnUnitColumn(const PlantRow& row, const TagMatch& match,
                            LoopTag tag, Signal signal) {
  ColumnMapping mapping{match[tag], signal};
  Bound(row[tag].range, mapping);
  return mapping;
}

ColumnMap LoopColumns(const PlantRow& row, const TagMatch& match,
                      ColumnMap file) {
  // The audit has no model, and reads the measured value of any loop as F.
  file.columns = {
      MappingOf(row, LoopTag::kOp, Signal::kCv, match[LoopTag::kOp], file)};
  if (!match[LoopTag::kX].empty()) {
    file.columns.push_back(
        MappingOf(row, LoopTag::kX, Signal::kX, match[LoopTag::kX], file));
  }
  // PV and SP keep their own unit: nothing depends on it there.
  for (const auto& [tag, signal] : {std::pair(LoopTag::kPv, Signal::kF),
                                    std::pair(LoopTag::kSp, Signal::kSp)}) {
    if (!match[tag].empty()) {
      file.columns.push_back(OwnUnitColumn(row, match, tag, signal));
    }
  }
  file.flow_unit = FlowUnit::kM3PerHour;
  SetMode(row, match, file);
  return file;
}

ColumnMap ValveColumns(const PlantRow& row, const TagMatch& match,
                       ColumnMap file) {
  file.columns.clear();
  const auto add = [&](LoopTag tag, Signal signal) {
    if (!match[tag].empty()) {
      file.columns.push_back(MappingOf(row, tag, signal, match[tag], file));
    }
  };
  add(LoopTag::kOp, Signal::kCv);
  add(LoopTag::kX, Signal::kX);
  if (const auto flow = row.FlowTag()) {
    add(*flow, Signal::kF);
  }
  add(LoopTag::kP1, Signal::kP1);
  add(LoopTag::kP2, Signal::kP2);
  add(LoopTag::kT1, Signal::kT1);
  SetMode(row, match, file);
  return file;
}

}  // namespace fdi::importer
