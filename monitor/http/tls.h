#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>

#include <sys/types.h>

struct ssl_ctx_st;
struct ssl_st;

namespace fdi::monitor {

/// Certificate and key for TLS, both PEM.
struct TlsFiles {
  std::filesystem::path certificate;  ///< The server's, then its issuers'.
  std::filesystem::path key;  ///< Without passphrase; empty: in `certificate`.
  bool operator==(const TlsFiles&) const = default;
};

/// The server side of TLS on a connected non-blocking socket. The first
/// Receive() performs the handshake. Used by one thread at a time.
class TlsSession {
 public:
  TlsSession(ssl_ctx_st* context, int socket);
  /// Sends close_notify if that is possible without blocking.
  ~TlsSession();
  TlsSession(const TlsSession&) = delete;
  TlsSession& operator=(const TlsSession&) = delete;

  /// Like recv() and send(): -1 with errno EAGAIN if poll() has to wait for
  /// `events()` first, EPROTONOSUPPORT if the client speaks plain HTTP, EPROTO
  /// for a failed handshake or protocol error.
  ssize_t Receive(char* to, std::size_t size);
  ssize_t Send(const char* from, std::size_t size);
  /// The events that poll() should wait for.
  short events() const { return events_; }
  /// Whether bytes are buffered that poll() does not report.
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
  /// @throws PassingError for a certificate that is not valid yet.
  /// @throws ConfigError naming the option and the file: a certificate that
  ///   cannot be read or has expired; a key that others can
  ///   read, that needs a passphrase or that is of another certificate.
  explicit TlsContext(const TlsFiles& files);

  /// Begins a session on an accepted socket.
  std::unique_ptr<TlsSession> Accept(int socket) const;
  /// Days until the certificate expires, rounded down.
  int days_left() const { return days_left_; }

 private:
  std::unique_ptr<ssl_ctx_st, void (*)(ssl_ctx_st*)> context_;
  int days_left_{0};
};

}  // namespace fdi::monitor
