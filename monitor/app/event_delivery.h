#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace fdi::monitor {

/// Hands one text to the world outside.
class EventDelivery {
 public:
  virtual ~EventDelivery() = default;
  /// Waits until it was taken, or for the time limit. Any number of threads.
  /// @returns why it was not taken, or nothing.
  virtual std::optional<std::string> Deliver(const std::string& json) = 0;
  /// Ends what is under way, and all that comes, at once. Thread safe.
  virtual void Interrupt() = 0;
};

/// Runs a program with the text as its standard input; status 0 is success.
/// No shell: `words` are the program, sought in PATH, and its arguments. It has
/// no other file of ours open, its output goes to our standard error, and it is
/// killed with all its children that stay in its process group after `limit`.
std::unique_ptr<EventDelivery> DeliverToProgram(
    std::vector<std::string> words, std::chrono::milliseconds limit);

/// POSTs the text as application/json; a status of 2xx is success.
/// @param url http://HOST[:PORT][/PATH]
/// @throws ConfigError naming `url` and what is accepted.
std::unique_ptr<EventDelivery> DeliverToUrl(const std::string& url,
                                            std::chrono::milliseconds limit);

/// One of the two: what begins with http:// is a URL, else a command whose
/// words are separated by blanks, with quotes around those that have some.
/// @throws ConfigError naming what is accepted.
std::unique_ptr<EventDelivery> MakeEventDelivery(
    const std::string& target, std::chrono::milliseconds limit);

}  // namespace fdi::monitor
