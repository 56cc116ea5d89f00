#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace fdi::monitor {

/// A page of metrics in the text format of Prometheus, version 0.0.4: for each
/// family `# HELP`, `# TYPE`, then its values. Names of counters end in _total
/// and carry the unit, e.g. fdi_database_wal_bytes.
class Exposition {
 public:
  enum class Type : std::uint8_t { kCounter, kGauge };

  struct Label {
    std::string_view name;
    std::string_view value;
  };

  /// Begins a family. Each name once.
  void Family(std::string_view name, Type type, std::string_view help);

  /// A value of the family begun last, with at most one label.
  void Value(double value, Label label = {});
  void Value(std::uint64_t value, Label label = {});

  /// A family of one value.
  template <typename Number>
  void Single(std::string_view name, Type type, std::string_view help,
              Number value) {
    Family(name, type, help);
    Value(value);
  }

  const std::string& text() const { return text_; }

 private:
  void Line(std::string_view value, Label label);

  std::string name_;
  std::string text_;
};

}  // namespace fdi::monitor
