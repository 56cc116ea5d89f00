#pragma once

#include <string>
#include <string_view>

#include <fnmatch.h>

namespace fdi {

/// Whether `text` matches the shell pattern `glob`: * ? [...]; no escapes.
inline bool GlobMatches(const std::string& glob, std::string_view text) {
  return glob == "*" ||
         fnmatch(glob.c_str(), std::string(text).c_str(), FNM_NOESCAPE) == 0;
}

}  // namespace fdi
