#pragma once

#include <cstdint>
#include <string>

namespace CLI {
class App;
}

namespace fdi::cli {

struct Context;

/// The options --since and --until of a verb.
struct TimeWindow {
  std::string since;
  std::string until;

  void AddTo(CLI::App& verb);
  /// The smallest number there is without --since. @throws ConfigError
  std::int64_t since_ns(const Context& context) const;
  /// The largest number there is without --until. @throws ConfigError
  std::int64_t until_ns(const Context& context) const;
};

/// The user who runs the program: the default of --by.
std::string UserName();

/// "fdi-store anna@host": where an entry was typed.
std::string Origin(const std::string& program);

}  // namespace fdi::cli
