#pragma once

#include <chrono>
#include <cstdint>
#include <fstream>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "idl/endpoint.h"
#include "tests/idl/dds_fixture.h"
#include "tests/programs/simulator/process.h"

// The binary as publisher, a Subscriber of this process as reader.
namespace fdi::simulator {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// Keeps the messages that a reader got.
class Reader {
 public:
  explicit Reader(const idl::TestDomain& domain)
      : participant_(domain.Options(), {}, "reader"),
        subscriber_(participant_) {}

  // Takes until `done`, at most `limit` messages a time.
  // @returns false if patience ran out.
  bool TakeUntil(const std::function<bool()>& done, int limit = 1'000'000) {
    const auto deadline = steady_clock::now() + idl::kPatience;
    while (!done()) {
      if (steady_clock::now() > deadline) {
        return false;
      }
      subscriber_.Take(handlers_, milliseconds(50), limit);
    }
    return true;
  }
  bool TakeUntilEnded(std::size_t valves = 1, int limit = 1'000'000) {
    return TakeUntil([&] { return ended_.size() >= valves; }, limit);
  }

  // Takes nothing until all buffers are full.
  bool AwaitFull() {
    const auto deadline = steady_clock::now() + idl::kPatience;
    while (status().rejected_samples == 0) {
      if (steady_clock::now() > deadline) {
        return false;
      }
      std::this_thread::sleep_for(milliseconds(10));
    }
    return true;
  }

  const std::vector<Sample>& Samples(const std::string& valve) {
    return samples_[valve];
  }
  const std::vector<std::string>& ended() const { return ended_; }
  idl::SubscriberStatus status() const { return subscriber_.status(); }

 private:
  idl::Participant participant_;
  idl::Subscriber<idl::ValveSampleMessage> subscriber_;
  std::map<std::string, std::vector<Sample>> samples_;
  std::vector<std::string> ended_;
  idl::Handlers<idl::ValveSampleMessage> handlers_{
      [this](const idl::ValveSampleMessage& message, const idl::Reception&) {
        samples_[message.valve_id].push_back(message.sample);
      },
      [this](const idl::ValveSampleMessage& message, const idl::Reception&) {
        ended_.push_back(message.valve_id);
      }};
};

class PublishTest : public testing::Test {
 protected:
  std::vector<std::string> With(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(),
                     {"--domain", std::to_string(domain_.id()), "--json",
                      "--data", folder_.path().string()});
    return arguments;
  }
  // A run of the program as CSV.
  std::string MakeCsv(const std::string& duration_s) const {
    const std::string file = (folder_.path() / "run.csv").string();
    const Ended ended = RunProgram(
        {"run", "--no-publish", "-o", file, "--duration", duration_s});
    EXPECT_EQ(ended.code, 0) << ended.err;
    return file;
  }

  // More samples than all buffers of a reader hold.
  static constexpr std::size_t kManySamples = 120'000;
  std::string MakeLongCsv() const {
    const std::string file = (folder_.path() / "long.csv").string();
    std::ofstream csv(file);
    csv << "t_s,CV_pct,X_pct\n";
    for (std::size_t i = 0; i < kManySamples; ++i) {
      csv << i << ",50,50\n";
    }
    return file;
  }

  idl::TestDomain domain_;
  storage::TemporaryDirectory folder_;
};

}  // namespace fdi::simulator
