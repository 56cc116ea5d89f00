#include "monitor/pair/operator_sync.h"

#include <exception>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "base/retry.h"

namespace fdi::monitor {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kPeriod{200};
constexpr std::int64_t kMaxActionAgeNs = 30LL * 86'400'000'000'000;
// Both monitors record an event at about the same time, in rare cases with the
// stamp of another sample. One that a monitor missed is adopted within seconds.
constexpr std::chrono::seconds kEventTimeout{10};
constexpr std::chrono::seconds kEpisodeTimeout{60};
constexpr std::size_t kMaxReceivedActions = 10'000;

}  // namespace

OperatorSync::OperatorSync(idl::Participant& participant,
                           const PairOptions& options, std::string monitor,
                           const std::filesystem::path& history,
                           ThrottledLog& log)
    : monitor_(std::move(monitor)),
      local_actions_(history),
      history_(history),
      log_(log),
      out_(participant, {idl::Profile::kLossless, 0, PartitionsOf(options)}),
      in_(participant, idl::Profile::kLive, idl::Overflow::kLibrary,
          PartitionOfOthers(options)) {}

void OperatorSync::Start() {
  thread_ = std::jthread([this](const std::stop_token& stop) {
    const auto exchange = [this] {
      in_.Take(
          {[this](const OperatorAction& action, const auto&) {
             if (received_.size() < kMaxReceivedActions) {
               received_.push_back({std::chrono::steady_clock::now(), action});
             }
           },
           {}},
          kPeriod);
      ApplyReceived();
      SendActions();
    };
    RetryUntil(stop, kPeriod, exchange, [this](const std::exception& error) {
      const std::string reason = error.what();
      log_.Report(LogId::kOperatorSync, "operator_action_waits",
                  [&reason] { return "reason=" + LogValue(reason); });
    });
  });
}

// A reader that has just come has missed what was sent before, so all actions
// of the last thirty days are sent again. Who has one already ignores it
// (Adopt).
void OperatorSync::SendActions() {
  if (out_.matched() == 0) {
    return;
  }
  if (const int readers = out_.total_matched(); readers != seen_readers_) {
    seen_readers_ = readers;
    unsent_.clear();
    local_actions_.Rewind();
  }
  for (OperatorAction& action :
       local_actions_.Next(storage::UtcNow() - kMaxActionAgeNs)) {
    unsent_.push_back(std::move(action));
  }
  for (; !unsent_.empty(); unsent_.pop_front()) {
    unsent_.front().monitor = monitor_;
    try {
      if (out_.Write(unsent_.front(), {}, kPeriod) != idl::WriteResult::kSent) {
        return;
      }
    } catch (const DataError& error) {  // Does not fit the wire type.
      ReportRefusal(error);
    }
  }
}

// The history already has an action that comes back to us, which ends the loop.
void OperatorSync::ApplyReceived() {
  const auto now = std::chrono::steady_clock::now();
  for (std::size_t waiting = received_.size(); waiting > 0; --waiting) {
    const Received& received = received_.front();
    const auto waited = now - received.since;
    bool keep = false;
    try {
      if (waited < kEventTimeout && !history_.HasEventsOf(received.action)) {
        keep = true;
      } else if (history_.Adopt(received.action)) {
        log_.Line(LogLevel::kInfo, "operator_action_adopted from=" +
                                       LogValue(received.action.monitor) +
                                       " who=" + LogValue(received.action.who));
      }
    } catch (const NotFoundError&) {
      keep = waited < kEpisodeTimeout;
    } catch (const ConfigError& error) {  // Not a valid action.
      ReportRefusal(error);
    }
    if (keep) {
      received_.push_back(received_.front());
    }
    received_.pop_front();
  }
}

void OperatorSync::ReportRefusal(const std::exception& error) {
  const std::string reason = error.what();
  log_.Report(LogId::kOperatorSync, "operator_action_refused",
              [&reason] { return "reason=" + LogValue(reason); });
}

}  // namespace fdi::monitor
