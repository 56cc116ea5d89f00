#include "storage/cli/version.h"

#include "fdi_version_config.h"

namespace fdi::cli {

std::string SoftwareVersion() {
  return FDI_VERSION "+" FDI_REVISION;
}

}  // namespace fdi::cli
