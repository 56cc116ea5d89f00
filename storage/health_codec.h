#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "diagnosis/health_hour.h"

namespace fdi::storage {

/// The sums of an hour as bytes; docs/data.md has the layout. Its key and
/// live_ms are columns of their own.
std::vector<std::byte> PackHealth(const HealthHour& hour);

/// Fills `hour`, which has its key, with what PackHealth() gave.
/// @throws DataError if the bytes are damaged or of a later format.
void UnpackHealth(std::span<const std::byte> bytes, HealthHour& hour);

}  // namespace fdi::storage
