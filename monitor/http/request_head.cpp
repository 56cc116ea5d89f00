#include "monitor/http/request_head.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <utility>

#include <arpa/inet.h>
#include <unistd.h>

#include "base/text.h"

// What is accepted leaves out the parts of RFC 9112 that the library, or a
// proxy in front, may read differently than they are read here:
//
//     head   = method " " target " HTTP/1." text CRLF {header CRLF} CRLF
//     method = "GET" | "HEAD" | "POST"
//     target = path ["?" query] ["#" text]   path: begins with "/" once decoded
//     header = name ":" blanks value blanks  name: no blanks, hence no folding
//
// A line ends with CRLF and has no control characters but the tab.
// Content-Length occurs at most once, Host and the user's header at most once
// with a value, and Transfer-Encoding never. The head that is passed on is
// written anew, from what was understood.
namespace fdi::monitor {
namespace {

constexpr Refusal kMalformed{400, "Bad Request",
                             "expected a request of HTTP/1.1", "malformed"};
constexpr Refusal kMethod{405, "Method Not Allowed",
                          "expected GET, HEAD or POST", "malformed"};
constexpr Refusal kLength{411, "Length Required",
                          "expected a body with Content-Length, not in chunks",
                          "encoded"};
constexpr Refusal kBody{413, "Payload Too Large",
                        "the body is longer than this server takes",
                        "too_large"};
constexpr Refusal kTarget{414, "URI Too Long",
                          "expected an address of at most 4096 bytes",
                          "too_large"};
constexpr Refusal kEncoding{415, "Unsupported Media Type",
                            "expected a body without Content-Encoding",
                            "encoded"};
constexpr Refusal kHeaders{
    431, "Request Header Fields Too Large",
    "expected at most 100 headers and 16384 bytes before the body",
    "too_large"};

std::string_view Trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) {
    return {};
  }
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

bool IsPlain(std::string_view text) {
  return std::none_of(text.begin(), text.end(), [](unsigned char c) {
    return (c < ' ' && c != '\t') || c == 0x7f;
  });
}

// Decodes %XX; nothing if a % is followed by anything else, because the library
// accepts another form besides.
std::optional<std::string> Decoded(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned byte = static_cast<unsigned char>(text[i]);
    if (text[i] == '%') {
      const std::string_view digits = text.substr(i + 1, 2);
      const char* const end = digits.data() + digits.size();
      if (digits.size() != 2 ||
          std::from_chars(digits.data(), end, byte, 16).ptr != end) {
        return std::nullopt;
      }
      i += 2;
    }
    result += static_cast<char>(byte);
  }
  return result;
}

std::string Encoded(std::string_view path) {
  std::string result;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x80 && std::isalnum(byte) != 0) ||
        std::string_view("-._~/").find(c) != std::string_view::npos) {
      result += c;
    } else {
      result += '%';
      result += "0123456789ABCDEF"[byte >> 4U];
      result += "0123456789ABCDEF"[byte & 15U];
    }
  }
  return result;
}

// Parses "GET /path?query HTTP/1.1". The path is normalised, so that the routes
// see the same path that chose the lane.
std::optional<Refusal> TakeRequestLine(std::string_view line,
                                       RequestHead& head) {
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == std::string_view::npos || last == first || !IsPlain(line) ||
      !line.substr(last).starts_with(" HTTP/1.")) {
    return kMalformed;
  }
  const std::string_view method = line.substr(0, first);
  std::string_view target = line.substr(first + 1, last - first - 1);
  target = target.substr(0, target.find('#'));
  const std::string_view query =
      target.substr(std::min(target.find('?'), target.size()));
  const auto path = Decoded(target.substr(0, target.size() - query.size()));
  if (target.find(' ') != std::string_view::npos || !path ||
      !path->starts_with('/') || !IsPlain(*path)) {
    return kMalformed;
  }
  if (method != "GET" && method != "HEAD" && method != "POST") {
    return kMethod;
  }
  // The library gets version 1.1 whatever the client says; the connection is
  // closed after the answer in any case.
  head.path = *path;
  head.text.append(method).append(" ").append(Encoded(*path));
  head.text.append(query).append(" HTTP/1.1\r\n");
  return std::nullopt;
}

std::optional<Refusal> TakeLength(std::string_view value, std::size_t max_body,
                                  RequestHead& head) {
  // from_chars() takes neither sign nor blanks, which RFC 9110 forbids as well.
  const auto [end, error] = std::from_chars(
      value.data(), value.data() + value.size(), head.body_size);
  if (error == std::errc::result_out_of_range) {
    return kBody;
  }
  // head.text has what TakeHeader() wrote, so an earlier length is found
  // however its name was spelt.
  if (error != std::errc{} || end != value.data() + value.size() ||
      head.text.find("\r\nContent-Length:") != std::string::npos) {
    return kMalformed;
  }
  return head.body_size > max_body ? std::optional(kBody) : std::nullopt;
}

// Drops the headers that no page reads.
std::optional<Refusal> TakeHeader(std::string_view line, std::size_t max_body,
                                  std::string_view user_header,
                                  RequestHead& head) {
  const std::size_t colon = line.find(':');
  if (colon == std::string_view::npos || colon == 0 || !IsPlain(line) ||
      line.substr(0, colon).find_first_of(" \t") != std::string_view::npos) {
    return kMalformed;
  }
  const std::string name = Lower(line.substr(0, colon));
  const std::string_view value = Trimmed(line.substr(colon + 1));
  const auto pass = [&head](std::string_view as, std::string_view text) {
    head.text.append(as).append(": ").append(text).append("\r\n");
  };
  if (name == "transfer-encoding") {
    return kLength;
  }
  if (name == "content-encoding" && Lower(value) != "identity") {
    return kEncoding;
  }
  if (name == "content-length") {
    const auto refusal = TakeLength(value, max_body, head);
    pass("Content-Length", value);
    return refusal;
  }
  if (name == "host") {
    if (std::exchange(head.has_host, true)) {
      return kMalformed;
    }
    head.host = value;
    pass("Host", value);
  } else if (!user_header.empty() && name == Lower(user_header)) {
    if (std::exchange(head.has_user, true)) {
      return kMalformed;
    }
    head.user = value;
    pass(user_header, value);
  } else if (name == "x-forwarded-proto") {
    pass("X-Forwarded-Proto", value);
  } else if (name == "cookie") {
    pass("Cookie", value);
  } else if (name == "origin") {
    pass("Origin", value);
  } else if (name == "accept-encoding" &&
             Lower(value).find("gzip") != std::string::npos) {
    pass("Accept-Encoding", "gzip");  // Brotli would take seconds of CPU time.
  }
  return std::nullopt;
}

// Strips port and brackets from "host", "host:port", "[v6]", "[v6]:port".
std::string_view WithoutPort(std::string_view host) {
  if (host.starts_with("[")) {
    const std::size_t end = host.find(']');
    return end == std::string_view::npos ? host : host.substr(1, end - 1);
  }
  const std::size_t colon = host.rfind(':');
  return colon == std::string_view::npos ? host : host.substr(0, colon);
}

bool IsAddress(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> ignored{};
  return inet_pton(AF_INET, host.c_str(), ignored.data()) == 1 ||
         inet_pton(AF_INET6, host.c_str(), ignored.data()) == 1;
}

std::string MachineName() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? Lower(name.data())
                                                        : std::string();
}

}  // namespace

std::optional<Refusal> ParseRequestHead(std::string_view bytes,
                                        std::size_t max_body,
                                        std::optional<RequestHead>& head,
                                        std::string_view user_header) {
  // The limits are checked before the ends that may never come: an endless line
  // or head is refused once it is too long. (npos is larger than any size.)
  const std::size_t line_end = bytes.find("\r\n");
  if (std::min(line_end, bytes.size()) > kMaxTarget) {
    return kTarget;
  }
  const std::size_t end = bytes.find("\r\n\r\n");
  if (std::min(end, bytes.size()) > kMaxHead) {
    return kHeaders;
  }
  if (end == std::string_view::npos) {
    return std::nullopt;
  }
  RequestHead parsed;
  parsed.size = end + 4;
  std::optional<Refusal> refusal =
      TakeRequestLine(bytes.substr(0, line_end), parsed);
  std::size_t begin = line_end + 2;
  for (std::size_t lines = 0; begin < end && !refusal; ++lines) {
    const std::size_t stop = bytes.find("\r\n", begin);
    refusal = lines == kMaxHeaders
                  ? kHeaders
                  : TakeHeader(bytes.substr(begin, stop - begin), max_body,
                               user_header, parsed);
    begin = stop + 2;
  }
  if (!refusal) {
    parsed.text += "\r\n";
    head = std::move(parsed);
  }
  return refusal;
}

bool IsLoopback(std::string_view host) {
  // A name may begin with "127.", too, such as 127.0.0.1.example.com.
  return host == "localhost" || host == "::1" ||
         (host.starts_with("127.") && IsAddress(std::string(host)));
}

bool HostAllowed(std::string_view host_header, std::string_view bound_host,
                 std::span<const std::string> names) {
  const std::string host = Lower(WithoutPort(host_header));
  const bool own =
      host == "localhost" || host == "127.0.0.1" || host == "::1" ||
      host == bound_host ||
      std::any_of(names.begin(), names.end(), [&host](const std::string& name) {
        return host == Lower(name);
      });
  return own || (!IsLoopback(bound_host) &&
                 (IsAddress(host) || (!host.empty() && host == MachineName())));
}

}  // namespace fdi::monitor
