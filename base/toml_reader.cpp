#include "base/toml_reader.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <set>
#include <sstream>

#include <toml++/toml.h>

#include "base/error.h"
#include "base/suggestion.h"
#include "base/toml_limits.h"

namespace fdi {

// The file and, for each of its tables, the keys that were read.
// Places refer to the document and to its tables. The document is on the heap,
// shared by all readers of the file, and its tables never change after parsing.
// Readers can therefore be moved and outlive the root, and a table's address
// can serve as its key.
struct TomlReader::Document {
  std::string name;
  toml::table root;
  std::map<const toml::table*, std::set<std::string, std::less<>>> known;
};

// A table of the file.
struct TomlReader::Place {
  Document& document;
  const toml::table* table;
  std::string path;  // "fault." or empty.

  // The value of `key`, which becomes known; nullptr if it is absent.
  const toml::node* Find(std::string_view key) const {
    document.known[table].emplace(key);
    return table->get(key);
  }

  // The value of `key` as exactly a T; `expected` describes it.
  template <typename T>
  std::optional<T> Value(std::string_view key, const char* expected) const {
    const toml::node* node = Find(key);
    if (node == nullptr) {
      return std::nullopt;
    }
    // value<T>() would convert between types.
    auto value = node->value_exact<T>();
    if (!value) {
      Refuse(key, std::string("expected ") + expected);
    }
    return value;
  }

  // Calls take(element) for each element of a list while it returns true.
  template <typename F>
  void ForEach(std::string_view key, const std::string& expected,
               const F& take) const {
    const toml::node* node = Find(key);
    if (node == nullptr) {
      return;
    }
    const toml::array* list = node->as_array();
    if (list == nullptr || !std::all_of(list->begin(), list->end(), take)) {
      Refuse(key, "expected " + expected);
    }
  }

  // The table `node` at `key`; none of its keys is known yet.
  std::unique_ptr<Place> Inner(const toml::node& node,
                               std::string_view key) const {
    // Makes the entry even if no getter follows, so that Finish() checks this
    // table.
    document.known[node.as_table()];
    return std::make_unique<Place>(
        Place{document, node.as_table(), path + std::string(key) + '.'});
  }

  [[noreturn]] void Refuse(std::string_view key,
                           std::string_view message) const {
    const toml::node* node = table->get(key);
    const toml::node& place =
        node != nullptr ? *node : static_cast<const toml::node&>(*table);
    std::ostringstream text;
    text << document.name << ':' << place.source().begin.line << ": " << path
         << key << ": " << message;
    throw ConfigError(text.str());
  }
};

namespace {

toml::table ParseToml(std::string_view text, const std::string& name) {
  CheckTomlLimits(text, name);
  try {
    return toml::parse(text, name);
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << name << ':' << error.source().begin.line << ':'
            << error.source().begin.column << ": " << error.description();
    throw ConfigError(message.str());
  }
}

std::string ReadAll(const std::filesystem::path& path) {
  if (!std::filesystem::exists(path)) {
    throw NotFoundError("no file " + path.string());
  }
  // Asked before it is opened, because a FIFO would be waited for.
  if (!std::filesystem::is_regular_file(path)) {
    throw DataError("cannot read " + path.string());
  }
  std::ifstream in(path, std::ios::binary);
  // A byte too many is refused with the other limits.
  std::string text(std::min<std::uintmax_t>(std::filesystem::file_size(path),
                                            kMaxTomlBytes + 1),
                   '\0');
  if (!in.read(text.data(), static_cast<std::streamsize>(text.size()))) {
    throw DataError("cannot read " + path.string());
  }
  return text;
}

}  // namespace

TomlReader::TomlReader(const std::filesystem::path& path)
    : TomlReader(ReadAll(path), path.string()) {}

TomlReader::TomlReader(std::string_view text, const std::string& name)
    : document_(std::make_shared<Document>()) {
  document_->name = name;
  document_->root = ParseToml(text, name);
  place_ = std::make_unique<Place>(Place{*document_, &document_->root, ""});
}

TomlReader::TomlReader(std::shared_ptr<Document> document,
                       std::unique_ptr<Place> place)
    : document_(std::move(document)), place_(std::move(place)) {}

TomlReader::~TomlReader() = default;
TomlReader::TomlReader(TomlReader&&) noexcept = default;
TomlReader& TomlReader::operator=(TomlReader&&) noexcept = default;

bool TomlReader::Has(std::string_view key) const {
  return place_->table->contains(key);
}

bool TomlReader::IsTable(std::string_view key) const {
  const toml::node* node = place_->table->get(key);
  return node != nullptr && node->is_table();
}

// TOML tells 1 from 1.0; a number may be written either way.
std::optional<double> TomlReader::Number(std::string_view key) {
  const toml::node* node = place_->Find(key);
  if (node != nullptr && !node->is_number()) {
    Refuse(key, "expected a number");
  }
  return node == nullptr ? std::nullopt : node->value<double>();
}

std::optional<double> TomlReader::Number(std::string_view key, double minimum,
                                         double maximum) {
  const auto value = Number(key);
  // Negated so that TOML's nan is refused, too.
  if (value && !(*value >= minimum && *value <= maximum)) {
    std::ostringstream message;
    message << *value << " is not in " << minimum << ".." << maximum;
    Refuse(key, message.str());
  }
  return value;
}

std::optional<long long> TomlReader::Integer(std::string_view key) {
  return place_->Value<std::int64_t>(key, "a whole number");
}

std::optional<bool> TomlReader::Boolean(std::string_view key) {
  return place_->Value<bool>(key, "true or false");
}

std::optional<std::string> TomlReader::Text(std::string_view key) {
  return place_->Value<std::string>(key, "text in quotes");
}

std::vector<double> TomlReader::Numbers(std::string_view key) {
  std::vector<double> values;
  place_->ForEach(key, "a list of numbers",
                  [&values](const toml::node& element) {
                    if (element.is_number()) {
                      values.push_back(*element.value<double>());
                    }
                    return element.is_number();
                  });
  return values;
}

std::vector<std::string> TomlReader::Texts(std::string_view key) {
  std::vector<std::string> values;
  place_->ForEach(key, "a list of texts", [&values](const toml::node& element) {
    if (element.is_string()) {
      values.push_back(*element.value_exact<std::string>());
    }
    return element.is_string();
  });
  return values;
}

std::optional<TomlReader> TomlReader::Table(std::string_view key) {
  const toml::node* node = place_->Find(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  if (!node->is_table()) {
    Refuse(key, "expected a table");
  }
  return TomlReader(document_, place_->Inner(*node, key));
}

std::vector<TomlReader> TomlReader::Tables(std::string_view key) {
  std::vector<TomlReader> tables;
  place_->ForEach(
      key, "tables, each headed by [[" + std::string(key) + "]]",
      [this, &tables, key](const toml::node& element) {
        if (element.is_table()) {
          tables.push_back(TomlReader(document_, place_->Inner(element, key)));
        }
        return element.is_table();
      });
  return tables;
}

std::vector<std::string> TomlReader::Keys() const {
  std::vector<std::string> keys;
  for (const auto& [key, node] : *place_->table) {
    keys.emplace_back(key.str());
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

void TomlReader::Refuse(std::string_view key, std::string_view message) const {
  place_->Refuse(key, message);
}

// Only tables that were opened have an entry. A table that nobody opened is
// itself a key of its parent, unknown there.
void TomlReader::Finish() const {
  // A key that no getter has read is unknown: usually it is mistyped, and
  // ignoring it would silently use the default.
  for (const auto& [table, known] : document_->known) {
    for (const auto& [toml_key, node] : *table) {
      const std::string key(toml_key.str());
      if (known.contains(key)) {
        continue;
      }
      const std::vector<std::string> names(known.begin(), known.end());
      std::ostringstream text;
      text << document_->name << ':' << node.source().begin.line
           << ": unknown key '" << key << "'";
      if (const auto meant = Suggest(key, names)) {
        text << ": did you mean '" << *meant << "'?";
      } else {
        text << "; accepted are";
        for (const std::string& name : names) {
          text << ' ' << name;
        }
      }
      throw ConfigError(text.str());
    }
  }
}

}  // namespace fdi
