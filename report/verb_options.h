#pragma once

#include <cstdint>
#include <string>

namespace CLI {
class App;
}

namespace fdi::report {

struct Context;

/// The options --from and --to of a verb.
struct TimeWindow {
  std::string since;
  std::string until;

  void AddTo(CLI::App& verb);
  /// The smallest int64 without --from. @throws ConfigError
  std::int64_t since_ns(const Context& context) const;
  /// The largest int64 without --to. @throws ConfigError
  std::int64_t until_ns(const Context& context) const;
};

/// The user who runs the program: the default of --by.
std::string UserName();

/// "fdi-store anna@host": the origin of an operator action.
std::string Origin(const std::string& program);

}  // namespace fdi::report
