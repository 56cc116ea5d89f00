// Where fault events go beside the history.
#include "monitor/app/cause_groups.h"
#include "monitor/app/service.h"

namespace fdi::monitor {

// Before the first event.
void Service::WatchCauses() {
  if (cause_groups_.empty()) {
    return;
  }
  context_.log(LogLevel::kInfo,
               "cause_groups groups=" + std::to_string(cause_groups_.size()));
  history_.WatchCauses(std::move(cause_groups_),
                       [this](const storage::CauseChange& change) {
                         if (outward_) {
                           outward_->hook().Tell(CauseJson(change));
                         }
                       });
}

// The bus, and who else is told.
EventSink& Service::EventsOut() {
  return outward_ ? static_cast<EventSink&>(*outward_) : events_;
}

// What an earlier session committed but perhaps did not send.
void Service::ResendEvents() {
  for (const storage::UnsentEvent& event : history_.UnsentEvents()) {
    if (events_.Resend(event)) {
      history_.MarkResent(event);
      counters_.Add(Counter::kEventsResent);
    }
  }
}

}  // namespace fdi::monitor
