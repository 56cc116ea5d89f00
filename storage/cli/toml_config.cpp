#include "storage/cli/toml_config.h"

#include <charconv>
#include <sstream>

#include <toml++/toml.h>

#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

std::string TextOf(const toml::node& node, const std::string& key) {
  if (const auto text = node.value_exact<std::string>()) {
    return *text;
  }
  if (const auto flag = node.value_exact<bool>()) {
    return *flag ? "true" : "false";
  }
  if (const auto integer = node.value_exact<std::int64_t>()) {
    return std::to_string(*integer);
  }
  if (const auto number = node.value_exact<double>()) {
    char text[64];
    const auto end = std::to_chars(text, text + sizeof text, *number);
    return {text, end.ptr};
  }
  std::ostringstream message;
  message << "line " << node.source().begin.line << ": " << key
          << ": expected text, a number, true or false";
  throw fdi::ConfigError(message.str());
}

void Collect(const toml::table& table, std::vector<std::string>& parents,
             std::vector<CLI::ConfigItem>& items) {
  for (const auto& [toml_key, node] : table) {
    const std::string key(toml_key.str());
    if (const toml::table* inner = node.as_table()) {
      parents.push_back(key);
      Collect(*inner, parents, items);
      parents.pop_back();
      continue;
    }
    CLI::ConfigItem item;
    item.parents = parents;
    item.name = key;
    if (const toml::array* list = node.as_array()) {
      for (const toml::node& element : *list) {
        item.inputs.push_back(TextOf(element, key));
      }
    } else {
      item.inputs.push_back(TextOf(node, key));
    }
    items.push_back(std::move(item));
  }
}

// The value of an option, with the type that its text has.
void Insert(toml::table& table, const std::string& key,
            const std::string& text) {
  std::int64_t integer = 0;
  double number = 0.0;
  const char* end = text.data() + text.size();
  if (text == "true" || text == "false") {
    table.insert_or_assign(key, text == "true");
  } else if (auto r = std::from_chars(text.data(), end, integer);
             r.ec == std::errc() && r.ptr == end) {
    table.insert_or_assign(key, integer);
  } else if (auto r2 = std::from_chars(text.data(), end, number);
             r2.ec == std::errc() && r2.ptr == end) {
    table.insert_or_assign(key, number);
  } else {
    table.insert_or_assign(key, text);
  }
}

toml::table Effective(const CLI::App& app) {
  toml::table table;
  for (const CLI::Option* option : app.get_options()) {
    if (!option->get_configurable() || option == app.get_help_ptr() ||
        option->get_lnames().empty()) {
      continue;
    }
    const std::string& key = option->get_lnames().front();
    const bool flag = option->get_expected_max() == 0;
    if (option->count() > 1 && !flag) {
      toml::array list;
      for (const std::string& text : option->results()) {
        list.push_back(text);
      }
      table.insert_or_assign(key, std::move(list));
    } else if (option->count() > 0) {
      Insert(table, key, option->results().front());
    } else if (flag) {
      table.insert_or_assign(key, false);
    } else if (const std::string text = option->get_default_str();
               !text.empty() && text != "\"\"") {
      const bool quoted = text.size() > 1 && text.front() == '"';
      Insert(table, key, quoted ? text.substr(1, text.size() - 2) : text);
    }
  }
  for (const CLI::App* verb : app.get_subcommands()) {
    table.insert_or_assign(verb->get_name(), Effective(*verb));
  }
  return table;
}

}  // namespace

std::vector<CLI::ConfigItem> TomlConfig::from_config(std::istream& in) const {
  try {
    const toml::table table = toml::parse(in);
    std::vector<CLI::ConfigItem> result;
    std::vector<std::string> parents;
    Collect(table, parents, result);
    return result;
  } catch (const toml::parse_error& error) {
    std::ostringstream message;
    message << "line " << error.source().begin.line << ", column "
            << error.source().begin.column << ": " << error.description();
    throw fdi::ConfigError(message.str());
  }
}

std::string TomlConfig::to_config(const CLI::App* app, bool /*default_also*/,
                                  bool /*write_description*/,
                                  std::string /*prefix*/) const {
  std::ostringstream text;
  text << Effective(*app) << '\n';
  return text.str();
}

}  // namespace fdi::cli
