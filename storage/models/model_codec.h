#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model_set.h"

namespace fdi::storage {

/// The canonical bytes of a model set: "FDIM", format version, length, fields
/// in order of declaration (little endian, doubles as their bits), CRC-32. Not
/// in them: version and content_hash, which are given when it is stored.
std::vector<std::byte> EncodeModelSet(const ModelSet& models);

/// The inverse, bit for bit. Checks the form alone; Validate() the meaning.
/// @param where the bytes come from, for the message.
/// @throws DataError naming `where` and the reason: CRC, another format
///   version, a count beyond its limit, bytes missing or left over.
ModelSet DecodeModelSet(std::span<const std::byte> bytes,
                        std::string_view where);

/// What a model set is known by: the same training on the same data gives the
/// same hash, anywhere and any time. Sha256Start() of the canonical bytes
/// without what tells where the set came from: created_ns, software,
/// training_runs.
std::uint64_t ContentHash(const ModelSet& models);

/// First 8 bytes of the SHA-256 of `bytes`, big endian.
std::uint64_t Sha256Start(std::span<const std::byte> bytes);

/// A hash as it is stored: 16 hex digits.
std::string HashHex(std::uint64_t hash);
/// The inverse; 0 for what is none.
std::uint64_t HashOfHex(std::string_view text);

}  // namespace fdi::storage
