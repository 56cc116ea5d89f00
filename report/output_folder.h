#pragma once

#include <filesystem>
#include <functional>
#include <iosfwd>
#include <string_view>

namespace fdi::report {

/// Has `write` write the file `path`, or stdout for "-". The file is replaced
/// atomically, so a failure leaves no partial file; a pipe or a device is
/// written to.
/// @throws DataError naming the file.
void WriteOutput(const std::filesystem::path& path,
                 const std::function<void(std::ostream&)>& write);

/// The same for existing text.
void WriteFile(const std::filesystem::path& path, std::string_view text);

}  // namespace fdi::report
