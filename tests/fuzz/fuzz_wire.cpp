// Bytes from a foreign publisher: refused, or a message that can be sent again.
#include <cstring>

#include "diagnosis/error.h"
#include "idl/codec.h"

namespace {

template <typename Message>
void Receive(const unsigned char* data, std::size_t size) {
  using Codec = fdi::idl::Codec<Message>;
  fdi::idl::CheckedType<typename Codec::Type> type;
  eprosima::fastrtps::rtps::SerializedPayload_t payload(
      static_cast<std::uint32_t>(size));
  std::memcpy(payload.data, data, size);
  payload.length = static_cast<std::uint32_t>(size);
  typename Codec::Wire wire;
  Message message;
  if (!type.deserialize(&payload, &wire) || !Codec::Decode(wire, message)) {
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
  switch (data[0] % 5) {
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
    default:
      Receive<fdi::idl::MonitorStatusMessage>(data + 1, size - 1);
  }
  return 0;
}
