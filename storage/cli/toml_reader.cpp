#include "storage/cli/toml_reader.h"

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <set>
#include <sstream>

#include <toml++/toml.h>

#include "diagnosis/error.h"
#include "diagnosis/suggestion.h"

namespace fdi::cli {

// The file and, per table of it, the keys that were asked for.
struct TomlReader::Document {
  std::string name;
  toml::table root;
  std::map<const toml::table*, std::set<std::string, std::less<>>> known;
};

class TomlReader::Node {
 public:
  Node(const toml::table* t, std::string p) : table(t), path(std::move(p)) {}
  const toml::table* table;
  std::string path;  // "fault." or empty.
};

namespace {

toml::table ParseToml(std::string_view text, const std::string& name) {
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
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  if (!std::filesystem::is_regular_file(path) || !(text << in.rdbuf())) {
    throw DataError("cannot read " + path.string());
  }
  return text.str();
}

}  // namespace

TomlReader::TomlReader(const std::filesystem::path& path)
    : TomlReader(ReadAll(path), path.string()) {}

TomlReader::TomlReader(std::string_view text, const std::string& name)
    : document_(std::make_shared<Document>()) {
  document_->name = name;
  document_->root = ParseToml(text, name);
  node_ = std::make_unique<Node>(&document_->root, std::string());
}

TomlReader::TomlReader(std::shared_ptr<Document> document,
                       std::unique_ptr<Node> node)
    : document_(std::move(document)), node_(std::move(node)) {}

TomlReader::~TomlReader() = default;
TomlReader::TomlReader(TomlReader&&) noexcept = default;
TomlReader& TomlReader::operator=(TomlReader&&) noexcept = default;

bool TomlReader::Has(std::string_view key) const {
  return node_->table->contains(key);
}

bool TomlReader::IsTable(std::string_view key) const {
  const toml::node* node = node_->table->get(key);
  return node != nullptr && node->is_table();
}

std::optional<double> TomlReader::Number(std::string_view key) {
  document_->known[node_->table].emplace(key);
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  if (!node->is_number()) {
    Refuse(key, "expected a number");
  }
  return node->value<double>();
}

std::optional<double> TomlReader::Number(std::string_view key, double minimum,
                                         double maximum) {
  const auto value = Number(key);
  if (value && !(*value >= minimum && *value <= maximum)) {
    std::ostringstream message;
    message << *value << " is not in " << minimum << ".." << maximum;
    Refuse(key, message.str());
  }
  return value;
}

std::optional<long long> TomlReader::Integer(std::string_view key) {
  document_->known[node_->table].emplace(key);
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  const auto value = node->value_exact<std::int64_t>();
  if (!value) {
    Refuse(key, "expected a whole number");
  }
  return *value;
}

std::optional<bool> TomlReader::Boolean(std::string_view key) {
  document_->known[node_->table].emplace(key);
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  const auto value = node->value_exact<bool>();
  if (!value) {
    Refuse(key, "expected true or false");
  }
  return value;
}

std::optional<std::string> TomlReader::Text(std::string_view key) {
  document_->known[node_->table].emplace(key);
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  auto value = node->value_exact<std::string>();
  if (!value) {
    Refuse(key, "expected text in quotes");
  }
  return value;
}

std::vector<double> TomlReader::Numbers(std::string_view key) {
  document_->known[node_->table].emplace(key);
  std::vector<double> values;
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return values;
  }
  if (!node->is_array()) {
    Refuse(key, "expected a list of numbers");
  }
  for (const toml::node& element : *node->as_array()) {
    if (!element.is_number()) {
      Refuse(key, "expected a list of numbers");
    }
    values.push_back(*element.value<double>());
  }
  return values;
}

std::vector<std::string> TomlReader::Texts(std::string_view key) {
  document_->known[node_->table].emplace(key);
  std::vector<std::string> values;
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return values;
  }
  if (!node->is_array()) {
    Refuse(key, "expected a list of texts");
  }
  for (const toml::node& element : *node->as_array()) {
    const auto value = element.value_exact<std::string>();
    if (!value) {
      Refuse(key, "expected a list of texts");
    }
    values.push_back(*value);
  }
  return values;
}

std::optional<TomlReader> TomlReader::Table(std::string_view key) {
  document_->known[node_->table].emplace(key);
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return std::nullopt;
  }
  if (!node->is_table()) {
    Refuse(key, "expected a table");
  }
  document_->known[node->as_table()];
  return TomlReader(
      document_, std::make_unique<Node>(node->as_table(),
                                        node_->path + std::string(key) + '.'));
}

std::vector<TomlReader> TomlReader::Tables(std::string_view key) {
  document_->known[node_->table].emplace(key);
  std::vector<TomlReader> tables;
  const toml::node* node = node_->table->get(key);
  if (node == nullptr) {
    return tables;
  }
  if (!node->is_array()) {
    Refuse(key, "expected tables, each headed by [[" + std::string(key) + "]]");
  }
  for (const toml::node& element : *node->as_array()) {
    if (!element.is_table()) {
      Refuse(key,
             "expected tables, each headed by [[" + std::string(key) + "]]");
    }
    document_->known[element.as_table()];
    tables.push_back(TomlReader(
        document_,
        std::make_unique<Node>(element.as_table(),
                               node_->path + std::string(key) + '.')));
  }
  return tables;
}

std::vector<std::string> TomlReader::Keys() const {
  std::vector<std::string> keys;
  for (const auto& [key, node] : *node_->table) {
    keys.emplace_back(key.str());
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

void TomlReader::Refuse(std::string_view key, std::string_view message) const {
  const toml::node* node = node_->table->get(key);
  const toml::node& place =
      node != nullptr ? *node : static_cast<const toml::node&>(*node_->table);
  std::ostringstream text;
  text << document_->name << ':' << place.source().begin.line << ": "
       << node_->path << key << ": " << message;
  throw ConfigError(text.str());
}

void TomlReader::Finish() const {
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

}  // namespace fdi::cli
