#pragma once

#include <chrono>
#include <functional>
#include <string>

#include "base/mutex.h"
#include "base/worker.h"

namespace fdi::monitor {

/// While a start is getting on, asks the service manager for more time than its
/// limit (EXTEND_TIMEOUT_USEC): a long recovery or migration of a database is
/// not killed and begun again, and a start that hangs is. It gets on if the
/// process used a processor or the disk since the last time.
class StartNotice {
 public:
  using Notify = std::function<void(const std::string&)>;

  /// @param period from one message to the next; each asks for three of them.
  explicit StartNotice(Notify notify, std::chrono::milliseconds period =
                                          std::chrono::seconds(10));
  ~StartNotice() { Stop(); }
  StartNotice(const StartNotice&) = delete;
  StartNotice& operator=(const StartNotice&) = delete;

  void Start();
  /// The start is over.
  void Stop();

 private:
  void Run();

  const Notify notify_;
  const std::chrono::milliseconds period_;
  Mutex mutex_;
  CondVar changed_;
  bool stopping_ GUARDED_BY(mutex_){false};
  Worker worker_;
};

}  // namespace fdi::monitor
