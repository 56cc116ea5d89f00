#include "monitor/console/access.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <fstream>
#include <system_error>

#include <fcntl.h>
#include <sys/random.h>
#include <unistd.h>

#include "diagnosis/error.h"

namespace fdi::console {
namespace {

constexpr std::size_t kRandomBytes = 24;

std::string RandomToken() {
  std::array<unsigned char, kRandomBytes> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) !=
      static_cast<ssize_t>(bytes.size())) {
    throw std::system_error(errno, std::generic_category(), "getrandom");
  }
  std::string token;
  for (const unsigned char byte : bytes) {
    token += "0123456789abcdef"[byte >> 4U];
    token += "0123456789abcdef"[byte & 15U];
  }
  return token;
}

// Does nothing if the file is there.
void MakeTokenFile(const std::filesystem::path& path) {
  const int file =
      open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (file < 0) {
    if (errno == EEXIST) {
      return;
    }
    throw DataError("--console-write " + path.string() + ": cannot be made: " +
                    std::generic_category().message(errno));
  }
  const std::string line = RandomToken() + "\n";
  const ssize_t written = write(file, line.data(), line.size());
  const int failed = close(file);
  if (written != static_cast<ssize_t>(line.size()) || failed != 0) {
    unlink(path.c_str());
    throw DataError("--console-write " + path.string() + ": cannot be written");
  }
}

// "host", "host:port", "[v6]", "[v6]:port" without port and brackets.
std::string_view WithoutPort(std::string_view host) {
  if (host.starts_with("[")) {
    const std::size_t end = host.find(']');
    return end == std::string_view::npos ? host : host.substr(1, end - 1);
  }
  const std::size_t colon = host.rfind(':');
  return colon == std::string_view::npos ? host : host.substr(0, colon);
}

std::string Lower(std::string_view text) {
  std::string lower(text);
  std::transform(
      lower.begin(), lower.end(), lower.begin(),
      [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

}  // namespace

std::string LoadToken(const std::filesystem::path& path) {
  MakeTokenFile(path);
  std::ifstream file(path);
  std::string token;
  if (!file || (!std::getline(file, token) && !file.eof())) {
    throw DataError("--console-write " + path.string() + ": cannot be read");
  }
  if (token.ends_with('\r')) {
    token.pop_back();
  }
  const bool printable = std::all_of(
      token.begin(), token.end(), [](char c) { return c > ' ' && c <= '~'; });
  if (token.size() < kMinTokenLength || !printable) {
    throw ConfigError("--console-write " + path.string() +
                      ": the token, its first line, has " +
                      std::to_string(token.size()) +
                      " characters; expected 16 or more, without blanks "
                      "(delete the file to have one made)");
  }
  return token;
}

bool SameSecret(std::string_view given, std::string_view secret) {
  unsigned difference = given.size() == secret.size() ? 0U : 1U;
  for (std::size_t i = 0; i < secret.size(); ++i) {
    const char c = i < given.size() ? given[i] : '\0';
    difference |= static_cast<unsigned>(static_cast<unsigned char>(c) ^
                                        static_cast<unsigned char>(secret[i]));
  }
  return difference == 0;
}

bool IsLoopback(std::string_view host) {
  return host == "localhost" || host == "::1" || host.starts_with("127.");
}

bool HostAllowed(std::string_view host_header, std::string_view bound_host) {
  if (!IsLoopback(bound_host)) {
    return true;
  }
  const std::string host = Lower(WithoutPort(host_header));
  return host == "localhost" || host == "127.0.0.1" || host == "::1" ||
         host == bound_host;
}

Permission MayWrite(std::string_view authorization, std::string_view token) {
  if (token.empty()) {
    return Permission::kReadOnly;
  }
  constexpr std::string_view kScheme = "Bearer ";
  if (!authorization.starts_with(kScheme)) {
    return Permission::kWrongToken;
  }
  authorization.remove_prefix(kScheme.size());
  return SameSecret(authorization, token) ? Permission::kGranted
                                          : Permission::kWrongToken;
}

}  // namespace fdi::console
