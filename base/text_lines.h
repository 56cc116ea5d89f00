#pragma once

#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace fdi {

/// Where the lines of a text are, for messages.
struct LinePlaces {
  /// A file of a folder that is read as one table.
  struct Part {
    std::string file;
    std::size_t first;  ///< Line of its first row in the table,
    std::size_t line;   ///< and in the file.
  };
  std::string name{"input"};                         ///< Of the file or folder.
  std::shared_ptr<const std::vector<Part>> parts{};  ///< Null: one file.

  /// "plant.csv:12"; of a folder the file and its own line.
  std::string At(std::size_t line) const;
};

/// The lines of a text, read in passes. At most 16 MiB of a file are kept in
/// memory: a longer one is read again in each pass, from a temporary file
/// without a name if it has to be unpacked or converted to UTF-8. So a gzip of
/// a few megabytes does not take the memory of the text that it unpacks to.
class TextLines {
 public:
  /// Gets a line, without its break, and its number from 1; @returns whether to
  /// go on. The line is valid during the call.
  using Take = std::function<bool(std::string_view, std::size_t)>;

  /// @param text has to outlive this.
  explicit TextLines(std::string_view text, LinePlaces places = {});
  /// Lines of a file, or of stdin for `-`, as ReadTextFile() reads it. A folder
  /// with a file for each tag is one table with a first column `tag`: the name
  /// of the file without its extension, or that of its last column where this
  /// is all that differs between the headers.
  /// @throws as ReadTextFile(); DataError if the temporary file cannot be
  ///   written, or if a folder has no table or tables with different headers.
  static TextLines OfFile(const std::filesystem::path& path);

  /// @throws DataError if a line is longer than 2 MiB.
  void ForEach(const Take& take, std::size_t first = 1) const;
  /// From the last line to `last`.
  void ForEachBackwards(const Take& take, std::size_t last = 1) const;

  /// True if the file was a gzip.
  bool packed() const { return packed_; }
  const LinePlaces& places() const { return places_; }
  /// Size of the text.
  std::size_t bytes() const { return end_ - begin_; }

 private:
  TextLines() = default;
  static TextLines OfFolder(const std::filesystem::path& folder);
  void CountLines();
  std::string_view Block(std::size_t begin, std::size_t end,
                         std::string& buffer) const;
  void CheckLength(std::size_t length, std::size_t number) const;

  LinePlaces places_;
  std::shared_ptr<const std::string> own_;
  std::string_view text_;  // Unless it is in file_.
  std::shared_ptr<std::FILE> file_;
  std::size_t begin_{0};  // Behind a byte order mark.
  std::size_t end_{0};
  std::size_t count_{0};
  bool packed_{false};
};

}  // namespace fdi
