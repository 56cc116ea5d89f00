#include "storage/history/foreign_history.h"

#include <algorithm>

namespace fdi::storage {

void ForeignHistory::LeaveOut(std::int64_t rows, const std::string& reason) {
  constexpr std::size_t kReasons = 3;
  left_out_ += rows;
  if (reasons_.size() < kReasons &&
      std::ranges::find(reasons_, reason) == reasons_.end()) {
    reasons_.push_back(reason);
  }
}

std::string ForeignHistory::TakeNote() {
  if (left_out_ == 0) {
    return {};
  }
  std::string note = std::to_string(left_out_) +
                     (left_out_ == 1 ? " row" : " rows") +
                     " could not be read: ";
  for (const std::string& reason : reasons_) {
    note += (&reason == reasons_.data() ? "" : "; ") + reason;
  }
  left_out_ = 0;
  reasons_.clear();
  return note;
}

std::string TakeNote(History& history) {
  auto* foreign = dynamic_cast<ForeignHistory*>(&history);
  return foreign == nullptr ? std::string() : foreign->TakeNote();
}

}  // namespace fdi::storage
