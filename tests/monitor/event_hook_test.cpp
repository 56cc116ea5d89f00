#include "monitor/service/event_hook.h"

#include <chrono>
#include <csignal>
#include <fstream>
#include <future>
#include <sstream>
#include <stdexcept>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/error.h"
#include "report/shared_files.h"
#include "tests/monitor/linear_models.h"
#include "tests/sanitized.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

std::string Slurp(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// Runs until told, and notes what it got.
class FakeDelivery : public EventDelivery {
 public:
  std::optional<std::string> Deliver(const std::string& json) override {
    std::unique_lock lock(mutex);
    got.push_back(report::Json::parse(json));
    changed.notify_all();
    changed.wait(lock, [this] { return open; });
    if (got.size() <= throwing) {
      throw std::runtime_error("no thread");
    }
    return failure;
  }
  void Interrupt() override { Open(); }
  void Open() {
    const std::lock_guard lock(mutex);
    open = true;
    changed.notify_all();
  }
  bool WaitFor(std::size_t count) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, seconds(10),
                            [&] { return got.size() >= count; });
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::vector<report::Json> got;
  bool open{true};
  std::size_t throwing{0};  // So many deliveries first.
  std::optional<std::string> failure;
};

class ProgramDeliveryTest : public testing::Test {
 protected:
  std::filesystem::path Out() const { return directory_.path() / "out"; }
  storage::TemporaryDirectory directory_;
};

TEST_F(ProgramDeliveryTest, ProgramReadsTheEventFromItsInput) {
  const auto delivery =
      MakeEventDelivery("tee '" + Out().string() + "'", seconds(10));
  EXPECT_EQ(delivery->Deliver("{\"a\": \"$(id); rm -rf `x`\"}\n"),
            std::nullopt);
  EXPECT_EQ(Slurp(Out()), "{\"a\": \"$(id); rm -rf `x`\"}\n");
}

TEST_F(ProgramDeliveryTest, WordsAreNotForAShell) {
  const auto delivery = MakeEventDelivery(
      "touch '" + Out().string() + " a' $(echo) ;", seconds(10));
  // $(echo) and ; are names of files.
  EXPECT_EQ(delivery->Deliver("x"), std::nullopt);
  EXPECT_TRUE(std::filesystem::exists(Out().string() + " a"));
  EXPECT_TRUE(std::filesystem::remove("$(echo)"));
  EXPECT_TRUE(std::filesystem::remove(";"));
}

// At the start, and not at the first alarm.
TEST_F(ProgramDeliveryTest, WhatCannotBeRunIsRefused) {
  std::ofstream(Out()) << "#!/bin/sh\n";
  for (const std::string& command :
       {std::string("/no/such/program"), std::string("no-such-program -v"),
        Out().string(), Out().parent_path().string()}) {
    EXPECT_THROW(MakeEventDelivery(command, seconds(1)), ConfigError)
        << command;
  }
  EXPECT_NO_THROW(MakeEventDelivery("/bin/true", seconds(1)));
}

TEST_F(ProgramDeliveryTest, FailureSaysWhy) {
  EXPECT_THAT(*DeliverToProgram({"/no/such/program"}, seconds(1))->Deliver("x"),
              HasSubstr("No such file"));
  EXPECT_EQ(*MakeEventDelivery("false", seconds(10))->Deliver("x"),
            "exit status 1");
}

TEST_F(ProgramDeliveryTest, WhatDoesNotEndIsKilledWithItsChildren) {
  const auto delivery = DeliverToProgram(
      {"sh", "-c", "sleep 1000 & echo $! > " + Out().string() + "; wait"},
      milliseconds(300));
  EXPECT_EQ(*delivery->Deliver("x"), "killed after 300 ms");
  const pid_t child = std::stoi(Slurp(Out()));
  // A killed process dies once it runs; whoever adopted it may look later.
  const auto ended = [](const std::string& stat) {
    return stat.empty() || stat.find(") Z ") != std::string::npos;
  };
  const auto deadline = std::chrono::steady_clock::now() + seconds(60);
  const std::string file = "/proc/" + std::to_string(child) + "/stat";
  while (!ended(Slurp(file)) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::yield();
  }
  const std::string stat = Slurp(file);
  EXPECT_TRUE(ended(stat)) << stat;
}

TEST_F(ProgramDeliveryTest, InterruptionEndsItAtOnce) {
  const auto delivery = MakeEventDelivery("sleep 1000", seconds(1000));
  auto result = std::async(std::launch::async,
                           [&delivery] { return delivery->Deliver("x"); });
  delivery->Interrupt();
  EXPECT_EQ(result.get().value_or(""), "the monitor stops");
}

// For as long as it lives this process can open so many more files.
class FileLimit {
 public:
  explicit FileLimit(int more) {
    getrlimit(RLIMIT_NOFILE, &before_);
    rlimit limit = before_;
    const int lowest = open("/dev/null", O_RDONLY | O_CLOEXEC);
    close(lowest);
    limit.rlim_cur = static_cast<rlim_t>(lowest + more);
    setrlimit(RLIMIT_NOFILE, &limit);
  }
  ~FileLimit() { setrlimit(RLIMIT_NOFILE, &before_); }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;

 private:
  rlimit before_{};
};

TEST_F(ProgramDeliveryTest, WithoutFilesADeliveryFailsAtOnceAndSaysWhy) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  const auto delivery = MakeEventDelivery("sleep 1000", seconds(1000));
  const FileLimit limit(1);  // The event itself takes it.
  EXPECT_THAT(delivery->Deliver("x").value_or(""), HasSubstr("pidfd_open"));
}

TEST_F(ProgramDeliveryTest, WithoutFilesNoDeliveryIsMade) {
  if (kSanitized) {
    GTEST_SKIP() << "under a sanitizer";
  }
  const FileLimit limit(0);
  EXPECT_THROW(MakeEventDelivery("true", seconds(1)), std::system_error);
}

TEST(EventDeliveryTest, WhatIsNoCommandIsRefused) {
  for (const char* target :
       {"", "  ", "http://host/path", "https://host/", "echo 'a"}) {
    EXPECT_THROW(MakeEventDelivery(target, seconds(1)), ConfigError) << target;
  }
}

class EventHookTest : public testing::Test {
 protected:
  EventHookTest() {
    auto delivery = std::make_unique<FakeDelivery>();
    fake_ = delivery.get();
    options_.now = [this] {
      const std::lock_guard lock(clock_mutex_);
      return now_;
    };
    options_.per_minute = 3;
    delivery_ = std::move(delivery);
  }
  void Start() {
    hook_.emplace(std::move(delivery_), options_,
                  [this](LogLevel, std::string_view line) {
                    log_ += std::string(line) + "\n";
                  });
    hook_->Start();
  }
  void Advance(seconds time) {
    const std::lock_guard lock(clock_mutex_);
    now_ += time;
  }

  EventHookOptions options_;
  std::mutex clock_mutex_;
  std::chrono::steady_clock::time_point now_{};
  std::unique_ptr<EventDelivery> delivery_;
  FakeDelivery* fake_;
  std::string log_;
  std::optional<EventHook> hook_;
};

TEST_F(EventHookTest, BeyondTheRateTheNewestIsToldWithTheCountOfTheOthers) {
  Start();
  for (int i = 0; i < 10; ++i) {
    hook_->Notify({{"i", i}});
  }
  ASSERT_TRUE(fake_->WaitFor(3));
  Advance(seconds(20));
  ASSERT_TRUE(fake_->WaitFor(4));
  hook_->Stop(seconds(10));

  EXPECT_EQ(fake_->got[3]["i"], 9);
  EXPECT_EQ(fake_->got[3]["left_out"], 6);
  EXPECT_EQ(fake_->got[0]["left_out"], 0);
  EXPECT_EQ(hook_->counts().delivered, 4u);
  EXPECT_EQ(hook_->counts().left_out, 6u);
}

TEST_F(EventHookTest, ADeliveryThatHangsHoldsNobodyUp) {
  fake_->open = false;
  options_.per_minute = 100;
  options_.max_waiting = 5;
  Start();
  for (int i = 0; i < 50; ++i) {
    hook_->Notify({{"i", i}});
  }
  ASSERT_TRUE(fake_->WaitFor(1));
  EXPECT_EQ(fake_->got.size(), 1u);
  hook_->Stop(milliseconds(0));
  EXPECT_GE(hook_->counts().left_out, 40u);
}

TEST_F(EventHookTest, FailuresAreCountedAndLogged) {
  fake_->failure = "no such luck";
  Start();
  hook_->Notify({{"i", 1}});
  hook_->Stop(seconds(10));
  EXPECT_EQ(hook_->counts().failed, 1u);
  EXPECT_THAT(log_, HasSubstr("event_hook_failed reason=\"no such luck\""));
}

TEST_F(EventHookTest, ADeliveryThatThrowsFailsAndTheNextOneIsMade) {
  fake_->throwing = 1;
  Start();
  hook_->Notify({{"i", 1}});
  hook_->Notify({{"i", 2}});
  hook_->Stop(seconds(10));
  EXPECT_EQ(hook_->counts().failed, 1u);
  EXPECT_EQ(hook_->counts().delivered, 1u);
  EXPECT_THAT(log_, HasSubstr("event_hook_failed reason=\"no thread\""));
}

FaultEvent Flashing() {
  FaultEvent event;
  event.valve_id = "V1";
  event.episode_id = 0xAB;
  event.models = SharedLinearModels();
  event.transition.kind = TransitionKind::kIsolated;
  event.transition.faults = 2;  // f7
  event.transition.strength = 0.7;
  return event;
}

// The example of the documents, with the keys that an event has.
TEST_F(ProgramDeliveryTest, AnEventBecomesARequestOfMaximoAndARowOfSap) {
  const report::FaultTexts texts(report::SharedFile("faults.toml"));
  FaultEvent event = Flashing();
  ValveIdentity about;
  about.location = "Hall 2";
  const auto made = [&](const std::string& form) {
    const auto delivery =
        MakeEventDelivery("sh -c \"python3 '" FDI_WORK_ORDERS "' " + form +
                              " > '" + Out().string() + "'\"",
                          seconds(60));
    EXPECT_EQ(
        delivery->Deliver(EventJson(event, true, texts, {}, about).dump()),
        std::nullopt);
    return Slurp(Out());
  };
  const auto request = report::Json::parse(made("maximo"));
  EXPECT_EQ(request["assetnum"], "V1");
  EXPECT_EQ(request["location"], "Hall 2");
  EXPECT_EQ(request["reportedpriority"], 1);
  EXPECT_EQ(request["externalrecid"], "00000000000000ab");
  EXPECT_THAT(made("sap"), HasSubstr("\nM2,V1,V1: Flashing or critical flow,1,"
                                     "19700101,000000,"));
  event.transition.kind = TransitionKind::kChanged;  // It is ordered already.
  EXPECT_EQ(made("maximo"), "");
  event.transition.kind = TransitionKind::kRaised;  // It got its name before.
  EXPECT_EQ(report::Json::parse(made("maximo")), request);
  event.transition.faults = 0;  // Its order comes with its name.
  EXPECT_EQ(made("maximo"), "");
}

TEST(EventJsonTest, EventSpeaksTheLanguageOfTheCatalogue) {
  const report::FaultTexts texts(report::SharedFile("faults.toml"));
  FaultEvent event = Flashing();
  event.model_set = "linear";
  event.model_version = 1;
  event.transition.stamp_ns = 5'000'000;

  const report::Json json = EventJson(event, true, texts);
  EXPECT_EQ(json["kind"], "ISOLATED");
  EXPECT_EQ(json["fault"], "f7");
  EXPECT_EQ(json["name"], texts.Of(7).name);
  EXPECT_EQ(json["severity"], "critical");
  EXPECT_EQ(json["priority"], 1);
  EXPECT_EQ(json["episode_id"], "00000000000000ab");
  EXPECT_EQ(json["stamp_utc"], "1970-01-01T00:00:00.005Z");
  EXPECT_TRUE(json["reason"].is_null());

  event.transition.kind = TransitionKind::kChanged;
  event.transition.severity = Severity::kHigh;  // As the monitor says.
  const report::Json changed = EventJson(event, true, texts);
  EXPECT_EQ(changed["kind"], "CHANGED");
  EXPECT_EQ(changed["severity"], "high");
  EXPECT_EQ(changed["priority"], 2);
  EXPECT_TRUE(changed["second"].is_null());

  event.transition.kind = TransitionKind::kSecond;
  event.transition.second.open = true;
  event.transition.second.faults = 1;
  const report::Json second = EventJson(event, true, texts);
  EXPECT_EQ(second["fault"], "f7");
  EXPECT_EQ(second["second"], FaultSetName(*event.models, 1));
  event.transition.second.faults = 0;
  EXPECT_EQ(EventJson(event, true, texts)["second"], "unknown");
  event.transition.second = {};
  EXPECT_EQ(EventJson(event, true, texts)["second"], "none");
}

TEST(EventJsonTest, AShelvedAlarmSaysSo) {
  const report::FaultTexts texts(report::SharedFile("faults.toml"));
  FaultEvent event;
  event.valve_id = "V1";
  event.models = SharedLinearModels();
  event.transition.kind = TransitionKind::kIsolated;
  event.transition.faults = 2;  // f7
  storage::Shelf shelf;
  shelf.valve_id = "V1";
  shelf.fault = "f7";
  EXPECT_EQ(EventJson(event, true, texts, {shelf})["shelved"], true);
  shelf.fault = "f1";
  EXPECT_EQ(EventJson(event, true, texts, {shelf})["shelved"], false);
  EXPECT_EQ(EventJson(event, true, texts)["shelved"], false);
}

TEST(EventJsonTest, AnEventSaysWhoTheValveIs) {
  const report::FaultTexts texts(report::SharedFile("faults.toml"));
  FaultEvent event;
  event.valve_id = "V1";
  ValveIdentity about;
  about.description = "Feed";
  about.grade = 1;
  const report::Json json = EventJson(event, true, texts, {}, about);
  EXPECT_EQ(json["about"]["description"], "Feed");
  EXPECT_EQ(json["about"]["grade"], 1);
  EXPECT_TRUE(EventJson(event, true, texts)["about"].is_null());
}

// Only once no known fault explains it any more.
TEST(EventJsonTest, ADetectionIsNotYetUnlikeAnyKnownFault) {
  const report::FaultTexts texts(report::SharedFile("faults.toml"));
  FaultEvent event;
  event.transition.kind = TransitionKind::kDetected;
  event.transition.unknown = Unknown::kTooEarly;
  EXPECT_TRUE(EventJson(event, true, texts)["fault"].is_null());
  EXPECT_TRUE(EventJson(event, true, texts)["name"].is_null());
  EXPECT_TRUE(EventJson(event, true, texts)["check"].is_null());

  event.transition.unknown = Unknown::kOutsideKnown;
  EXPECT_TRUE(EventJson(event, true, texts)["fault"].is_null());
  EXPECT_EQ(EventJson(event, true, texts)["name"], texts.Of(0).name);
}

}  // namespace
}  // namespace fdi::monitor
