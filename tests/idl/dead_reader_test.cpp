// Readers that die without a word while a writer is sending: 5 s later it
// removes them, and goes on. Long form, as .ci/nightly has it:
// ctest -R DeadReader --repeat until-fail:N.
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <utility>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/idl/dds_fixture.h"

namespace fdi::idl {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr int kReaders = 4;
constexpr int kValves = 500;

class DeadReaderTest : public DeliveryTest,
                       public testing::WithParamInterface<Profile> {
 protected:
  // In processes of their own, which read until they are killed. Before this
  // one has any thread.
  DeadReaderTest() {
    for (pid_t& reader : readers_) {
      reader = fork();
      if (reader == 0) {
        Participant participant(domain_.Options());
        Subscriber<ValveSampleMessage> subscriber(participant);
        while (true) {
          subscriber.Take({[](const auto&, const auto&) {}, {}}, seconds(1));
        }
      }
    }
  }
  ~DeadReaderTest() override { KillReaders(); }

  void KillReaders() {
    for (pid_t& reader : readers_) {
      if (reader > 0) {
        kill(reader, SIGKILL);
        waitpid(std::exchange(reader, 0), nullptr, 0);
      }
    }
  }

 private:
  std::array<pid_t, kReaders> readers_{};
};

TEST_P(DeadReaderTest, TheWriterGoesOn) {
  Participant participant(domain_.Options());
  Publisher<ValveSampleMessage> publisher(participant, {GetParam(), kValves});
  ASSERT_TRUE(publisher.WaitForReaders(kReaders, kPatience));
  std::atomic<std::uint64_t> written{0};
  std::jthread writer([&](const std::stop_token& stop) {
    for (std::uint64_t k = 0; !stop.stop_requested(); ++k) {
      for (int v = 0; v < kValves; ++v) {
        publisher.Write(SampleOf(ValveName(v), k), stop);
        written = k;
      }
      std::this_thread::sleep_for(milliseconds(1));
    }
  });
  KillReaders();
  const auto goes_on = [&] {
    const std::uint64_t before = written;
    std::this_thread::sleep_for(milliseconds(200));
    return publisher.matched() == 0 && written > before;
  };
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!goes_on()) {
    if (std::chrono::steady_clock::now() > end) {
      // Its threads wait for each other: nothing of it can be destroyed.
      std::fprintf(stderr, "the writer hangs\n");
      std::quick_exit(1);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Profiles, DeadReaderTest,
                         testing::Values(Profile::kLive, Profile::kLossless));

}  // namespace
}  // namespace fdi::idl
