#include "programs/monitor/console_access.h"

#include <algorithm>
#include <array>
#include <cctype>

#include <CLI/CLI.hpp>
#include <arpa/inet.h>

namespace fdi::monitor {
namespace {

std::string CheckAddress(const std::string& text) {
  std::array<unsigned char, sizeof(in6_addr)> ignored{};
  return inet_pton(AF_INET, text.c_str(), ignored.data()) == 1 ||
                 inet_pton(AF_INET6, text.c_str(), ignored.data()) == 1
             ? ""
             : text + " is no IPv4 or IPv6 address";
}

std::string CheckHeader(const std::string& text) {
  return std::all_of(
             text.begin(), text.end(),
             [](unsigned char c) { return std::isalnum(c) != 0 || c == '-'; })
             ? ""
             : text + " has more than letters, digits and '-'";
}

}  // namespace

bool ConsoleAccess::given() const {
  return !users.empty() || !tls.certificate.empty();
}

void ConsoleAccess::ApplyTo(console::ConsoleOptions& options) const {
  if (!users.empty()) {
    options.admission.users_file = users;
    options.admission.proxy_header = proxy_header;
    options.admission.proxy_address = proxy_address;
  }
  if (!tls.certificate.empty()) {
    options.tls = tls;
  }
}

void AddConsoleAccess(CLI::App& verb, ConsoleAccess& access) {
  CLI::Option* users =
      verb.add_option("--console-users", access.users,
                      "Ask for a name and a password of FILE, which "
                      "console-user makes, and let each user do what the role "
                      "allows")
          ->type_name("FILE");
  CLI::Option* header =
      verb.add_option("--console-proxy-user", access.proxy_header,
                      "Header by which a proxy says which of those users asks")
          ->needs(users)
          ->check(CheckHeader)
          ->type_name("HEADER");
  CLI::Option* proxy =
      verb.add_option(
              "--console-proxy-from", access.proxy_address,
              "Address of that proxy; the header is ignored from others")
          ->needs(header)
          ->check(CheckAddress)
          ->type_name("ADDRESS");
  header->needs(proxy);
  CLI::Option* tls =
      verb.add_option("--console-tls", access.tls.certificate,
                      "Serve https with this certificate, its issuers and, "
                      "without --console-key, its key; SIGHUP reads them anew")
          ->type_name("FILE.pem");
  verb.add_option(
          "--console-key", access.tls.key,
          "Its key, without passphrase and only for the service to read")
      ->needs(tls)
      ->type_name("FILE.pem");
}

}  // namespace fdi::monitor
