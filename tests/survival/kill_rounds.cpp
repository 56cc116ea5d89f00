#include "tests/survival/kill_rounds.h"

#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <thread>

#include "tests/system/monitor_process.h"

namespace fdi {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kMaxRuntime{120};

int Setting(const char* name, int otherwise) {
  const char* text = std::getenv(name);
  const int value = text == nullptr ? otherwise : std::atoi(text);
  if (value < 1 || value > 100'000) {
    throw std::runtime_error(std::string(name) + " is '" + text +
                             "', accepted are 1 to 100000");
  }
  return value;
}

// A shell drops stdout and becomes the program, which keeps the process id.
std::vector<std::string> Silent(const std::vector<std::string>& command) {
  std::vector<std::string> silent{"/bin/sh", "-c", "exec \"$@\" >/dev/null",
                                  "sh"};
  silent.insert(silent.end(), command.begin(), command.end());
  return silent;
}

}  // namespace

int KillRounds() {
  return Setting("FDI_KILL_ROUNDS", 3);
}

RandomMoments::RandomMoments(unsigned kind)
    : generator_(static_cast<unsigned>(Setting("FDI_KILL_SEED", 1)) * 100 +
                 kind) {}

milliseconds RandomMoments::Within(milliseconds from, milliseconds to) {
  std::uniform_int_distribution<std::int64_t> moment(from.count(), to.count());
  return milliseconds(moment(generator_));
}

int RandomMoments::Choose(const std::vector<int>& values) {
  std::uniform_int_distribution<std::size_t> index(0, values.size() - 1);
  return values[index(generator_)];
}

Finished RunProgram(const std::vector<std::string>& command) {
  const Clock::time_point start = Clock::now();
  ChildProcess process(Silent(command));
  const int code = process.AwaitExit(kMaxRuntime).value_or(-1);
  return {code, process.errors(),
          std::chrono::duration_cast<milliseconds>(Clock::now() - start)};
}

bool RunAndKill(const std::vector<std::string>& command, milliseconds life) {
  const Clock::time_point end = Clock::now() + life;
  ChildProcess process(Silent(command));
  std::this_thread::sleep_until(end);
  process.Signal(SIGKILL);
  return process.AwaitExit() == 128 + SIGKILL;
}

std::string Doctor(const std::filesystem::path& data) {
  if (!std::filesystem::exists(data)) {
    return "";
  }
  const Finished doctor =
      RunProgram({FDI_STORE_PROGRAM, "--data", data.string(), "doctor"});
  return doctor.code == 0 ? ""
                          : "doctor ended with " + std::to_string(doctor.code) +
                                ": " + doctor.errors;
}

}  // namespace fdi
