// Who may read and do what at a console with users, over HTTP.
#include <algorithm>
#include <array>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/monitor/console_http_fixture.h"

namespace fdi::console {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr const char* kPassword = "correct horse";

class ConsoleAdmissionTest : public ConsoleRoutesTest {
 protected:
  ConsoleAdmissionTest() {
    const std::string hash = HashPassword(kPassword);
    for (const Role role : {Role::kView, Role::kAcknowledge, Role::kEngineer}) {
      StoreUser(users(), RoleName(role), User{role, hash});
    }
    RecordEpisode(writer_, 4);
  }
  std::filesystem::path users() const { return directory_.path() / "users"; }
  void StartWithUsers(const std::string& proxy = "") {
    AdmissionOptions options;
    options.users_file = users();
    if (!proxy.empty()) {
      options.proxy_header = kUserHeader;
      options.proxy_address = proxy;
    }
    Start(options);
  }

  std::string Origin() const {
    return "http://127.0.0.1:" + std::to_string(port_);
  }
  int PostFor(const std::string& path, const Json& body,
              httplib::Headers headers) {
    headers.emplace("Cookie", cookie_);
    const auto answer =
        client_->Post(path, headers, body.dump(), "application/json");
    EXPECT_TRUE(answer) << path;
    if (answer && answer->has_header("Set-Cookie")) {
      set_cookie_ = answer->get_header_value("Set-Cookie");
      cookie_ = "other=1; " + set_cookie_.substr(0, set_cookie_.find(';'));
    }
    return answer ? answer->status : 0;
  }
  int Do(const std::string& path, const Json& body) {
    return PostFor(path, body, {{"Origin", Origin()}});
  }
  int LogIn(const std::string& user, const std::string& password = kPassword) {
    return Do("/api/v1/login", {{"user", user}, {"password", password}});
  }
  int Look(const std::string& path, httplib::Headers headers = {}) {
    headers.emplace("Cookie", cookie_);
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
  std::string cookie_;
  std::string set_cookie_;
  Json body_;
};

TEST_F(ConsoleAdmissionTest, WithoutALoginNothingOfThePlantIsSeen) {
  StartWithUsers();
  for (const char* path :
       {"/api/v1/status", "/api/v1/valves", "/api/v1/alarms", "/api/v1/faults",
        "/api/v1/history", "/api/v1/stream", "/api/v1/worklist.csv",
        "/api/v1/%73tatus", "/api/v1/nothing"}) {
    EXPECT_EQ(Look(path), 401) << path;
  }
  EXPECT_EQ(Look(episode_ + ".svg"), 401);
  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "eve"}}), 401);
  EXPECT_EQ(client_->Get("/")->status, 200);
  EXPECT_EQ(Refused("no_session"), 11U);
  EXPECT_THAT(TakeLog(), HasSubstr("console_refused reason=no_session user=\"\""
                                   " method=GET path=\"/api/v1/status\" "
                                   "from=127.0.0.1\n"));
}

TEST_F(ConsoleAdmissionTest, EachRoleMayDoWhatItMay) {
  StartWithUsers();
  const struct {
    const char* path;
    Json body;
    std::array<int, 3> status;  // view, acknowledge, engineer
  } kTable[] = {
      {"/ack", {{"comment", "seen"}}, {403, 200, 200}},
      {"/label", {{"label", "f7"}}, {403, 403, 200}},
      {"shelf", {{"valve", "LV-1"}, {"minutes", 1}}, {403, 200, 200}},
      {"end", Json::object(), {403, 400, 400}},  // Ended below.
  };
  for (std::size_t role = 0; role < 3; ++role) {
    const std::string name = RoleName(static_cast<Role>(role));
    ASSERT_EQ(LogIn(name), 200);
    EXPECT_EQ(Look("/api/v1/status"), 200);
    EXPECT_EQ(body_["user"], name);
    EXPECT_EQ(body_["role"], name);
    EXPECT_EQ(body_["write"], role > 0);
    EXPECT_EQ(body_["session"], true);
    for (const char* path : {"/api/v1/valves", "/api/v1/history"}) {
      EXPECT_EQ(Look(path), 200) << name << path;
    }
    for (const auto& [action, body, status] : kTable) {
      const std::string path = action == std::string("shelf") ? "/api/v1/shelf"
                               : action == std::string("end")
                                   ? "/api/v1/shelf/1/end"
                                   : episode_ + action;
      if (action == std::string("end") && role == 1) {
        EXPECT_EQ(Do(path, body), 200);
      }
      EXPECT_EQ(Do(path, body), status[role]) << name << path;
    }
  }
  EXPECT_EQ(Refused("role"), 5U);
}

TEST_F(ConsoleAdmissionTest, AnActionBearsTheNameOfItsUser) {
  StartWithUsers();
  // A proxy with a password of its own: its browser sends this with everything.
  client_->set_default_headers({{"Authorization", "Basic b3A6c2VjcmV0"}});
  ASSERT_EQ(LogIn("engineer"), 200);
  TakeLog();

  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "view"}}), 403);
  EXPECT_THAT(TakeLog(), HasSubstr("console_refused reason=name "
                                   "user=\"engineer\" method=POST path=\"" +
                                   episode_ + "/ack\""));
  EXPECT_EQ(Do(episode_ + "/ack", {{"who", "engineer"}}), 200);
  EXPECT_EQ(Do(episode_ + "/label", {{"label", "f7"}, {"who", 7}}), 200);
  EXPECT_EQ(Do(episode_ + "/label", Json::array()), 400);

  Look(episode_);
  EXPECT_EQ(body_["events"][4]["kind"], "ACK");
  EXPECT_EQ(body_["events"][4]["who"], "engineer");
  EXPECT_EQ(TakeLog(),
            "console_action user=\"engineer\" role=engineer action=ack "
            "valve=\"LV-1\" episode=" +
                IdText() +
                " from=127.0.0.1\n"
                "console_action user=\"engineer\" role=engineer action=label "
                "valve=\"LV-1\" episode=" +
                IdText() + " from=127.0.0.1\n");
  EXPECT_EQ(console_->admissions().actions.at("ack"), 1U);
}

TEST_F(ConsoleAdmissionTest, TheCookieIsForThisPageAlone) {
  StartWithUsers();
  ASSERT_EQ(LogIn("engineer"), 200);
  EXPECT_THAT(set_cookie_, testing::MatchesRegex("fdi_[0-9a-f]{16}=.*"));
  EXPECT_THAT(set_cookie_, HasSubstr("; Path=/; HttpOnly; SameSite=Strict"));
  EXPECT_THAT(set_cookie_, Not(HasSubstr("Secure")));
  const std::string ack = episode_ + "/ack";
  const std::string host = Origin().substr(7);

  for (const std::string& origin :
       {std::string("http://evil.example"), std::string("null"),
        std::string(""), "http://evil.example/" + host, Origin() + "0",
        "http://localhost:" + std::to_string(port_)}) {
    EXPECT_EQ(PostFor(ack, Json::object(), {{"Origin", origin}}), 403)
        << origin;
  }
  EXPECT_EQ(PostFor(ack, Json::object(), {}), 403);
  EXPECT_EQ(Refused("origin"), 7U);
  // As a browser sees it through a proxy with TLS.
  cookie_.clear();
  EXPECT_EQ(
      PostFor("/api/v1/login", {{"user", "view"}, {"password", kPassword}},
              {{"Origin", "https://" + host}}),
      200);
  EXPECT_THAT(set_cookie_, HasSubstr("; Secure"));
  // Where the proxy says that the browser uses https, a page of http is
  // another.
  EXPECT_EQ(PostFor("/api/v1/logout", Json::object(),
                    {{"X-Forwarded-Proto", "https"}, {"Origin", Origin()}}),
            403);
  EXPECT_EQ(Refused("origin"), 8U);
  EXPECT_EQ(
      PostFor("/api/v1/logout", Json::object(),
              {{"X-Forwarded-Proto", "https"}, {"Origin", "https://" + host}}),
      200);
}

// Two consoles behind one host name, as /hall-1/ and /hall-2/ of a proxy: a
// browser has one jar for both, and sends all its cookies to each.
TEST_F(ConsoleAdmissionTest, ASecondConsoleDoesNotLogOutTheFirst) {
  StartWithUsers();
  ASSERT_EQ(LogIn("engineer"), 200);
  const std::string first = set_cookie_.substr(0, set_cookie_.find(';'));
  console_.reset();
  ConsoleOptions other;
  other.address.host = "127.0.0.2";
  other.address.port = port_;
  other.files = directory_.path() / "page";
  other.admission.users_file = users();
  console_.emplace(other, report::GlobalOptions{},
                   [](LogLevel, std::string_view) {});
  console_->Start({path_, directory_.path() / "models.db", "0.0", kDetected,
                   [] {
                     return MonitorFacts{"OK", {}, 1};
                   },
                   NowNs});
  client_.emplace("127.0.0.2", port_);
  const auto answer = client_->Post(
      "/api/v1/login",
      {{"Origin", "http://127.0.0.2:" + std::to_string(port_)}},
      Json({{"user", "engineer"}, {"password", kPassword}}).dump(),
      "application/json");
  ASSERT_TRUE(answer);
  ASSERT_EQ(answer->status, 200);
  const std::string second = answer->get_header_value("Set-Cookie");
  EXPECT_NE(second.substr(0, second.find('=')),
            first.substr(0, first.find('=')));
}

TEST_F(ConsoleAdmissionTest, AWrongPasswordIsRefusedAndSlowed) {
  StartWithUsers();
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(LogIn("engineer", "not this one"), 401);
  }
  int slowed = 0;  // One attempt a second is looked at, and fails.
  for (int i = 0; i < 20; ++i) {
    slowed += LogIn("engineer", "not this one") == 429 ? 1 : 0;
  }
  EXPECT_GE(slowed, 15);
  EXPECT_GE(Refused("password"), 5U);
  EXPECT_EQ(Refused("slowed"), static_cast<std::uint64_t>(slowed));
  const std::string log = TakeLog();
  EXPECT_THAT(log, HasSubstr("reason=password user=\"engineer\""));
  EXPECT_THAT(log, HasSubstr("reason=slowed"));
  EXPECT_THAT(log, Not(HasSubstr("not this one")));
  // At most ten lines of each reason in 10 s.
  EXPECT_LE(std::count(log.begin(), log.end(), '\n'), 20);
}

TEST_F(ConsoleAdmissionTest, WhoLogsOutOrIsRemovedIsAStranger) {
  StartWithUsers();
  ASSERT_EQ(LogIn("view"), 200);
  const std::string cookie = cookie_;
  EXPECT_EQ(Do("/api/v1/logout", Json::object()), 200);
  cookie_ = cookie;
  EXPECT_EQ(Look("/api/v1/status"), 401);

  ASSERT_EQ(LogIn("view"), 200);
  std::string stream;
  const auto end = client_->Get(
      "/api/v1/stream", {{"Cookie", cookie_}},
      [&](const char* data, std::size_t size) {
        if (stream.empty()) {
          StoreUser(users(), "view", std::nullopt);
          console_->Reload();
          ShowValve("FV-1", 60, 0.1);  // So that it has something to send.
        }
        stream.append(data, size);
        return true;
      });
  EXPECT_THAT(stream, HasSubstr("hello"));
  EXPECT_THAT(stream, Not(HasSubstr("tiles")));
  EXPECT_EQ(Look("/api/v1/status"), 401);
}

TEST_F(ConsoleAdmissionTest, AFileThatBecomesBadChangesNothing) {
  StartWithUsers();
  ASSERT_EQ(LogIn("view"), 200);
  std::ofstream(users()) << "view:none:*\n";
  console_->Reload();

  EXPECT_EQ(Look("/api/v1/status"), 200);
  EXPECT_THAT(TakeLog(), HasSubstr("console_reload_failed reason="));
}

TEST_F(ConsoleAdmissionTest, AProxyThatIsTrustedSaysWhoAsks) {
  StartWithUsers("127.0.0.1");
  const httplib::Headers headers{{kUserHeader, "acknowledge"}};
  EXPECT_EQ(Look("/api/v1/status", headers), 200);
  EXPECT_EQ(body_["user"], "acknowledge");
  EXPECT_EQ(body_["session"], false);
  httplib::Headers post = headers;
  EXPECT_EQ(PostFor(episode_ + "/ack", Json::object(), post), 403);  // Origin.
  post.emplace("Origin", Origin());
  EXPECT_EQ(PostFor(episode_ + "/label", {{"label", "f7"}}, post), 403);
  EXPECT_EQ(PostFor(episode_ + "/ack", Json::object(), post), 200);
  EXPECT_EQ(Look("/api/v1/status", {{kUserHeader, "nobody"}}), 403);
  EXPECT_EQ(Look("/api/v1/status"), 401);
  EXPECT_EQ(Refused("proxy_user"), 1U);
  EXPECT_THAT(TakeLog(), HasSubstr("reason=proxy_user user=\"nobody\""));
}

TEST_F(ConsoleAdmissionTest, TheHeaderOfAnybodyElseIsIgnored) {
  StartWithUsers("10.0.0.1");
  EXPECT_EQ(Look("/api/v1/status", {{kUserHeader, "engineer"}}), 401);
  EXPECT_EQ(Refused("proxy_header"), 1U);
  EXPECT_THAT(TakeLog(), HasSubstr("console_refused reason=proxy_header "
                                   "user=\"engineer\""));
  ASSERT_EQ(LogIn("view"), 200);
  EXPECT_EQ(Look("/api/v1/status", {{kUserHeader, "engineer"}}), 200);
  EXPECT_EQ(body_["user"], "view");
}

TEST_F(ConsoleAdmissionTest, NoTextOfAClientMakesALineOfItsOwn) {
  StartWithUsers();
  LogIn("eve\nconsole_action user=\"anna\"");
  EXPECT_EQ(Look("/api/v1/a%22b%C3%A9"), 401);
  const std::string log = TakeLog();
  EXPECT_THAT(log, HasSubstr(R"(user="eve\nconsole_action user=\"anna\"")"));
  EXPECT_THAT(log, HasSubstr(R"(path="/api/v1/a\"b\u00e9")"));
}

TEST_F(ConsoleAdmissionTest, HashesHoldUpNobodyWhoIsLoggedIn) {
  StartWithUsers();
  ASSERT_EQ(LogIn("view"), 200);
  std::vector<std::thread> guesses;
  for (int i = 0; i < 12; ++i) {
    guesses.emplace_back([this] {
      httplib::Client client("127.0.0.1", port_);
      client.Post("/api/v1/login", {{"Origin", Origin()}},
                  R"({"user":"view","password":"no such thing"})",
                  "application/json");
    });
  }
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(Look("/api/v1/status"), 200);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(2));
  for (std::thread& thread : guesses) {
    thread.join();
  }
}

}  // namespace
}  // namespace fdi::console
