#pragma once

#include <string>

namespace fdi::cli {

/// Version of the project and git revision: "0.1.0+438d5bd". Stored with each
/// run and model set.
std::string SoftwareVersion();

}  // namespace fdi::cli
