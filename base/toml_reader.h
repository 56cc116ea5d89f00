#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace fdi {

/// Reads a TOML file in which every key must be known: each getter marks its
/// key as known, and Finish() rejects the rest. All messages name file, line,
/// key and the accepted values.
///
///     TomlReader file(path);
///     config.seed = file.Integer("seed").value_or(config.seed);
///     for (TomlReader& fault : file.Tables("fault")) { ...; }
///     file.Finish();
class TomlReader {
 public:
  /// @throws NotFoundError if there is no such file; ConfigError on a syntax
  ///   error, with line and column.
  explicit TomlReader(const std::filesystem::path& path);
  /// Parses `text`; `name` replaces the file name in messages.
  TomlReader(std::string_view text, const std::string& name);
  ~TomlReader();
  TomlReader(TomlReader&&) noexcept;
  TomlReader& operator=(TomlReader&&) noexcept;

  /// Nothing if the key is absent. @throws ConfigError for another type.
  std::optional<double> Number(std::string_view key);
  std::optional<double> Number(std::string_view key, double minimum,
                               double maximum);
  std::optional<long long> Integer(std::string_view key);
  std::optional<bool> Boolean(std::string_view key);
  std::optional<std::string> Text(std::string_view key);
  std::vector<double> Numbers(std::string_view key);
  std::vector<std::string> Texts(std::string_view key);
  /// The table [key]; nothing if absent. The root's Finish() checks its keys,
  /// too.
  std::optional<TomlReader> Table(std::string_view key);
  /// The array of tables [[key]]; empty if absent.
  std::vector<TomlReader> Tables(std::string_view key);
  /// All keys of this table, sorted; marks none as known.
  std::vector<std::string> Keys() const;
  bool Has(std::string_view key) const;
  bool IsTable(std::string_view key) const;

  /// @throws ConfigError at `key`: "file:line: key: message".
  [[noreturn]] void Refuse(std::string_view key,
                           std::string_view message) const;
  /// Runs `read`; a ConfigError from it is reported at the place of `key`.
  template <typename Read>
  void At(std::string_view key, Read&& read) const {
    try {
      read();
    } catch (const ConfigError& error) {
      Refuse(key, error.what());
    }
  }
  /// @throws ConfigError naming the first key that no getter has read, and
  ///   those of its table that were read.
  void Finish() const;

 private:
  struct Document;
  struct Place;
  TomlReader(std::shared_ptr<Document> document, std::unique_ptr<Place> place);

  std::shared_ptr<Document> document_;
  std::unique_ptr<Place> place_;
};

}  // namespace fdi
