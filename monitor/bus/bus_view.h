#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "idl/endpoint.h"
#include "report/json_output.h"
#include "report/program.h"

namespace fdi::monitor {

/// The decision vectors that a program wants.
enum class Vectors : std::uint8_t {
  kNone,
  kLive,  ///< The newest of each valve; under load some are overwritten.
  kAll,   ///< From monitors with --lossless-decisions.
};

/// Settings of BusView.
struct BusOptions {
  std::string program;      ///< As other participants see it.
  std::string valves{"*"};  ///< Glob: vectors and events of these only.
  int max_valves{2000};
  Vectors vectors{Vectors::kLive};
};

/// Everything that monitors publish, for programs that display it.
class BusView {
 public:
  /// @throws TransportError
  BusView(const BusOptions& options, const report::Context& context,
          LogSink log);

  /// Calls `on_message` with each received message and its Reception, model
  /// sets first because they explain the decision vectors, and `on_gone` with
  /// the id of each valve that gave up its place at its monitor. Blocks briefly
  /// if nothing has arrived. @throws PassingError as
  /// idl::Participant::RequireInterfaces()
  template <typename OnMessage, typename OnGone>
  void Take(OnMessage on_message, OnGone on_gone) {
    constexpr std::chrono::milliseconds kNow{0};
    constexpr std::chrono::milliseconds kMoment{50};
    const auto matching = [&](const auto& message, const auto& reception) {
      if (Matches(message.valve_id)) {
        on_message(message, reception);
      }
    };
    participant_.RequireInterfaces();
    models_.Take({on_message, {}}, kNow);
    events_.Take({matching, {}}, decisions_ || batches_ ? kNow : kMoment);
    status_.Take({on_message, {}}, kNow);
    states_.Take({matching, [&](const auto& message,
                                const auto&) { on_gone(message.valve_id); }},
                 kNow);
    if (decisions_) {
      decisions_->Take({matching, {}}, kMoment, 1000);
    }
    if (batches_) {
      batches_->Take(idl::ForEachVector(matching), kMoment, 10);
    }
  }

  /// Messages that were published but lost on the way.
  std::uint64_t lost() const;

 private:
  bool Matches(const std::string& valve_id) const;

  std::string valves_;
  idl::Participant participant_;
  idl::Subscriber<idl::ModelSetInfoMessage> models_;
  idl::Subscriber<FaultEvent> events_;
  idl::Subscriber<idl::MonitorStatusMessage> status_;
  idl::Subscriber<idl::ValveStateMessage> states_;
  std::optional<idl::Subscriber<idl::DecisionMessage>> decisions_;
  std::optional<idl::Subscriber<idl::DecisionBatchMessage>> batches_;
};

/// The meaning of the arrays in decision vectors, learnt from ModelSetInfo.
class ModelNames {
 public:
  void Add(const idl::ModelSetInfoMessage& info);
  /// Null if the ModelSetInfo has not arrived yet.
  const idl::ModelSetInfoMessage* Find(std::uint64_t hash) const;
  /// KnownFaults() of a set; empty as Find() is null.
  std::vector<std::string> KnownTo(std::uint64_t hash) const;
  /// True if the factors of `message` can be named, or there are none.
  bool Explains(const idl::DecisionMessage& message) const;

  /// {"X": r, ...} by channel; null where it abstains. Without ModelSetInfo the
  /// keys are "#1", "#2", ... in Residuals() and Factors().
  report::Json Residuals(const idl::DecisionMessage& message) const;
  /// {"f1": d, ...} by fault.
  report::Json Factors(const idl::DecisionMessage& message) const;

 private:
  std::map<std::uint64_t, idl::ModelSetInfoMessage> infos_;
};

}  // namespace fdi::monitor
