#pragma once

#include <cstddef>
#include <string_view>

namespace fdi::report {

/// A screen of standard output for a text that is printed again and again, such
/// as a table of what is live. Lines are cut at its edge. What was on the
/// terminal comes back at the end.
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
