#include "monitor/http/tls.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <new>
#include <string>
#include <system_error>

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "monitor/http/private_file.h"

namespace fdi::monitor {
namespace {

// OpenSSL's reason for the call that failed, the first cause first.
std::string Reason() {
  const unsigned long error = ERR_peek_error();
  const char* reason = ERR_SYSTEM_ERROR(error)
                           ? std::strerror(ERR_GET_REASON(error))
                           : ERR_reason_error_string(error);
  ERR_clear_error();
  return reason == nullptr ? "unknown reason" : reason;
}

// If it was for lack of something, that may come: the file is not at fault.
void CheckForLack(const char* option, const std::filesystem::path& file) {
  if (MayPass(errno)) {
    throw PassingError(std::string(option) + " " + file.string() +
                       ": cannot be read (" +
                       std::generic_category().message(errno) + ")");
  }
}

[[noreturn]] void Refuse(const char* option, const std::filesystem::path& file,
                         const std::string& what) {
  throw ConfigError(std::string(option) + " " + file.string() + ": " + what);
}

// OpenSSL's socket BIO uses write(), which raises SIGPIPE if the client has
// gone.
int WriteSocket(BIO* bio, const char* from, int size) {
  BIO_clear_retry_flags(bio);
  const ssize_t count =
      send(static_cast<int>(reinterpret_cast<std::intptr_t>(BIO_get_data(bio))),
           from, static_cast<std::size_t>(size), MSG_NOSIGNAL);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) {
    BIO_set_retry_write(bio);
  }
  return static_cast<int>(count);
}

int ReadSocket(BIO* bio, char* to, int size) {
  BIO_clear_retry_flags(bio);
  const ssize_t count =
      recv(static_cast<int>(reinterpret_cast<std::intptr_t>(BIO_get_data(bio))),
           to, static_cast<std::size_t>(size), 0);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) {
    BIO_set_retry_read(bio);
  }
  return static_cast<int>(count);
}

// OpenSSL flushes in the handshake and takes 0 for a failure; there is no
// buffer.
long ControlSocket(BIO* /*bio*/, int command, long /*number*/, void* /*data*/) {
  return command == BIO_CTRL_FLUSH ? 1 : 0;
}

BIO* SocketBio(int socket) {
  static BIO_METHOD* const method = [] {
    BIO_METHOD* const made = BIO_meth_new(
        BIO_get_new_index() | BIO_TYPE_SOURCE_SINK, "socket without SIGPIPE");
    BIO_meth_set_write(made, WriteSocket);
    BIO_meth_set_read(made, ReadSocket);
    BIO_meth_set_ctrl(made, ControlSocket);
    return made;
  }();
  BIO* const bio = BIO_new(method);
  if (bio != nullptr) {
    // NOLINTNEXTLINE(performance-no-int-to-ptr): what a BIO holds is a pointer.
    BIO_set_data(bio, reinterpret_cast<void*>(std::intptr_t{socket}));
    BIO_set_init(bio, 1);
  }
  return bio;
}

// Refuses a passphrase instead of asking a terminal for it.
int NoPassphrase(char* /*to*/, int /*size*/, int /*write*/, void* /*data*/) {
  return -1;
}

void TakeKey(SSL_CTX* context, const TlsFiles& files) {
  const bool apart = !files.key.empty();
  const char* const option = apart ? "--console-key" : "--console-tls";
  const std::filesystem::path& file = apart ? files.key : files.certificate;
  errno = 0;
  std::ifstream stream(file);
  if (!stream) {
    CheckForLack(option, file);
  }
  const std::string content{std::istreambuf_iterator<char>(stream), {}};
  // Searched before the mode of the file is checked: a certificate without a
  // key may be readable by all, and the reason to be told is the missing key.
  if (!apart && content.find(" PRIVATE KEY-") == std::string::npos) {
    Refuse(option, file, "has no private key; give its file by --console-key");
  }
  const std::string text = ReadPrivateFile(file, option);
  const std::unique_ptr<BIO, void (*)(BIO*)> bio(
      BIO_new_mem_buf(text.data(), static_cast<int>(text.size())),
      BIO_free_all);
  const std::unique_ptr<EVP_PKEY, void (*)(EVP_PKEY*)> key(
      PEM_read_bio_PrivateKey(bio.get(), nullptr, NoPassphrase, nullptr),
      EVP_PKEY_free);
  if (key == nullptr) {
    Refuse(
        option, file,
        "expected a private key in PEM without passphrase (" + Reason() + ")");
  }
  if (SSL_CTX_use_PrivateKey(context, key.get()) != 1) {
    Refuse(option, file,
           "is not the key of the certificate " + files.certificate.string() +
               " (" + Reason() + ")");
  }
}

// @returns days until the certificate expires.
int CheckValidity(const X509* certificate, const std::filesystem::path& file) {
  int days = 0;
  int seconds = 0;
  // Counted from now: days and seconds have the same sign, and days may be 0.
  ASN1_TIME_diff(&days, &seconds, nullptr, X509_get0_notAfter(certificate));
  if (days < 0 || seconds < 0) {
    Refuse("--console-tls", file, "the certificate has expired");
  }
  if (X509_cmp_current_time(X509_get0_notBefore(certificate)) > 0) {
    throw PassingError("--console-tls " + file.string() +
                       ": the certificate is not valid yet; is the clock of "
                       "this machine right?");
  }
  return days;
}

}  // namespace

TlsSession::TlsSession(SSL_CTX* context, int socket)
    : ssl_(SSL_new(context), SSL_free), events_(POLLIN) {
  BIO* const bio = SocketBio(socket);
  if (ssl_ == nullptr || bio == nullptr) {
    throw std::bad_alloc();
  }
  // Takes one reference if both are the same BIO, so none is left to free.
  SSL_set_bio(ssl_.get(), bio, bio);
  SSL_set_accept_state(ssl_.get());
}

TlsSession::~TlsSession() {
  // OpenSSL forbids SSL_shutdown() after a fatal error.
  if (!broken_ && SSL_is_init_finished(ssl_.get()) != 0) {
    SSL_shutdown(ssl_.get());
    ERR_clear_error();
  }
}

// The error queue is cleared before each call, because SSL_get_error() also
// sees what earlier calls of the thread left in it.
ssize_t TlsSession::Receive(char* to, std::size_t size) {
  ERR_clear_error();
  return Result(SSL_read(ssl_.get(), to, static_cast<int>(size)));
}

ssize_t TlsSession::Send(const char* from, std::size_t size) {
  if (size == 0) {  // SSL_write() would fail.
    return 0;
  }
  ERR_clear_error();
  return Result(SSL_write(
      ssl_.get(), from,
      static_cast<int>(std::min(size, std::size_t{SSL3_RT_MAX_PLAIN_LENGTH}))));
}

bool TlsSession::pending() const {
  return SSL_pending(ssl_.get()) > 0;
}

ssize_t TlsSession::Result(int returned) {
  if (returned > 0) {
    return returned;
  }
  switch (SSL_get_error(ssl_.get(), returned)) {
    // Either call may have to wait for either direction: the first SSL_read()
    // performs the handshake, which writes as well.
    case SSL_ERROR_WANT_READ:
      events_ = POLLIN;
      errno = EAGAIN;
      return -1;
    case SSL_ERROR_WANT_WRITE:
      events_ = POLLOUT;
      errno = EAGAIN;
      return -1;
    case SSL_ERROR_ZERO_RETURN:
      return 0;
    case SSL_ERROR_SSL:
      errno = ERR_GET_REASON(ERR_peek_error()) == SSL_R_HTTP_REQUEST
                  ? EPROTONOSUPPORT
                  : EPROTO;
      break;
    default:  // The connection is lost.
      errno = ECONNRESET;
  }
  broken_ = true;
  ERR_clear_error();
  return -1;
}

TlsContext::TlsContext(const TlsFiles& files)
    : context_(SSL_CTX_new(TLS_server_method()), SSL_CTX_free) {
  SSL_CTX* const context = context_.get();
  if (context == nullptr) {
    throw std::bad_alloc();
  }
  SSL_CTX_set_min_proto_version(context, TLS1_2_VERSION);
  // A client that renegotiates could make the server do handshakes without end,
  // and make SSL_write() wait for input, while a worker polls for output only.
  SSL_CTX_set_options(context, SSL_OP_NO_RENEGOTIATION | SSL_OP_NO_COMPRESSION |
                                   SSL_OP_CIPHER_SERVER_PREFERENCE);
  // Send() is like send(): it may take a part, and a repetition may come from
  // another buffer. Idle sessions keep no buffers, some 34 kB each.
  SSL_CTX_set_mode(context, SSL_MODE_ENABLE_PARTIAL_WRITE |
                                SSL_MODE_ACCEPT_MOVING_WRITE_BUFFER |
                                SSL_MODE_RELEASE_BUFFERS);
  // One record per call, so that a client cannot occupy the listening thread
  // with records that carry no data.
  SSL_CTX_clear_mode(context, SSL_MODE_AUTO_RETRY);
  SSL_CTX_set_session_cache_mode(context, SSL_SESS_CACHE_OFF);  // Tickets do.
  errno = 0;
  if (SSL_CTX_use_certificate_chain_file(context, files.certificate.c_str()) !=
      1) {
    CheckForLack("--console-tls", files.certificate);
    Refuse("--console-tls", files.certificate,
           "expected a certificate in PEM (" + Reason() + ")");
  }
  // The key comes after the certificate, because OpenSSL compares it with the
  // one that is there.
  days_left_ =
      CheckValidity(SSL_CTX_get0_certificate(context), files.certificate);
  TakeKey(context, files);
}

std::unique_ptr<TlsSession> TlsContext::Accept(int socket) const {
  return std::make_unique<TlsSession>(context_.get(), socket);
}

}  // namespace fdi::monitor
