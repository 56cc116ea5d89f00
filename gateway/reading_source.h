#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "gateway/live_table.h"
#include "import/assembler.h"

namespace fdi::gateway {

/// Receives the readings and events of a source.
struct ReadingHandlers {
  std::function<void(const importer::TagReading&)> reading;
  /// All of the source that is not mentioned is unchanged up to the stamp.
  std::function<void(std::string_view source, std::optional<std::int64_t>)>
      alive;
  /// The connection of the source is lost.
  std::function<void(std::string_view source)> ended;
  /// Called for input that cannot be read. @param about the tag, topic or line.
  std::function<void(std::string_view about, std::string_view why)> wrong;
};

/// Where readings come from: a pipe, a broker. One thread.
class ReadingSource {
 public:
  virtual ~ReadingSource() = default;
  /// Hands on what has come; waits up to `timeout` if nothing has.
  /// @returns false once nothing more can come.
  virtual bool Poll(std::chrono::milliseconds timeout,
                    const ReadingHandlers& handlers) = 0;
  /// The table was read again.
  virtual void Use(const LiveTable& /*table*/) {}
  /// Readings that were dropped because they came too fast.
  virtual std::uint64_t dropped() const { return 0; }
  /// True if samples may wait for a reader that is behind, which holds up the
  /// source.
  virtual bool may_wait() const { return false; }
};

}  // namespace fdi::gateway
