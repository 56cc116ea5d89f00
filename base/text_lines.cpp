#include "base/text_lines.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <utility>

#include <unistd.h>
#include <zlib.h>

#include "base/csv_cells.h"
#include "base/error.h"
#include "base/text.h"

namespace fdi {
namespace {

constexpr std::size_t kKept = 16U << 20U;
constexpr std::size_t kBlock = 1U << 20U;
constexpr std::size_t kLongestLine = 2U << 20U;
constexpr std::size_t kUnpackedAlways = 4U << 20U;
constexpr std::size_t kUnpackedTable = 200U << 20U;
constexpr std::size_t kUnpackedText = 32U << 20U;
constexpr std::size_t kPiped = std::size_t{2} << 30U;
constexpr std::string_view kUtf8Mark = "\xEF\xBB\xBF";

void AppendUtf8(char32_t code, std::string& out) {
  const auto tail = [&](int shift) {
    out += static_cast<char>(0x80U | ((code >> shift) & 0x3FU));
  };
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xC0U | (code >> 6U));
    tail(0);
  } else if (code < 0x10000) {
    out += static_cast<char>(0xE0U | (code >> 12U));
    tail(6);
    tail(0);
  } else {
    out += static_cast<char>(0xF0U | (code >> 18U));
    tail(12);
    tail(6);
    tail(0);
  }
}

// A code point above U+FFFF less 0x10000 has twenty bits: a pair of units,
// 0xD800 plus the upper and 0xDC00 plus the lower ten. A byte order mark is
// dropped.
std::string FromUtf16(std::string_view bytes, bool big_endian) {
  const auto unit = [&](std::size_t i) {
    const auto byte = [&](std::size_t at) {
      return static_cast<unsigned char>(bytes[at]);
    };
    return static_cast<char32_t>(big_endian ? byte(i) << 8U | byte(i + 1)
                                            : byte(i + 1) << 8U | byte(i));
  };
  std::string text;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    char32_t code = unit(i);
    if (code >= 0xD800 && code < 0xDC00 && i + 3 < bytes.size()) {
      i += 2;
      code = 0x10000 + ((code - 0xD800) << 10U) + (unit(i) - 0xDC00);
    }
    if (i > 0 || code != 0xFEFF) {
      AppendUtf8(code, text);
    }
  }
  return text;
}

enum class Encoding { kUtf8, kLatin1, kUtf16Little, kUtf16Big };

// Checks the number of continuation bytes (10xxxxxx) after each first byte, not
// whether the code point is valid. That is enough: in Latin-1 a letter with an
// accent is rarely followed by just such bytes.
class Utf8Check {
 public:
  void Take(std::string_view text) {
    for (const char c : text) {
      const auto byte = static_cast<unsigned char>(c);
      const bool tail = (byte & 0xC0U) == 0x80U;
      valid_ = valid_ && tail == (more_ > 0);
      more_ = tail          ? more_ - (more_ > 0 ? 1 : 0)
              : byte < 0x80 ? 0
              : byte < 0xE0 ? 1
              : byte < 0xF0 ? 2
                            : 3;
    }
  }
  bool valid() const { return valid_ && more_ == 0; }

 private:
  std::size_t more_{0};
  bool valid_{true};
};

// The order of the tests matters. A file in UTF-16 of ASCII text is also valid
// UTF-8 with zeros in it, so UTF-16 is tested first. Latin-1 comes last,
// because every sequence of bytes is valid in it.
Encoding EncodingOf(std::string_view head, bool is_utf8,
                    const std::string& source) {
  const auto zero_at = [&](std::size_t i) {
    return head.size() > i && head[i] == '\0';
  };
  if (head.starts_with("\x1F\x8B")) {
    throw DataError(source +
                    ": is a gzip within a gzip: unpack it with gunzip first");
  }
  if (zero_at(0) && zero_at(1)) {
    throw DataError(source + ": is binary, not text: export it as CSV");
  }
  if (head.starts_with("PK\x03\x04")) {
    throw DataError(source +
                    ": is a spreadsheet or zip archive, not text: save it as "
                    "CSV (or unpack it)");
  }
  if (head.starts_with("PAR1")) {
    throw DataError(source +
                    ": is a Parquet file: docs/import.md has the line of "
                    "DuckDB that makes it a CSV");
  }
  if (head.starts_with("\xFF\xFE") || zero_at(1)) {
    return Encoding::kUtf16Little;
  }
  if (head.starts_with("\xFE\xFF") || zero_at(0)) {
    return Encoding::kUtf16Big;
  }
  return is_utf8 ? Encoding::kUtf8 : Encoding::kLatin1;
}

// Converts a whole text, or blocks that cut no UTF-16 unit and no pair of them.
std::string Converted(std::string bytes, Encoding encoding,
                      const std::string& source) {
  std::string text;
  if (encoding == Encoding::kUtf8) {
    text = std::move(bytes);
  } else if (encoding == Encoding::kLatin1) {
    for (const char c : bytes) {
      AppendUtf8(static_cast<unsigned char>(c), text);
    }
  } else {
    text = FromUtf16(bytes, encoding == Encoding::kUtf16Big);
  }
  if (text.find('\0') != std::string::npos) {
    throw DataError(source + ": is binary, not text: export it as CSV");
  }
  return text;
}

std::string SourceOf(const std::filesystem::path& path) {
  return path == "-" ? "stdin" : path.string();
}

/// Calls take(bytes, whether they were unpacked).
template <typename TakeBytes>
void Unpack(const std::filesystem::path& path, std::size_t at_most,
            const TakeBytes& take) {
  const bool is_stdin = path == "-";
  const std::string source = SourceOf(path);
  std::error_code error;
  if (!is_stdin && !std::filesystem::exists(path, error)) {
    throw NotFoundError("no file " + source);
  }
  if (!is_stdin && std::filesystem::is_directory(path, error)) {
    throw DataError(source + ": is a directory, not a file");
  }
  // zlib passes uncompressed files through.
  const auto close = [](gzFile file) { gzclose(file); };
  const std::unique_ptr<gzFile_s, decltype(close)> file(
      // gzclose() closes the descriptor. stdin itself has to stay open, hence
      // dup().
      is_stdin ? gzdopen(dup(STDIN_FILENO), "rb") : gzopen(path.c_str(), "rb"),
      close);
  if (!file) {
    throw DataError(source + ": cannot be opened: " + std::strerror(errno));
  }
  std::array<char, 65536> part;
  std::size_t bytes = 0;
  int count = 0;
  while ((count = gzread(file.get(), part.data(), part.size())) > 0) {
    bytes += static_cast<std::size_t>(count);
    // Ordinary tables shrink to a fifth or a twentieth; a few kilobytes that
    // unpack to gigabytes are an accident or an attack.
    const bool is_packed = gzdirect(file.get()) == 0;
    const z_off_t packed = gzoffset(file.get());  // -1 for a pipe.
    const std::size_t limit =
        packed < 0 ? at_most
                   : std::clamp(100 * static_cast<std::size_t>(packed),
                                kUnpackedAlways, at_most);
    if (is_packed && bytes > limit) {
      throw DataError(source + ": unpacks to more than " +
                      (limit == at_most
                           ? std::to_string(at_most >> 20U) + " MiB"
                           : std::string("100 times its size")) +
                      "; if it is right, unpack it with gunzip first");
    }
    take(std::string_view(part.data(), static_cast<std::size_t>(count)),
         is_packed);
  }
  // gzread() returns 0 at the end of a truncated file, too; only gzerror() then
  // says Z_BUF_ERROR.
  int code = Z_OK;
  const char* reason = gzerror(file.get(), &code);
  if (count < 0 || code != Z_OK) {
    throw DataError(source + ": cannot be read: " +
                    (code == Z_ERRNO ? std::strerror(errno) : reason) +
                    (code == Z_ERRNO ? "" : "; try gzip -t, or export again"));
  }
}

using File = std::shared_ptr<std::FILE>;

File TemporaryFile(const std::string& source) {
  File file(std::tmpfile(), [](std::FILE* f) {
    if (f != nullptr) {
      std::fclose(f);
    }
  });
  if (file == nullptr) {
    throw DataError(source + ": needs a temporary file in " + P_tmpdir + ": " +
                    std::strerror(errno));
  }
  return file;
}

void Append(std::string_view bytes, std::FILE& file,
            const std::string& source) {
  if (std::fwrite(bytes.data(), 1, bytes.size(), &file) != bytes.size() ||
      std::fflush(&file) != 0) {
    throw DataError(
        source + ": its " + P_tmpdir +
        " has no room for the unpacked text: " + std::strerror(errno));
  }
}

std::string ReadAt(std::FILE& file, std::size_t begin, std::size_t size,
                   const std::string& source) {
  std::string bytes(size, '\0');
  std::size_t done = 0;
  while (done < size) {
    const ssize_t count = pread(fileno(&file), bytes.data() + done, size - done,
                                static_cast<off_t>(begin + done));
    if (count < 0 && errno == EINTR) {
      continue;
    }
    if (count <= 0) {
      throw DataError(source + ": cannot be read: " +
                      (count < 0 ? std::strerror(errno)
                                 : "it became shorter while it was read"));
    }
    done += static_cast<std::size_t>(count);
  }
  return bytes;
}

// Without any LF, CR is taken as the line break (old Macintosh files).
void BreakAtCr(std::string& text, bool has_lf) {
  if (!has_lf) {
    std::ranges::replace(text, '\r', '\n');
  }
}

/// A text in a file, and what its first reading showed.
struct Spool {
  std::string head;
  File file;
  std::size_t size{0};
  Utf8Check utf8;
  bool has_lf{false};
  bool packed{false};
};

// Reads the file once. A text that does not fit into memory is read again from
// the file itself, or from a temporary one if it has to be unpacked.
Spool SpoolOf(const std::filesystem::path& path, const std::string& source) {
  Spool raw;
  bool own_file = path == "-" || !std::filesystem::is_regular_file(path);
  Unpack(path, kUnpackedTable, [&](std::string_view part, bool is_packed) {
    raw.packed = raw.packed || is_packed;
    raw.utf8.Take(part);
    raw.has_lf = raw.has_lf || part.find('\n') != std::string_view::npos;
    raw.size += part.size();
    if (raw.file == nullptr && raw.size <= kKept) {
      raw.head += part;
      return;
    }
    own_file = own_file || is_packed;
    if (own_file && raw.size > kPiped) {
      throw DataError(source +
                      ": has more than 2 GiB and is no file; try a file");
    }
    if (raw.file == nullptr && own_file) {
      // Bytes from a device without end are no text either.
      EncodingOf(raw.head, true, source);
      raw.file = TemporaryFile(source);
      Append(raw.head, *raw.file, source);
    } else if (raw.file == nullptr) {
      raw.file = File(std::fopen(path.c_str(), "rb"), [](std::FILE* f) {
        if (f != nullptr) {
          std::fclose(f);
        }
      });
      if (raw.file == nullptr) {
        throw DataError(source + ": cannot be opened: " + std::strerror(errno));
      }
    }
    if (own_file) {
      Append(part, *raw.file, source);
    }
  });
  return raw;
}

// To a file of its own, in UTF-8 with LF.
File Convert(const Spool& raw, Encoding encoding, const std::string& source) {
  File file = TemporaryFile(source);
  const bool wide =
      encoding == Encoding::kUtf16Little || encoding == Encoding::kUtf16Big;
  std::size_t at = 0;
  while (at < raw.size) {
    std::size_t size = std::min(kBlock, raw.size - at);
    std::string bytes = ReadAt(*raw.file, at, size, source);
    // The first half of a pair goes into the next block.
    const std::size_t high =
        encoding == Encoding::kUtf16Big ? size - 2 : size - 1;
    if (wide && size == kBlock &&
        (static_cast<unsigned char>(bytes[high]) & 0xFCU) == 0xD8U) {
      size -= 2;
      bytes.resize(size);
    }
    std::string text = Converted(std::move(bytes), encoding, source);
    BreakAtCr(text, raw.has_lf);
    Append(text, *file, source);
    at += size;
  }
  return file;
}

}  // namespace

std::string ToUtf8(std::string bytes, const std::string& source) {
  Utf8Check utf8;
  utf8.Take(bytes);
  const Encoding encoding = EncodingOf(bytes, utf8.valid(), source);
  std::string text = Converted(std::move(bytes), encoding, source);
  text.erase(0, text.starts_with(kUtf8Mark) ? kUtf8Mark.size() : 0);
  BreakAtCr(text, text.find('\n') != std::string::npos);
  return text;
}

std::string ReadTextFile(const std::filesystem::path& path) {
  std::string bytes;
  Unpack(path, kUnpackedText,
         [&](std::string_view part, bool) { bytes += part; });
  return ToUtf8(std::move(bytes), SourceOf(path));
}

std::string LinePlaces::At(std::size_t line) const {
  Part part{name, 1, 1};
  if (parts) {
    const auto next = std::ranges::upper_bound(*parts, line, {}, &Part::first);
    part = next == parts->begin() ? part : *std::prev(next);
  }
  return part.file + ':' + std::to_string(line - part.first + part.line);
}

TextLines::TextLines(std::string_view text, LinePlaces places)
    : places_(std::move(places)),
      text_(text),
      end_(text.size()),
      count_(static_cast<std::size_t>(std::ranges::count(text, '\n'))) {
  count_ += !text.empty() && text.back() != '\n' ? 1U : 0U;
}

namespace {

// The tables of a folder by name; a map or a note beside them is none.
std::vector<std::filesystem::path> TablesIn(
    const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::filesystem::path& path = entry.path();
    std::string kind = Lower(path.extension().string());
    kind = kind == ".gz" ? Lower(path.stem().extension().string()) : kind;
    std::error_code none;
    if ((kind == ".csv" || kind == ".txt" || kind == ".tsv") &&
        entry.is_regular_file(none)) {
      files.push_back(path);
    }
  }
  if (error) {
    throw DataError(folder.string() + ": cannot be read: " + error.message());
  }
  if (files.empty()) {
    throw DataError(folder.string() +
                    ": is a folder without a table: expected a .csv, .tsv or "
                    ".txt file for each tag");
  }
  std::ranges::sort(files);
  return files;
}

struct Header {
  char separator{','};
  std::size_t line{0};
  std::vector<std::string> names;
};

// Comments and a line with the separator may come before the names, as in a
// table of its own; titles may not.
Header HeaderOf(const std::filesystem::path& file) {
  const TextLines lines = TextLines::OfFile(file);
  constexpr std::size_t kShown = 20;
  Header header;
  std::vector<std::string> shown;
  lines.ForEach([&](std::string_view line, std::size_t number) {
    const bool blank =
        line.find_first_not_of(" \t\r") == std::string_view::npos;
    if (!blank && !line.starts_with('#') && !line.starts_with("sep=")) {
      header.line = shown.empty() ? number : header.line;
      shown.emplace_back(line);
    }
    return shown.size() < kShown;
  });
  const std::vector<std::string_view> views(shown.begin(), shown.end());
  header.separator = FindSeparator(views);
  CsvCells record(header.separator);
  if (shown.empty() || !record.TakeLine(shown.front())) {
    throw DataError(file.string() +
                    ": has no names of columns in one line, which a file in a "
                    "folder of tags needs");
  }
  header.names = record.cells();
  return header;
}

// A cell that may hold any text.
std::string InQuotes(std::string_view text) {
  std::string cell = "\"";
  for (const char c : text) {
    cell += c == '"' ? "\"\"" : std::string(1, c);
  }
  return cell + '"';
}

// The tag of each file: its name, or that of its last column where this is all
// that differs between the headers.
std::vector<std::string> TagsOf(const std::vector<std::filesystem::path>& files,
                                std::vector<Header>& headers) {
  const Header first = headers.front();
  const bool by_file = std::ranges::all_of(headers, [&](const Header& header) {
    return header.names == first.names;
  });
  std::vector<std::string> tags;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const std::string header = Listed(headers[i].names);
    std::vector<std::string>& names = headers[i].names;
    std::filesystem::path name = files[i].filename();
    name = Lower(name.extension().string()) == ".gz" ? name.stem() : name;
    const std::string tag = by_file ? name.stem().string() : names.back();
    names.back() = first.names.back();
    if (names != first.names || headers[i].separator != first.separator) {
      throw DataError(files[i].string() + ":" +
                      std::to_string(headers[i].line) + ": its header is " +
                      Quoted(header) + ", that of " +
                      files.front().filename().string() + " is " +
                      Quoted(Listed(first.names)) +
                      ": expected one header in all files of a folder");
    }
    if (std::ranges::find(tags, tag) != tags.end()) {
      throw DataError(files[i].string() + ": is a second file for the tag " +
                      Quoted(tag) +
                      ": expected one, or names of columns of "
                      "which each differs from the others");
    }
    tags.push_back(tag);
  }
  if (!by_file) {
    headers.front().names.back() = "value";
  }
  return tags;
}

}  // namespace

// Each file is read twice, so that a folder of many does not take their memory.
TextLines TextLines::OfFolder(const std::filesystem::path& folder) {
  TextLines joined;
  joined.places_.name = SourceOf(folder);
  const auto parts = std::make_shared<std::vector<LinePlaces::Part>>();
  joined.places_.parts = parts;
  joined.file_ = TemporaryFile(joined.places_.name);
  std::vector<Header> headers;
  const std::vector<std::filesystem::path> files = TablesIn(folder);
  std::ranges::transform(files, std::back_inserter(headers), HeaderOf);
  const std::vector<std::string> tags = TagsOf(files, headers);
  const char sign = headers.front().separator;
  std::string text = "tag";
  for (const std::string& name : headers.front().names) {
    text += sign + InQuotes(name);
  }
  text += '\n';
  const auto flush = [&] {
    Append(text, *joined.file_, joined.places_.name);
    joined.end_ += text.size();
    text.clear();
  };
  std::size_t count = 1;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const TextLines table = OfFile(files[i]);
    joined.packed_ = joined.packed_ || table.packed();
    parts->push_back({files[i].string(), count + 1, headers[i].line + 1});
    CsvCells record(sign);
    table.ForEach(
        [&](std::string_view line, std::size_t) {
          const bool begins = !record.open();
          record.TakeLine(line);
          text += begins && !record.blank() ? InQuotes(tags[i]) + sign : "";
          text += line;
          text += '\n';
          ++count;
          if (text.size() > kBlock) {
            flush();
          }
          return true;
        },
        headers[i].line + 1);
  }
  flush();
  joined.CountLines();
  return joined;
}

TextLines TextLines::OfFile(const std::filesystem::path& path) {
  const std::string source = SourceOf(path);
  std::error_code none;
  if (path != "-" && std::filesystem::is_directory(path, none)) {
    return OfFolder(path);
  }
  Spool raw = SpoolOf(path, source);
  if (raw.file == nullptr) {
    auto own = std::make_shared<const std::string>(
        ToUtf8(std::move(raw.head), source));
    TextLines lines(*own, {source});
    lines.own_ = std::move(own);
    lines.packed_ = raw.packed;
    return lines;
  }
  const Encoding encoding = EncodingOf(raw.head, raw.utf8.valid(), source);
  TextLines lines;
  lines.places_.name = source;
  lines.packed_ = raw.packed;
  const bool as_is = encoding == Encoding::kUtf8 && raw.has_lf;
  lines.file_ = as_is ? raw.file : Convert(raw, encoding, source);
  if (std::fseek(lines.file_.get(), 0, SEEK_END) != 0) {
    throw DataError(source + ": cannot be read: " + std::strerror(errno));
  }
  lines.end_ = as_is ? raw.size
                     : static_cast<std::size_t>(std::ftell(lines.file_.get()));
  if (lines.end_ > kUtf8Mark.size() &&
      ReadAt(*lines.file_, 0, kUtf8Mark.size(), source) == kUtf8Mark) {
    lines.begin_ = kUtf8Mark.size();
  }
  // The part of the text that was kept is no longer needed.
  raw.head = std::string();
  lines.CountLines();
  return lines;
}

void TextLines::CountLines() {
  ForEach([&](std::string_view line, std::size_t number) {
    if (line.find('\0') != std::string_view::npos) {
      throw DataError(places_.name + ": is binary, not text: export it as CSV");
    }
    count_ = number;
    return true;
  });
}

std::string_view TextLines::Block(std::size_t begin, std::size_t end,
                                  std::string& buffer) const {
  if (file_ == nullptr) {
    return text_.substr(begin, end - begin);
  }
  buffer = ReadAt(*file_, begin, end - begin, places_.name);
  return buffer;
}

void TextLines::CheckLength(std::size_t length, std::size_t number) const {
  if (length > kLongestLine) {
    throw DataError(places_.At(number) +
                    ": the line is longer than 2 MiB; expected a table with "
                    "a line break behind each row");
  }
}

void TextLines::ForEach(const Take& take, std::size_t first) const {
  std::string buffer;
  std::string cut;  // The begin of a line that goes on in the next block.
  std::size_t number = 1;
  for (std::size_t at = begin_; at < end_;) {
    const std::size_t end = std::min(at + kBlock, end_);
    std::string_view block = Block(at, end, buffer);
    at = end;
    while (!block.empty()) {
      const std::size_t found = block.find('\n');
      const std::string_view piece = block.substr(0, found);
      CheckLength(cut.size() + piece.size(), number);
      if (found == std::string_view::npos && at < end_) {
        cut += piece;
        break;
      }
      const std::string_view line =
          cut.empty() ? piece : std::string_view(cut += piece);
      if (number >= first && !take(line, number)) {
        return;
      }
      cut.clear();
      ++number;
      block.remove_prefix(found == std::string_view::npos ? block.size()
                                                          : found + 1);
    }
  }
}

void TextLines::ForEachBackwards(const Take& take, std::size_t last) const {
  std::string buffer;
  std::string cut;  // The end of a line that begins in the block before.
  std::size_t number = count_;
  std::size_t end = end_;
  bool at_end = true;  // The break behind the last line begins no other.
  while (end > begin_ && number >= last) {
    const std::size_t begin = end - std::min(kBlock, end - begin_);
    std::string_view block = Block(begin, end, buffer);
    end = begin;
    if (std::exchange(at_end, false) && block.ends_with('\n')) {
      block.remove_suffix(1);
    }
    for (;;) {
      const std::size_t found = block.rfind('\n');
      const std::string_view piece =
          block.substr(found == std::string_view::npos ? 0 : found + 1);
      CheckLength(cut.size() + piece.size(), number);
      cut.insert(0, piece);
      if (found == std::string_view::npos && begin > begin_) {
        break;
      }
      if (number < last || !take(cut, number)) {
        return;
      }
      --number;
      cut.clear();
      if (found == std::string_view::npos) {
        return;
      }
      block = block.substr(0, found);
    }
  }
}

}  // namespace fdi
