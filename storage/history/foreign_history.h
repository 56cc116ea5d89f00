#pragma once

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "base/log.h"
#include "storage/history/history.h"

namespace fdi::storage {

/// A history on another host, into which others write, too: calls may last, and
/// a row may be one that cannot be.
class ForeignHistory : public History {
 public:
  /// All calls from now on together have to end within that time, or throw
  /// HistoryAwayError.
  virtual void FinishWithin(std::chrono::milliseconds time) = 0;
  /// Says there, from now on, what it waits for, and at its end TakeNote().
  virtual void SayTo(LogSink log) = 0;

  /// "2 rows could not be read: REASON; REASON" if calls since the last one of
  /// this function left out rows that cannot be; empty: none.
  std::string TakeNote();

 protected:
  /// Counts `rows` that a call leaves out, and keeps the first three reasons.
  void LeaveOut(std::int64_t rows, const std::string& reason);

 private:
  std::int64_t left_out_{0};
  std::vector<std::string> reasons_;
};

/// TakeNote() of a foreign history; empty for one of this host.
std::string TakeNote(History& history);

}  // namespace fdi::storage
