#include "monitor/exposition.h"

#include <array>
#include <charconv>

namespace fdi::monitor {
namespace {

// Of a label's value: \ " and line feed are escaped.
void AppendEscaped(std::string_view value, std::string& text) {
  for (const char c : value) {
    switch (c) {
      case '\\':
        text += "\\\\";
        break;
      case '"':
        text += "\\\"";
        break;
      case '\n':
        text += "\\n";
        break;
      default:
        text += c;
    }
  }
}

}  // namespace

void Exposition::Family(std::string_view name, Type type,
                        std::string_view help) {
  name_ = name;
  text_.append("# HELP ").append(name).append(" ").append(help).append("\n");
  text_.append("# TYPE ").append(name).append(
      type == Type::kCounter ? " counter\n" : " gauge\n");
}

void Exposition::Value(std::uint64_t value, Label label) {
  Line(std::to_string(value), label);
}

void Exposition::Value(double value, Label label) {
  std::array<char, 32> digits{};  // Of a double 24 suffice.
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  Line(std::string_view(digits.data(), end), label);
}

void Exposition::Line(std::string_view value, Label label) {
  text_ += name_;
  if (!label.name.empty()) {
    text_.append("{").append(label.name).append("=\"");
    AppendEscaped(label.value, text_);
    text_.append("\"}");
  }
  text_.append(" ").append(value).append("\n");
}

}  // namespace fdi::monitor
