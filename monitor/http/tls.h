#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include <sys/types.h>

struct ssl_ctx_st;
struct ssl_st;

namespace fdi::monitor {

/// A certificate for TLS, both PEM.
struct TlsFiles {
  std::filesystem::path certificate;  ///< The server's first, then its issuers.
  std::filesystem::path key;  ///< Without passphrase; empty: in `certificate`.
  bool operator==(const TlsFiles&) const = default;
};

/// The server's end of TLS on a connected socket that does not block. The
/// handshake is part of the first Receive(). Used by one thread at a time.
class TlsSession {
 public:
  TlsSession(ssl_ctx_st* context, int socket);
  /// Tells the client that nothing follows, if it can be told at once.
  ~TlsSession();
  TlsSession(const TlsSession&) = delete;
  TlsSession& operator=(const TlsSession&) = delete;

  /// As recv() and send(): -1 with errno EAGAIN if the socket has to get ready
  /// for `events()` first, EPROTONOSUPPORT if the client speaks plain HTTP,
  /// EPROTO for all that is no TLS that we speak.
  ssize_t Receive(char* to, std::size_t size);
  ssize_t Send(const char* from, std::size_t size);
  /// What poll() should wait for.
  short events() const { return events_; }
  /// Bytes that have come and that poll() knows nothing of.
  bool pending() const;

 private:
  ssize_t Result(int returned);

  std::unique_ptr<ssl_st, void (*)(ssl_st*)> ssl_;
  short events_;
  bool broken_{false};
};

/// TLS 1.2 and 1.3 with one certificate. Thread safe.
class TlsContext {
 public:
  /// @throws ConfigError naming the option and the file: a certificate that
  ///   cannot be read, has expired or is not valid yet; a key that others can
  ///   read, that needs a passphrase or that is of another certificate.
  explicit TlsContext(const TlsFiles& files);

  /// For a client that was accepted.
  std::unique_ptr<TlsSession> Accept(int socket) const;
  /// Of the certificate, rounded down.
  int days_left() const { return days_left_; }

 private:
  std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)> context_;
  int days_left_{0};
};

}  // namespace fdi::monitor
