#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>

namespace fdi::monitor {

/// Gives each served valve a small number, so that the threads behind need no
/// names. Bounded: what is beyond `max_valves` or not matched by the glob gets
/// none, and of refused names only a bounded set of hashes is kept.
///
/// One thread; the names stay where they are as long as the directory lives.
class ValveDirectory {
 public:
  struct Entry {
    std::uint32_t index;
    const std::string* name;
  };
  enum class Answer : std::uint8_t { kServed, kFiltered, kRefused };

  /// @param glob as in a shell: * ? [...].
  ValveDirectory(int max_valves, std::string glob);

  /// @param entry set if the answer is kServed.
  Answer Find(std::string_view valve_id, Entry& entry);

  std::size_t size() const { return entries_.size(); }
  /// Distinct valves refused, exact up to 65536.
  std::size_t refused() const { return refused_.size(); }

 private:
  struct Hash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const {
      return std::hash<std::string_view>{}(text);
    }
  };

  std::size_t max_valves_;
  std::string glob_;
  std::unordered_map<std::string, std::uint32_t, Hash, std::equal_to<>>
      entries_;
  std::unordered_set<std::size_t> refused_;
};

/// Whether `text` matches `glob`: * ? [...], nothing escapes.
bool GlobMatches(const std::string& glob, std::string_view text);

}  // namespace fdi::monitor
