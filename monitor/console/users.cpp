#include "monitor/console/users.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <memory>
#include <sstream>
#include <system_error>

#include <crypt.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/error.h"
#include "monitor/http/private_file.h"

namespace fdi::console {
namespace {

constexpr const char* kOption = "--console-users";
constexpr std::array<const char*, 3> kRoles{"view", "acknowledge", "engineer"};
constexpr const char* kNoPassword = "*";
constexpr std::size_t kRandomBytes = 24;
constexpr std::size_t kMinPassword = 8;
constexpr std::size_t kMaxPassword = 256;

bool IsName(std::string_view text) {
  return !text.empty() && text.size() <= kMaxName &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return c < 0x80 &&
                  (std::isalnum(c) != 0 ||
                   std::string_view("._-@").find(static_cast<char>(c)) !=
                       std::string_view::npos);
         });
}

// The name on a line; empty if it is a comment.
std::string_view NameOn(std::string_view line) {
  return line.starts_with('#') ? "" : line.substr(0, line.find(':'));
}

// Whether checking a password against the hash takes at most about a second
// and 128 MiB: the strings of crypt(5) state their cost. What another program
// makes with usual settings stays below.
bool IsCheap(const std::string& hash) {
  constexpr unsigned long kMostRounds = 1'000'000;  // SHA-512-crypt
  constexpr std::string_view kDigits = "./0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ";
  const auto number = [&hash](std::size_t at) {
    return std::strtoul(hash.c_str() + at, nullptr, 10);
  };
  // log2(N) - 1 is at `at`; r, and p where it is stated, are the usual ones.
  const auto scrypt = [&](std::size_t at, std::string_view rest) {
    const std::size_t n = kDigits.find(hash[at]);
    return n <= kDigits.find('C') &&
           hash.compare(at + 1, rest.size(), rest) == 0;
  };
  if (hash.starts_with("$y$j") || hash.starts_with("$gy$j")) {
    const std::size_t at = hash.find('j') + 1;
    return scrypt(at, "T$") || scrypt(at, "5$");
  }
  if (hash.starts_with("$7$")) {
    return scrypt(3, "U..../....");
  }
  if (hash.starts_with("$2")) {
    return number(4) <= 13;
  }
  const std::string_view rounds = "rounds=";
  if (hash.starts_with("$6$")) {
    return hash.compare(3, rounds.size(), rounds) != 0 ||
           number(3 + rounds.size()) <= kMostRounds;
  }
  return false;
}

std::pair<std::string, User> ParseLine(const std::string& line) {
  const std::size_t first = line.find(':');
  const std::size_t second =
      first == std::string::npos ? first : line.find(':', first + 1);
  if (second == std::string::npos || !IsName(NameOn(line))) {
    throw ConfigError(
        "expected NAME:ROLE:HASH with a name of 1..64 letters, digits, '.', "
        "'_', '-', '@'");
  }
  const auto role = ParseRole(line.substr(first + 1, second - first - 1));
  if (!role) {
    throw ConfigError(std::string("the role: expected ") + kRoleNames);
  }
  std::string hash = line.substr(second + 1);
  if (hash != kNoPassword && (crypt_checksalt(hash.c_str()) != CRYPT_SALT_OK ||
                              hash.find(':') != std::string::npos)) {
    throw ConfigError(
        "the hash: expected one that fdi-monitor console-user or mkpasswd has "
        "made, or *");
  }
  if (hash != kNoPassword && !IsCheap(hash)) {
    throw ConfigError(
        "the hash: expected one of yescrypt or scrypt up to cost 8, of bcrypt "
        "up to 13 or of SHA-512 up to 1000000 rounds, which is checked "
        "within about a second");
  }
  return {line.substr(0, first), {*role, std::move(hash)}};
}

[[noreturn]] void RefuseWrite(const std::filesystem::path& path) {
  throw DataError(
      std::string(kOption) + " " + path.string() +
      ": cannot be written: " + std::generic_category().message(errno));
}

// Keeps other commands out for its lifetime. The file itself is replaced, so
// the lock is that of its folder.
class FolderLock {
 public:
  explicit FolderLock(const std::filesystem::path& file)
      : folder_(open((file.parent_path() / ".").c_str(),
                     O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
    if (folder_ < 0) {
      RefuseWrite(file);
    }
    flock(folder_, LOCK_EX);  // Without effect where there are no locks.
  }
  ~FolderLock() { close(folder_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int folder_;
};

// Replaces the file atomically, keeping owner, group and mode; a new file is
// readable by us alone.
void Replace(const std::filesystem::path& path, std::string_view text) {
  std::string part = path.string() + ".XXXXXX";
  const int file = mkostemp(part.data(), O_CLOEXEC);
  if (file < 0) {
    RefuseWrite(path);
  }
  struct stat old {};
  const bool same = stat(path.c_str(), &old) != 0 ||
                    (fchown(file, old.st_uid, old.st_gid) == 0 &&
                     fchmod(file, old.st_mode & 0640U) == 0);
  const bool written = same &&
                       write(file, text.data(), text.size()) ==
                           static_cast<ssize_t>(text.size()) &&
                       fsync(file) == 0;
  const int failure = errno;
  close(file);
  if (!written || rename(part.c_str(), path.c_str()) != 0) {
    errno = written ? errno : failure;
    const int reason = errno;
    unlink(part.c_str());
    errno = reason;
    RefuseWrite(path);
  }
}

}  // namespace

const char* RoleName(Role role) {
  return kRoles.at(static_cast<std::size_t>(role));
}

std::optional<Role> ParseRole(std::string_view name) {
  const auto found = std::find(kRoles.begin(), kRoles.end(), name);
  return found == kRoles.end()
             ? std::nullopt
             : std::optional(static_cast<Role>(found - kRoles.begin()));
}

Users LoadUsers(const std::filesystem::path& path) {
  std::istringstream text(monitor::ReadPrivateFile(path, kOption));
  Users users;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    if (line.empty() || line.starts_with('#')) {
      continue;
    }
    try {
      auto entry = ParseLine(line);
      if (!users.insert(std::move(entry)).second) {
        throw ConfigError("the name stands in an earlier line, too");
      }
    } catch (const ConfigError& error) {
      throw ConfigError(std::string(kOption) + " " + path.string() + ":" +
                        std::to_string(number) + ": " + error.what());
    }
  }
  return users;
}

void StoreUser(const std::filesystem::path& file, const std::string& name,
               const std::optional<User>& user) {
  if (!IsName(name)) {
    throw ConfigError(
        "NAME: expected 1..64 letters, digits, '.', '_', '-', '@'");
  }
  // A link stays one.
  const std::filesystem::path path =
      std::filesystem::exists(file) ? std::filesystem::canonical(file) : file;
  const FolderLock lock(path);
  std::istringstream old;
  if (std::filesystem::exists(path)) {
    LoadUsers(path);  // Reports errors before anything is changed.
    old.str(monitor::ReadPrivateFile(path, kOption));
  }
  std::string fresh;
  std::string text;
  if (user) {
    fresh = name + ":" + RoleName(user->role) + ":" + user->hash + "\n";
  }
  bool found = false;
  for (std::string line; std::getline(old, line);) {
    const bool same = NameOn(line) == name;
    text += same ? fresh : line + "\n";
    found = found || same;
  }
  if (!found && !user) {
    throw NotFoundError(std::string(kOption) + " " + path.string() +
                        ": there is no user " + name);
  }
  Replace(path, found ? text : text + fresh);
}

std::string HashPassword(const std::string& password) {
  const bool plain =
      std::none_of(password.begin(), password.end(),
                   [](unsigned char c) { return c < ' ' || c == 0x7f; });
  if (password.size() < kMinPassword || password.size() > kMaxPassword ||
      !plain) {
    throw ConfigError("the password: expected " + std::to_string(kMinPassword) +
                      ".." + std::to_string(kMaxPassword) +
                      " bytes without control characters");
  }
  const std::unique_ptr<char, decltype(&std::free)> salt(
      crypt_gensalt_ra("$y$", 0, nullptr, 0), std::free);
  const auto data = std::make_unique<crypt_data>();
  const char* const hash =
      salt ? crypt_r(password.c_str(), salt.get(), data.get()) : nullptr;
  if (hash == nullptr || hash[0] == '*') {
    throw std::system_error(errno, std::generic_category(), "crypt");
  }
  return hash;
}

bool PasswordFits(const std::string& password, const std::string& hash) {
  const auto data = std::make_unique<crypt_data>();
  const char* const made = crypt_r(password.c_str(), hash.c_str(), data.get());
  return made != nullptr && made[0] != '*' && SameSecret(made, hash) &&
         password.find('\0') == std::string::npos;
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

}  // namespace fdi::console
