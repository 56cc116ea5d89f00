#pragma once

#include <string>
#include <utility>
#include <vector>

namespace fdi::idl {

/// A name and a datagram each: the samples of a valve as its publisher would
/// send them, and the rest of what writer and reader tell each other; little
/// endian, numbers 1 and 2, from a participant of prefix zero (bytes 8 to 19).
/// @param payload of a sample.
inline std::vector<std::pair<std::string, std::string>> RtpsMessages(
    const std::string& payload) {
  const std::string one("\0\0\0\0\1\0\0\0", 8);
  const std::string two("\0\0\0\0\2\0\0\0", 8);
  const std::string zeros(32, '\0');
  const std::string writer("\0\0\0\0\0\0\1\2", 8);  // To any reader.
  const std::string reader("\0\0\1\4\0\0\2\2", 8);  // To our writer.
  const std::string discovery("\0\1\0\xc7\0\1\0\xc2", 8);
  const std::string parameters("\x70\0\x4\0\0\0\0\1\1\0\0\0", 12);
  const std::string offset("\0\0\x10\0", 4);
  std::vector<std::pair<std::string, std::string>> messages;
  const auto add = [&](const std::string& name, char kind, char flags,
                       const std::string& body) {
    std::string message("RTPS\2\2\1\xf\0\0\0\0\0\0\0\0\0\0\0\0", 20);
    message += std::string("\xe\1\xc\0", 4) + std::string(12, '\0');
    message += {kind, flags, static_cast<char>(body.size()),
                static_cast<char>(body.size() >> 8U)};
    messages.emplace_back(name, message + body);
  };
  add("data", 0x15, 5, offset + writer + one + payload);
  add("end", 0x15, 7, offset + writer + two + parameters + payload);
  add("participant", 0x15, 5,
      offset + discovery + one + std::string("\0\3\0\0", 4) +
          std::string("\x15\0\4\0\2\2\1\xf\1\0\0\0", 12));
  add("fragment", 0x16, 1,
      std::string("\0\0\x1c\0", 4) + writer + two +
          std::string("\1\0\0\0\1\0\x10\0\x40\0\0\0", 12) + payload);
  add("heartbeat", 0x07, 1, writer + one + two + zeros.substr(28));
  add("gap", 0x08, 1, writer + one + two + zeros.substr(28));
  add("acknack", 0x06, 1, reader + one + zeros.substr(24));
  add("nackfrag", 0x12, 1, reader + one + zeros.substr(20));
  add("source", 0x0c, 1, zeros.substr(12));
  add("time", 0x09, 1, zeros.substr(24));
  return messages;
}

}  // namespace fdi::idl
