#pragma once

#include <string_view>

#include "diagnosis/model/verdict.h"

namespace fdi {

/// "DETECTED", "ISOLATED", or where the engine reports NORMAL: "NOT_JUDGED" for
/// a sample that it did not judge because of its quality, "PARTLY_JUDGED" where
/// some channel abstained, and otherwise "NORMAL".
inline std::string_view ShownState(State state, Quality quality, bool partly) {
  if (state != State::kNormal) {
    return StateName(state);
  }
  return quality != Quality::kLive ? "NOT_JUDGED"
         : partly                  ? "PARTLY_JUDGED"
                                   : StateName(state);
}
inline std::string_view ShownState(const Verdict& verdict) {
  return ShownState(verdict.state, verdict.quality, verdict.confidence < 1.0);
}

}  // namespace fdi
