#pragma once

namespace fdi::tests {

/// Calls of operator new in this program so far.
long AllocationCount();

}  // namespace fdi::tests
