#pragma once

#include <cstddef>
#include <string>

namespace fdi {

/// Checks that the process may start so many more threads and map so many more
/// bytes [B] at once, by doing it; all of it is given back. For what is in the
/// hands of a library that ends the process when either fails half-way. Takes
/// some milliseconds.
/// @throws PassingError naming both figures, the reason and the limits to look
///   at.
void RequireHeadroom(int threads, std::size_t bytes);

/// Why the process cannot open so many more files and sockets at once, found by
/// doing it, and the limits to look at; empty if it can.
std::string LackOfDescriptors(int count);
/// For libraries that are deaf or fail under another name without them.
/// @throws PassingError with that reason.
void RequireDescriptors(int count);

}  // namespace fdi
