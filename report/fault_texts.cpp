#include "report/fault_texts.h"

#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "base/error.h"
#include "base/suggestion.h"
#include "base/text.h"
#include "base/toml_reader.h"
#include "report/shared_files.h"

// The words of the fault catalogue, faults.toml: the shipped file has all keys
// of all faults, and the file of the data directory and that of
// `--fault-catalogue` then override those that they state (docs/planner.md,
// "Your own words and limits").
namespace fdi::report {
namespace {

constexpr std::string_view kFileName = "faults.toml";
constexpr std::string_view kUnknown = "unknown";
constexpr std::string_view kFigures = "figure";

// Indexed by the enumerations.
constexpr std::array<std::string_view, 4> kDisciplines{"operator", "instrument",
                                                       "air", "mechanical"};
constexpr std::array<std::string_view, 4> kNamur{"maintenance required",
                                                 "out of specification",
                                                 "check function", "failure"};

std::string KeyOf(int fault) {
  return fault == 0 ? std::string(kUnknown) : FaultName(fault);
}

std::optional<int> FaultOf(std::string_view key) {
  return key == kUnknown ? 0 : ParseFinding(key);
}

template <typename E>
E Choice(const TomlReader& table, std::string_view key, const std::string& word,
         std::span<const std::string_view> words) {
  const auto place = std::ranges::find(words, word);
  if (place == words.end()) {
    table.Refuse(key, "'" + word + "' is none of " + JoinText(words));
  }
  return static_cast<E>(place - words.begin());
}

// [[f1.severity]] from = 0.3, level = "high": each band goes up to the next.
SeverityBands ReadBands(TomlReader& table) {
  std::array<std::string_view, kSeverityCount> names;
  for (std::size_t i = 0; i < names.size(); ++i) {
    names[i] = SeverityName(static_cast<Severity>(i));
  }
  SeverityBands bands;
  for (TomlReader& row : table.Tables("severity")) {
    const auto from = row.Number("from", 0.0, 1.0);
    const auto level = row.Text("level");
    if (!from || !level) {
      table.Refuse("severity", "each band needs from and level");
    }
    if (bands.empty() ? *from != 0.0 : *from <= bands.back().from) {
      table.Refuse("severity", "bands begin at 0 and ascend");
    }
    bands.push_back({*from, Choice<Severity>(row, "level", *level, names)});
  }
  return bands;
}

// Reads the keys that a fault and a figure have in common.
template <typename Entry>
void ReadWords(TomlReader& table, Entry& text) {
  text.name = table.Text("name").value_or(text.name);
  text.check = table.Text("check").value_or(text.check);
  if (const auto word = table.Text("discipline")) {
    text.discipline =
        Choice<Discipline>(table, "discipline", *word, kDisciplines);
  }
  if (const auto word = table.Text("namur")) {
    text.namur = Choice<NamurClass>(table, "namur", *word, kNamur);
  }
}

void ReadFigure(TomlReader& table, FigureText& text) {
  ReadWords(table, text);
  text.unit = table.Text("unit").value_or(text.unit);
  for (auto [key, limit] : {std::pair("lowest", &text.lowest),
                            std::pair("highest", &text.highest)}) {
    if (const auto value = table.Number(key)) {
      *limit = value;
    }
  }
  if (text.lowest && text.highest && *text.lowest > *text.highest) {
    table.Refuse(table.Has("lowest") ? "lowest" : "highest",
                 "lowest is above highest");
  }
}

void ReadText(TomlReader& table, FaultText& text) {
  ReadWords(table, text);
  if (auto bands = ReadBands(table); !bands.empty()) {
    text.bands = std::move(bands);
  }
}

[[noreturn]] void RefuseFault(const TomlReader& file, const std::string& key) {
  std::vector<std::string> names{std::string(kUnknown), std::string(kFigures)};
  for (const int fault : kFaultsAndFindings) {
    names.push_back(FaultName(fault));
  }
  const auto meant = Suggest(key, names);
  file.Refuse(key, meant ? "unknown fault: did you mean '" + *meant + "'?"
                         : "unknown fault; accepted are " +
                               std::string(kFaultNames) + ", unknown");
}

}  // namespace

std::string_view DisciplineName(Discipline discipline) {
  return kDisciplines[static_cast<std::size_t>(discipline)];
}

std::string_view NamurName(NamurClass namur) {
  return kNamur[static_cast<std::size_t>(namur)];
}

std::string_view StatusName(std::optional<NamurClass> status) {
  return status ? NamurName(*status) : "good";
}

// Requires every key for every fault; Override() then rejects unknown ones.
FaultTexts::FaultTexts(const std::filesystem::path& path) {
  TomlReader file(path);
  const auto require = [&file](const std::string& fault) {
    const auto table = file.Table(fault);
    for (const char* key :
         {"name", "check", "discipline", "namur", "severity"}) {
      if (!table || !table->Has(key)) {
        file.Refuse(fault, std::string(key) + " is missing");
      }
    }
  };
  require(std::string(kUnknown));
  for (const int fault : kFaultsAndFindings) {
    require(FaultName(fault));
  }
  const auto figures = file.Table(kFigures);
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const std::string name(loop::FigureName(static_cast<loop::Figure>(i)));
    if (!figures || !figures->Has(name)) {
      file.Refuse(kFigures, name + " is missing");
    }
  }
  Override(path);
}

void FaultTexts::Override(const std::filesystem::path& path) {
  TomlReader file(path);
  if (auto figures = file.Table(kFigures)) {
    for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
      if (auto table =
              figures->Table(loop::FigureName(static_cast<loop::Figure>(i)))) {
        ReadFigure(*table, figures_[i]);
      }
    }
  }
  for (const std::string& key : file.Keys()) {
    if (key == kFigures) {
      continue;
    }
    const auto fault = FaultOf(key);
    auto table = fault ? file.Table(key) : std::nullopt;
    if (!table) {
      RefuseFault(file, key);
    }
    ReadText(*table, texts_[*fault]);
  }
  file.Finish();
}

const FaultText& FaultTexts::Of(int fault) const {
  const auto text = texts_.find(fault);
  Require(text != texts_.end(), "fault is not of the catalogue");
  return text->second;
}

// For several faults that are one answer, the words have the names and
// disciplines of all, the gravest class and severity, and the check of the
// first. A priority that was stored with the episode gives the severity better
// than today's catalogue.
FaultWords FaultTexts::Words(std::string_view answer, double strength,
                             std::optional<std::int64_t> priority) const {
  FaultWords words;
  std::vector<Discipline> disciplines;
  // "f3|f6": faults that the diagnosis cannot distinguish.
  while (true) {
    const std::size_t bar = std::min(answer.find('|'), answer.size());
    const FaultText& text = Of(FaultOf(answer.substr(0, bar)).value_or(0));
    if (words.name.empty()) {
      words.check = text.check;
    }
    words.name += (words.name.empty() ? "" : " or ") + text.name;
    if (std::ranges::find(disciplines, text.discipline) == disciplines.end()) {
      disciplines.push_back(text.discipline);
    }
    words.namur = std::max(words.namur, text.namur);
    words.severity = std::max(words.severity, SeverityAt(text.bands, strength));
    if (bar == answer.size()) {
      break;
    }
    answer.remove_prefix(bar + 1);
  }
  if (priority) {
    words.severity = SeverityOf(*priority).value_or(words.severity);
  }
  words.discipline = JoinText(disciplines, "|", DisciplineName);
  return words;
}

std::map<std::string, std::string> FaultTexts::Names() const {
  std::map<std::string, std::string> names;
  for (const auto& [fault, text] : texts_) {
    names[KeyOf(fault)] = text.name;
  }
  return names;
}

SeverityCatalogue FaultTexts::Severities() const {
  SeverityCatalogue severities;
  for (const auto& [fault, text] : texts_) {
    severities[fault] = text.bands;
  }
  return severities;
}

FaultTexts LoadFaultTexts(const GlobalOptions& options) {
  FaultTexts texts(SharedFile(kFileName));
  if (const auto own = options.data_dir / kFileName;
      std::filesystem::exists(own)) {
    texts.Override(own);
  }
  return texts;
}

Json FaultTextsJson(const FaultTexts& texts) {
  Json rows = Json::array();
  std::vector<int> faults(kFaultsAndFindings.begin(), kFaultsAndFindings.end());
  faults.push_back(0);
  for (const int fault : faults) {
    const FaultText& text = texts.Of(fault);
    Json bands = Json::array();
    for (const SeverityBand& band : text.bands) {
      bands.push_back({{"from", band.from},
                       {"level", std::string(SeverityName(band.level))}});
    }
    rows.push_back(
        {{"fault", KeyOf(fault)},
         {"name", text.name},
         {"check", text.check},
         {"discipline", std::string(DisciplineName(text.discipline))},
         {"namur", std::string(NamurName(text.namur))},
         {"severity", bands},
         {"label", IsFault(fault)}});
  }
  Json figures = Json::array();
  for (std::size_t i = 0; i < loop::kFigureCount; ++i) {
    const auto figure = static_cast<loop::Figure>(i);
    const FigureText& text = texts.Of(figure);
    figures.push_back(
        {{"figure", std::string(loop::FigureName(figure))},
         {"name", text.name},
         {"unit", text.unit},
         {"check", text.check},
         {"discipline", std::string(DisciplineName(text.discipline))},
         {"namur", std::string(NamurName(text.namur))},
         {"lowest", text.lowest ? Json(*text.lowest) : Json()},
         {"highest", text.highest ? Json(*text.highest) : Json()}});
  }
  return {{"faults", rows}, {"figures", figures}};
}

}  // namespace fdi::report
