#include "storage/run_types.h"

#include <charconv>
#include <cmath>

#include "diagnosis/error.h"

namespace fdi::storage {
namespace {

[[noreturn]] void RefuseSelector(std::string_view text,
                                 const std::string& why) {
  throw ConfigError("run \"" + std::string(text) + "\": " + why +
                    "; accepted are ID, ID@from:to, ID@from: and ID@:to with"
                    " seconds from the start of the run");
}

double ParseBound(std::string_view bound, double absent,
                  std::string_view text) {
  if (bound.empty()) {
    return absent;
  }
  double value = 0.0;
  const auto [end, error] =
      std::from_chars(bound.data(), bound.data() + bound.size(), value);
  if (error != std::errc() || end != bound.data() + bound.size() ||
      !std::isfinite(value)) {
    RefuseSelector(text, '"' + std::string(bound) + "\" is not a number");
  }
  return value;
}

}  // namespace

std::string_view RunOriginName(RunOrigin origin) {
  switch (origin) {
    case RunOrigin::kSimulated:
      return "simulated";
    case RunOrigin::kImported:
      return "imported";
    case RunOrigin::kRecorded:
      break;
  }
  return "recorded";
}

std::string_view RunStateName(RunState state) {
  switch (state) {
    case RunState::kRecording:
      return "recording";
    case RunState::kComplete:
      return "complete";
    case RunState::kInterrupted:
      break;
  }
  return "interrupted";
}

RunSelector ParseRunSelector(std::string_view text) {
  RunSelector selector;
  const std::size_t at = text.find('@');
  selector.id = std::string(text.substr(0, at));
  if (selector.id.empty() || selector.id.size() > 12 ||
      selector.id.find_first_not_of("0123456789abcdefABCDEF") !=
          std::string::npos) {
    RefuseSelector(text, "an id is up to 12 hex digits");
  }
  for (char& c : selector.id) {
    c = static_cast<char>(c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c);
  }
  if (at == std::string_view::npos) {
    return selector;
  }
  const std::string_view stretch = text.substr(at + 1);
  const std::size_t colon = stretch.find(':');
  if (colon == std::string_view::npos) {
    RefuseSelector(text, "the stretch has no colon");
  }
  selector.from_s = ParseBound(stretch.substr(0, colon), selector.from_s, text);
  selector.to_s = ParseBound(stretch.substr(colon + 1), selector.to_s, text);
  if (!(selector.from_s < selector.to_s)) {
    RefuseSelector(text, "the stretch ends before it begins");
  }
  return selector;
}

}  // namespace fdi::storage
