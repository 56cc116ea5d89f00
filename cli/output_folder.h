#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>
#include <string_view>

namespace fdi::cli {

/// Makes `folder` unless it is there; its parent must be.
/// @throws DataError naming the parent that is missing, or the folder that
///   cannot be made or written to.
void EnsureFolder(const std::filesystem::path& folder);

/// Lets `write` write the file `path`, or stdout for "-". The text goes beside
/// `path` first, so that a failure leaves no part of it.
/// @throws DataError naming the file.
void WriteOutput(const std::filesystem::path& path,
                 const std::function<void(std::ostream&)>& write);

/// The same for a text that is there already.
void WriteFile(const std::filesystem::path& path, std::string_view text);

}  // namespace fdi::cli
