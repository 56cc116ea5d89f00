#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "diagnosis/model/model_set.h"

namespace fdi::storage {

/// The canonical bytes of a model set: "FDIM", format version, length, fields
/// in order of declaration (little endian, doubles as their bits), CRC-32. They
/// exclude version and content_hash, which are assigned when the set is stored.
std::vector<std::byte> EncodeModelSet(const ModelSet& models);

/// The inverse, bit for bit; content_hash is that of what was stored. Checks
/// only the form; Validate() checks the content.
/// @param where the bytes come from, for the message.
/// @throws DataError naming `where` and the reason: CRC, another format
///   version, a count beyond its limit, bytes missing or left over.
ModelSet DecodeModelSet(std::span<const std::byte> bytes,
                        std::string_view where);

/// Identity of a model set: the same training on the same data gives the same
/// hash, anywhere and at any time. Sha256Start() of the canonical bytes without
/// the fields that tell its origin: created_ns, software, training_runs.
std::uint64_t ContentHash(const ModelSet& models);

/// First 8 bytes of the SHA-256 of `bytes`, big endian.
std::uint64_t Sha256Start(std::span<const std::byte> bytes);

}  // namespace fdi::storage
