// The payload of a model set, in a frame whose length and CRC are right:
// refused with a reason, or the canonical bytes of what was read.
#include <cstdlib>
#include <cstring>
#include <span>
#include <vector>

#include <zlib.h>

#include "base/error.h"
#include "storage/models/model_codec.h"

namespace {

constexpr std::size_t kHead = 8;  // Magic and format version.

template <typename T>
void Append(std::vector<std::byte>& bytes, T value) {
  const std::size_t end = bytes.size();
  bytes.resize(end + sizeof value);
  std::memcpy(bytes.data() + end, &value, sizeof value);
}

std::vector<std::byte> Framed(std::span<const std::byte> payload) {
  static const std::vector<std::byte> example =
      fdi::storage::EncodeModelSet(fdi::ModelSet{});
  std::vector<std::byte> bytes(example.begin(), example.begin() + kHead);
  Append(bytes, static_cast<std::uint64_t>(payload.size()));
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  Append(bytes, static_cast<std::uint32_t>(
                    crc32(0, reinterpret_cast<const Bytef*>(bytes.data()),
                          static_cast<uInt>(bytes.size()))));
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  const std::vector<std::byte> bytes =
      Framed({reinterpret_cast<const std::byte*>(data), size});
  try {
    const fdi::ModelSet models = fdi::storage::DecodeModelSet(bytes, "fuzz");
    if (fdi::storage::EncodeModelSet(models) != bytes) {
      std::abort();
    }
    fdi::Validate(models);
  } catch (const fdi::DataError&) {
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
