#pragma once

#include <chrono>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

/// Programs that are killed (SIGKILL) at random moments, and what their files
/// must be like afterwards.
namespace fdi {

/// Rounds per kind: FDI_KILL_ROUNDS, else 3. @throws std::runtime_error unless
/// it is 1..100000.
int KillRounds();

/// The moments of one kind of round; FDI_KILL_SEED (default 1) and `kind` give
/// the sequence.
class RandomMoments {
 public:
  explicit RandomMoments(unsigned kind);

  std::chrono::milliseconds Within(std::chrono::milliseconds from,
                                   std::chrono::milliseconds to);
  int Choose(const std::vector<int>& values);

 private:
  std::mt19937 generator_;
};

/// The exit code of a program whose stdout is dropped; its stderr is kept.
struct Finished {
  int code{0};
  std::string errors;
  std::chrono::milliseconds took{0};
};
Finished RunProgram(const std::vector<std::string>& command);

/// Runs it and kills it after `life`. @returns whether it still ran then.
bool RunAndKill(const std::vector<std::string>& command,
                std::chrono::milliseconds life);

/// Complaints of `fdi-store doctor` about the databases (quick_check,
/// foreign_key_check), once a file that was only begun is there; empty if
/// nothing, or if there is no directory yet.
std::string Doctor(const std::filesystem::path& data);

}  // namespace fdi
