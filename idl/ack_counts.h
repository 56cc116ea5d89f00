#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <utility>

#include "idl/writer_pace.h"

namespace fdi::idl {

/// The counts by which readers number their acknowledgements.
///
/// A writer of Fast DDS ignores an acknowledgement unless its count is above
/// that of the one before. A reader that lost the writer for the lease of a
/// participant, and finds it again, counts from 1 anew; the writer, if it heard
/// the reader all the time, as when a link was cut one way, knows nothing of
/// that and ignores it, for as long as the reader had counted before. Then the
/// two do not find each other's endpoints, and a lossless writer waits. So
/// counts go on where they were. Thread safe.
class AckCounts {
 public:
  /// The count to hand over for `count`, of `reader` to the writer `entity` of
  /// this participant.
  /// @param first_word it acknowledges nothing, as a reader says first.
  std::uint32_t Next(const WriterGuid& reader, std::uint32_t entity,
                     std::uint32_t count, bool first_word);

 private:
  struct State {
    std::uint32_t last{0};    ///< As the reader counts.
    std::uint32_t before{0};  ///< What it had counted in former lives.
  };
  using States = std::map<std::pair<WriterGuid, std::uint32_t>, State>;

  std::mutex mutex_;
  States recent_;
  States older_;  ///< Forgotten when `recent_` is full again.
};

}  // namespace fdi::idl
