// Who may read and do what, over HTTP.
#include <array>

#include <gmock/gmock.h>

#include "base/error.h"
#include "tests/console/http_fixture.h"
#include "tests/storage/message_of.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;
using testing::Not;

class ConsoleAdmissionTest : public ConsoleRoutesTest {
 protected:
  ConsoleAdmissionTest() { RecordEpisode(writer_, 4); }

  int Do(const std::string& path, const Json& body, httplib::Headers headers) {
    if (!headers.contains("Origin")) {
      headers.emplace("Origin", Origin());
    }
    const auto answer =
        client_->Post(path, headers, body.dump(), "application/json");
    EXPECT_TRUE(answer) << path;
    return answer ? answer->status : 0;
  }
  int Look(const std::string& path, const httplib::Headers& headers = {}) {
    const auto answer = client_->Get(path, headers);
    EXPECT_TRUE(answer) << path;
    body_ = answer ? Json::parse(answer->body, nullptr, false) : Json();
    return answer ? answer->status : 0;
  }
  std::uint64_t Refused(std::string_view reason) const {
    const auto refused = console_->admissions().refused;
    const auto found = refused.find(reason);
    return found == refused.end() ? 0 : found->second;
  }

  const std::string episode_{"/api/v1/episodes/" + IdText()};
  Json body_;
};

TEST_F(ConsoleAdmissionTest, EachRoleMayDoWhatItMay) {
  Start(WriteSecret());
  const struct {
    std::string path;
    Json body;
    std::array<int, 3> status;  // view, acknowledge, engineer
  } kTable[] = {
      {episode_ + "/ack", {{"comment", "seen"}}, {403, 200, 200}},
      {episode_ + "/label", {{"label", "f7"}}, {403, 403, 200}},
      {"/api/v1/shelf", {{"valve", "LV-1"}, {"minutes", 1}}, {403, 200, 200}},
      // The first one ended it.
      {"/api/v1/shelf/1/end", Json::object(), {403, 200, 400}},
  };
  for (std::size_t role = 0; role < 3; ++role) {
    const std::string name = RoleName(static_cast<Role>(role));
    const httplib::Headers headers = ProxyHeaders("anna", name);
    EXPECT_EQ(Look("/api/v1/status", headers), 200);
    EXPECT_EQ(body_["user"], "anna");
    EXPECT_EQ(body_["role"], name);
    EXPECT_EQ(body_["write"], role > 0);
    for (const char* path : {"/api/v1/valves", "/api/v1/history"}) {
      EXPECT_EQ(Look(path, headers), 200) << name << path;
    }
    for (const auto& [path, body, status] : kTable) {
      EXPECT_EQ(Do(path, body, headers), status[role]) << name << path;
    }
  }
  EXPECT_EQ(Refused("role"), 5U);
}

TEST_F(ConsoleAdmissionTest, AnActionBearsTheNameOfItsUser) {
  Start(WriteSecret());
  const httplib::Headers anna = ProxyHeaders("anna", "engineer");
  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "bo"}}, anna), 403);
  EXPECT_THAT(TakeLog(), HasSubstr("console_refused reason=name user=\"anna\" "
                                   "method=POST path=\"" +
                                   episode_ + "/ack\" from=10.1.2.3"));
  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "anna"}}, anna), 200);
  EXPECT_EQ(Do(episode_ + "/label", {{"label", "f7"}, {"who", 7}}, anna), 200);
  EXPECT_EQ(Do(episode_ + "/label", Json::array(), anna), 400);

  Look(episode_);
  EXPECT_EQ(body_["events"][4]["kind"], "ACK");
  EXPECT_EQ(body_["events"][4]["who"], "anna");
  EXPECT_EQ(TakeLog(),
            "console_action user=\"anna\" role=engineer action=ack "
            "valve=\"LV-1\" episode=" +
                IdText() +
                " from=10.1.2.3\n"
                "console_action user=\"anna\" role=engineer action=label "
                "valve=\"LV-1\" episode=" +
                IdText() + " from=10.1.2.3\n");
  EXPECT_EQ(console_->admissions().actions.at("ack"), 1U);
}

// Browsers send the password of a proxy with whatever a foreign page asks.
TEST_F(ConsoleAdmissionTest, OnlyThePageItselfChangesAnything) {
  Start(WriteSecret());
  const std::string ack = episode_ + "/ack";
  const std::string host = Origin().substr(7);
  const auto from = [](const std::string& origin, const char* scheme = "") {
    httplib::Headers headers = ProxyHeaders("anna", "engineer");
    headers.emplace("Origin", origin);
    if (*scheme != '\0') {
      headers.emplace("X-Forwarded-Proto", scheme);
    }
    return headers;
  };
  for (const std::string& origin :
       {std::string("http://evil.example"), std::string("null"),
        std::string(""), "http://evil.example/" + host, Origin() + "0",
        "http://localhost:" + std::to_string(port_)}) {
    EXPECT_EQ(Do(ack, Json::object(), from(origin)), 403) << origin;
  }
  // Where the browser uses https, a page of http is another one.
  EXPECT_EQ(Do(ack, Json::object(), from(Origin(), "https")), 403);
  EXPECT_EQ(Refused("origin"), 7U);
  EXPECT_EQ(Do(ack, Json::object(), from("https://" + host, "https")), 200);
}

TEST_F(ConsoleAdmissionTest, WithoutTheSecretNobodyIsAnybody) {
  Start(WriteSecret());
  const httplib::Headers claims{{"X-FDI-User", "anna"},
                                {"X-FDI-Role", "engineer"}};
  EXPECT_EQ(Look("/api/v1/status", claims), 200);
  EXPECT_TRUE(body_["user"].is_null());
  EXPECT_EQ(body_["write"], false);
  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "anna"}}, claims), 403);
  EXPECT_EQ(Refused("read_only"), 1U);

  for (const std::string& wrong :
       {std::string("x"), std::string(kSecret, 31), kSecret + std::string("0"),
        std::string(kSecret, 31) + "0"}) {
    httplib::Headers headers = claims;
    headers.emplace("X-FDI-Secret", wrong);
    EXPECT_EQ(Look("/api/v1/valves", headers), 403) << wrong;
  }
  EXPECT_EQ(Refused("proxy_secret"), 4U);
  EXPECT_THAT(TakeLog(), Not(HasSubstr(kSecret)));
}

TEST_F(ConsoleAdmissionTest, AUserWithoutARoleIsRefused) {
  Start(WriteSecret());
  for (const auto& [user, role] :
       {std::pair{"anna", ""}, std::pair{"anna", "root"},
        std::pair{"anna", "Engineer"}, std::pair{"", "engineer"}}) {
    EXPECT_EQ(Look("/api/v1/status", ProxyHeaders(user, role)), 403) << role;
  }
  EXPECT_EQ(Refused("proxy_user"), 4U);
}

TEST_F(ConsoleAdmissionTest, NoTextOfAClientMakesALineOfItsOwn) {
  Start(WriteSecret());
  EXPECT_EQ(Look("/api/v1/a%22b%C3%A9", ProxyHeaders("e\"ve", "no")), 403);
  const std::string log = TakeLog();
  EXPECT_THAT(log, HasSubstr(R"(user="e\"ve")"));
  EXPECT_THAT(log, HasSubstr(R"(path="/api/v1/a\"b\u00e9")"));
}

TEST_F(ConsoleAdmissionTest, ASecretThatIsNoneIsRefusedAtTheStart) {
  const auto complaint = [this](const std::filesystem::path& file) {
    return storage::MessageOf<std::exception>([&] {
      const Admission admission(file, [](LogLevel, std::string_view) {});
    });
  };
  EXPECT_THAT(complaint(directory_.path() / "none"),
              HasSubstr("none: cannot be read"));
  EXPECT_THAT(complaint(WriteSecret("too short")),
              HasSubstr("32 to 256 letters and digits"));
  const auto file = WriteSecret();
  EXPECT_EQ(complaint(file), "not thrown");
  for (const unsigned mode : {0660U, 0644U, 0604U}) {
    std::filesystem::permissions(file, std::filesystem::perms(mode));
    EXPECT_THAT(complaint(file), HasSubstr("others can read or change it"));
  }
}

}  // namespace
}  // namespace fdi::console
