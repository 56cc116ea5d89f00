#include "idl/ack_counts.h"

namespace fdi::idl {
namespace {

// Reordered acknowledgements are closer together than this.
constexpr std::uint32_t kOvertaken = 64;
constexpr std::size_t kMaxAcknowledgements = 16'384;

}  // namespace

std::uint32_t AckCounts::Next(const WriterGuid& reader, std::uint32_t entity,
                              std::uint32_t count, bool first_word) {
  const MutexLock lock(mutex_);
  const States::key_type key(reader, entity);
  auto found = recent_.find(key);
  if (found == recent_.end()) {
    if (recent_.size() == kMaxAcknowledgements) {
      older_ = std::exchange(recent_, {});
    }
    const auto old = older_.find(key);
    found =
        recent_.emplace(key, old == older_.end() ? State{} : old->second).first;
  }
  State& state = found->second;
  const bool back = count <= state.last;
  if (back && (first_word || state.last - count >= kOvertaken)) {
    state.before += state.last;
    state.last = count;
  } else if (!back) {
    state.last = count;
  }
  return state.before + count;
}

}  // namespace fdi::idl
