#pragma once

#include <functional>

namespace fdi {

/// Calls task(0) ... task(count − 1), each once, on up to `threads` threads.
/// The first exception of a task is rethrown once all threads have ended.
///
/// @param threads ≥ 1; 0 takes what the machine has.
void ParallelFor(int count, int threads, const std::function<void(int)>& task);

}  // namespace fdi
