// Bytes from a foreign publisher: refused, or a message that can be sent again.
#include <string_view>

#include "base/error.h"
#include "tests/idl/payload.h"

namespace {

template <typename Message, int kVersion = 1>
void Receive(const unsigned char* data, std::size_t size) {
  using Codec = fdi::idl::Codec<Message, kVersion>;
  fdi::idl::CheckedType<typename Codec::Type> type;
  typename Codec::Wire wire;
  Message message;
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  if (!fdi::idl::Deserialize(type, bytes, &wire) ||
      !Codec::Decode(wire, message)) {
    return;
  }
  try {
    Codec::Encode(message, wire);
  } catch (const fdi::DataError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const unsigned char* data,
                                      std::size_t size) {
  if (size < 5) {
    return 0;
  }
  switch (data[0] % 9) {
    case 0:
      Receive<fdi::idl::ValveSampleMessage>(data + 1, size - 1);
      break;
    case 1:
      Receive<fdi::idl::DecisionMessage>(data + 1, size - 1);
      break;
    case 2:
      Receive<fdi::FaultEvent>(data + 1, size - 1);
      break;
    case 3:
      Receive<fdi::idl::ModelSetInfoMessage>(data + 1, size - 1);
      break;
    case 4:
      Receive<fdi::idl::MonitorStatusMessage>(data + 1, size - 1);
      break;
    case 5:
      Receive<fdi::idl::DecisionBatchMessage>(data + 1, size - 1);
      break;
    case 6:
      Receive<fdi::MonitorShare>(data + 1, size - 1);
      break;
    case 7:
      Receive<fdi::idl::ValveStateMessage>(data + 1, size - 1);
      break;
    default:
      Receive<fdi::idl::ValveSampleMessage, 2>(data + 1, size - 1);
  }
  return 0;
}
