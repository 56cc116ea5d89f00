#pragma once

namespace fdi::testing {

/// Calls of operator new in this program so far.
long AllocationCount();

}  // namespace fdi::testing
