#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>

#include "base/mutex.h"
#include "idl/writer_pace.h"

namespace fdi::idl {

/// Keeps the counts in readers' acknowledgements increasing.
///
/// A Fast DDS writer ignores an acknowledgement whose count is not above the
/// previous one. A reader that lost the writer for a participant's lease and
/// finds it again restarts at 1; if the writer heard the reader all the time,
/// as with a link cut in one direction, it does not know and ignores the
/// acknowledgements until the old count is reached. Until then the two do not
/// discover each other's endpoints, and a lossless writer blocks. So counts
/// continue from the old value here. Thread safe.
class AckCounts {
 public:
  /// The count to pass on for `count`, sent by `reader` to the writer `entity`
  /// of this participant.
  /// @param first_word an empty acknowledgement, with which a reader begins.
  std::uint32_t Next(const WriterGuid& reader, std::uint32_t entity,
                     std::uint32_t count, bool first_word);

 private:
  struct State {
    std::uint32_t last{0};    ///< As sent by the reader.
    std::uint32_t before{0};  ///< Sum over the reader's earlier incarnations.
  };
  using States = std::map<std::pair<WriterGuid, std::uint32_t>, State>;

  Mutex mutex_;
  States recent_ GUARDED_BY(mutex_);
  States older_ GUARDED_BY(mutex_);  ///< Dropped when `recent_` is full again.
};

}  // namespace fdi::idl
