#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace fdi::idl {

/// Runs the script that makes keys. @throws std::runtime_error if it fails.
inline void FdiKeys(const std::string& arguments) {
  const std::string call =
      "\"" FDI_KEYS_SCRIPT "\" " + arguments + " >/dev/null";
  if (std::system(call.c_str()) != 0) {
    throw std::runtime_error("fdi-keys " + arguments + " fails");
  }
}

inline void MakeAuthority(const std::filesystem::path& folder, int days) {
  FdiKeys("init " + folder.string() + " --days " + std::to_string(days));
}

/// @param rights "--role reader", or the like.
inline void MakeKey(const std::filesystem::path& folder,
                    const std::string& name, const std::string& rights,
                    int days) {
  FdiKeys("add " + folder.string() + " " + name + " " + rights + " --days " +
          std::to_string(days));
}

}  // namespace fdi::idl
