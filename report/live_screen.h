#pragma once

#include <cstddef>
#include <string_view>

namespace fdi::report {

/// A screen of standard output for a text that is printed again and again, e.g.
/// a table of live values. Lines are cut at its edge. The former content of
/// the terminal comes back at the end.
class LiveScreen {
 public:
  /// @throws std::system_error if standard output is no terminal.
  LiveScreen();
  ~LiveScreen();
  LiveScreen(const LiveScreen&) = delete;
  LiveScreen& operator=(const LiveScreen&) = delete;

  std::size_t height() const;  ///< In lines.
  /// Replaces the text, of fewer lines than height().
  void Draw(std::string_view text) const;
};

}  // namespace fdi::report
