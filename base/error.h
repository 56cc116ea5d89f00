#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace fdi {

/// External data cannot be used: a file, a row, a stored model. what() names
/// the source, the place and the accepted range. Exit code 3.
class DataError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The named thing (run, model set, valve, episode) does not exist. Exit 5.
class NotFoundError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A usage or configuration error: names the option or key, the value and the
/// accepted values. Exit code 2.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Checks a precondition. @throws std::invalid_argument if `condition` is
/// false.
inline void Require(bool condition, std::string_view message) {
  if (!condition) {
    throw std::invalid_argument(std::string(message));
  }
}

}  // namespace fdi
