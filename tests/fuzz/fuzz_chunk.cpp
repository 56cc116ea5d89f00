// Chunks of samples whose CRC is right: refused with a reason, or samples that
// are packed and unpacked again without loss.
#include <cstdlib>
#include <cstring>
#include <vector>

#include <zlib.h>

#include "base/error.h"
#include "storage/runs/sample_codec.h"

namespace {

using fdi::storage::Chunk;
using fdi::storage::ChunkCodec;
using fdi::storage::StoredSample;

std::vector<std::byte> Deflated(const unsigned char* data, std::size_t size) {
  uLongf packed = compressBound(size);
  std::vector<std::byte> bytes(sizeof(std::uint32_t) + packed);
  const auto raw_size = static_cast<std::uint32_t>(size);
  std::memcpy(bytes.data(), &raw_size, sizeof raw_size);
  compress2(reinterpret_cast<Bytef*>(bytes.data() + sizeof raw_size), &packed,
            data, size, Z_BEST_SPEED);
  bytes.resize(sizeof raw_size + packed);
  return bytes;
}

std::uint32_t Checksum(const Chunk& chunk) {
  std::array<Bytef, 5> head{static_cast<Bytef>(chunk.codec)};
  std::memcpy(&head[1], &chunk.count, sizeof chunk.count);
  const uLong crc = crc32(0, head.data(), head.size());
  return static_cast<std::uint32_t>(
      crc32(crc, reinterpret_cast<const Bytef*>(chunk.bytes.data()),
            static_cast<uInt>(chunk.bytes.size())));
}

void PackAgain(const std::vector<StoredSample>& samples, ChunkCodec codec) {
  const Chunk first = fdi::storage::EncodeChunk(samples, codec);
  const Chunk second = fdi::storage::EncodeChunk(
      fdi::storage::DecodeChunk(first, "again"), codec);
  if (first.bytes != second.bytes) {
    std::abort();
  }
}

}  // namespace

// Byte 0: bit 0 is the codec, bit 1 says whether the rest is to be
// deflated; 1, 2: count.
extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  if (size < 3) {
    return 0;
  }
  Chunk chunk;
  chunk.codec = static_cast<ChunkCodec>(data[0] & 1);
  chunk.count = data[1] + 256U * (data[2] & 3U);
  const auto* rest = reinterpret_cast<const std::byte*>(data) + 3;
  chunk.bytes = (data[0] & 2) != 0
                    ? Deflated(data + 3, size - 3)
                    : std::vector<std::byte>(rest, rest + size - 3);
  chunk.crc = Checksum(chunk);
  try {
    const auto samples = fdi::storage::DecodeChunk(chunk, "fuzz");
    PackAgain(samples, ChunkCodec::kPlain);
    PackAgain(samples, ChunkCodec::kColumns);
  } catch (const fdi::DataError&) {
  }
  return 0;
}
