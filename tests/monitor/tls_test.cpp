// The HTTP server behind TLS.
#include "monitor/http/tls.h"

#include <chrono>
#include <fstream>
#include <memory>
#include <optional>
#include <vector>

#include <gmock/gmock.h>
#include <httplib.h>

#include "base/error.h"
#include "base/passing_error.h"
#include "monitor/http/http_server.h"
#include "tests/monitor/certificates.h"
#include "tests/monitor/raw_client.h"
#include "tests/storage/message_of.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

constexpr std::size_t kLarge = 20U << 20U;

class TlsTest : public testing::Test {
 protected:
  TlsTest() { MakeCertificate(files_.certificate, files_.key); }
  std::string Complaint() const {
    return storage::MessageOf<ConfigError>([this] { TlsContext{files_}; });
  }
  void Start() {
    HttpServerOptions options;
    options.address.host = "127.0.0.1";
    options.tls = files_;
    options.max_body = 16384;
    server_.emplace(options);
    server_->Add({{"/small", [] { return HttpPage{.body = "small"}; }},
                  {"/large",
                   [] { return HttpPage{.body = std::string(kLarge, 'x')}; }}});
    server_->routes().Post("/length", [](const httplib::Request& request,
                                         httplib::Response& response) {
      response.set_content(std::to_string(request.body.size()), "text/plain");
    });
    server_->Start();
  }
  int port() const { return server_->address().port; }
  // Trusts the certificate in the file alone.
  std::unique_ptr<httplib::SSLClient> Client() const {
    auto client = std::make_unique<httplib::SSLClient>("127.0.0.1", port());
    client->set_ca_cert_path(files_.certificate.c_str());
    client->enable_server_certificate_verification(true);
    return client;
  }
  std::uint64_t Count(const char* outcome) const {
    return server_->counts().at(outcome);
  }

  storage::TemporaryDirectory directory_;
  TlsFiles files_{directory_.path() / "cert.pem",
                  directory_.path() / "key.pem"};
  std::optional<HttpServer> server_;
};

TEST_F(TlsTest, AnswersComeWholeAndFromTheRightServer) {
  Start();
  EXPECT_EQ(Client()->Get("/small")->body, "small");
  EXPECT_EQ(Client()->Get("/large")->body.size(), kLarge);
  // A body that is one record of TLS, of which poll() knows nothing.
  EXPECT_EQ(
      Client()->Post("/length", std::string(16384, 'x'), "text/plain")->body,
      "16384");
  MakeCertificate(files_.certificate, directory_.path() / "other");
  EXPECT_FALSE(Client()->Get("/small"));
}

TEST_F(TlsTest, PlainHttpIsToldThatItIsWrongHere) {
  Start();
  RawClient client(port());
  client.Send("GET /small HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const std::string answer = client.Read();
  EXPECT_THAT(answer, HasSubstr("HTTP/1.1 400 Bad Request"));
  EXPECT_THAT(answer, HasSubstr("https"));
  RawClient nonsense(port());
  nonsense.Send(std::string(1000, '\x16'));
  nonsense.Read();
  EXPECT_EQ(Count("tls"), 2U);
  EXPECT_EQ(Count("answered"), 0U);
}

TEST_F(TlsTest, SlowHandshakesHoldNobodyAndAreEnded) {
  Start();
  std::vector<std::unique_ptr<RawClient>> slow;
  for (int i = 0; i < 300; ++i) {  // The first bytes of a ClientHello.
    slow.push_back(std::make_unique<RawClient>(port()));
    slow.back()->Send(std::string("\x16\x03\x01\x02\x00\x01", 6));
  }
  const Clock::time_point begin = Clock::now();

  EXPECT_EQ(Client()->Get("/small")->body, "small");
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(1));
  EXPECT_EQ(slow.back()->Read(), "");
  EXPECT_LT(Clock::now() - begin, std::chrono::seconds(4));
  EXPECT_GE(Count("busy"), 172U);
  EXPECT_GE(Count("slow"), 1U);
}

TEST_F(TlsTest, ARenewedCertificateIsTakenForNewClients) {
  Start();
  MakeCertificate(files_.certificate, files_.key, 20);
  EXPECT_FALSE(Client()->Get("/small"));
  EXPECT_EQ(server_->RenewTls(), 20);
  EXPECT_EQ(Client()->Get("/small")->body, "small");
  const auto good = Client();
  std::ofstream(directory_.path() / "cert.pem") << "half";
  EXPECT_THROW(server_->RenewTls(), ConfigError);
  EXPECT_FALSE(Client()->Get("/small"));
  EXPECT_GE(Count("answered"), 1U);
}

TEST_F(TlsTest, WhatCannotServeIsRefusedWithFileAndReason) {
  const std::string other = directory_.path() / "other";
  MakeCertificate(other, files_.key);
  EXPECT_THAT(Complaint(), HasSubstr("--console-key " + files_.key.string() +
                                     ": is not the key of the certificate"));
  MakeCertificate(files_.certificate, files_.key, -1);
  EXPECT_THAT(Complaint(),
              HasSubstr("--console-tls " + files_.certificate.string() +
                        ": the certificate has expired"));
  MakeCertificate(files_.certificate, files_.key, 365, 1);
  EXPECT_THROW(TlsContext{files_}, PassingError)
      << "the clock may be set later";
  MakeCertificate(files_.certificate, files_.key);
  std::filesystem::permissions(files_.key, std::filesystem::perms(0644));
  EXPECT_THAT(Complaint(), HasSubstr("key.pem: mode 0644 lets others read"));
  std::ofstream(files_.key) << "nonsense";
  std::filesystem::permissions(files_.key, std::filesystem::perms(0600));
  EXPECT_THAT(Complaint(), HasSubstr("key.pem: expected a private key"));
  std::ofstream(files_.certificate) << "nonsense";
  EXPECT_THAT(Complaint(),
              HasSubstr("cert.pem: expected a certificate in PEM"));
}

TEST_F(TlsTest, TheKeyMayStandInTheFileOfTheCertificate) {
  MakeCertificate(files_.certificate, files_.certificate);
  files_.key.clear();
  Start();
  EXPECT_EQ(Client()->Get("/small")->body, "small");
  std::filesystem::permissions(files_.certificate,
                               std::filesystem::perms(0644));
  EXPECT_THAT(Complaint(),
              HasSubstr("--console-tls " + files_.certificate.string() +
                        ": mode 0644 lets others read"));
  MakeCertificate(files_.certificate, directory_.path() / "key");
  EXPECT_THAT(Complaint(), HasSubstr("give its file by --console-key"));
  files_.certificate = directory_.path() / "none";
  EXPECT_THAT(Complaint(), HasSubstr("No such file or directory"));
}

}  // namespace
}  // namespace fdi::monitor
