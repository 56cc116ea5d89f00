#include "monitor/bus/bus_view.h"

#include "diagnosis/decision/certainty.h"
#include "diagnosis/model/fault_catalogue.h"
#include "diagnosis/records/valve_glob.h"
#include "monitor/bus/dds_options.h"

namespace fdi::monitor {
namespace {

// The placeholder must not look like a name: a fault set may be {f1, f19}, so
// "d2" would be read as the factor of f2.
std::string Position(std::size_t index) {
  return "#" + std::to_string(index + 1);
}

}  // namespace

BusView::BusView(const BusOptions& options, const report::Context& context,
                 LogSink log)
    : valves_(options.valves),
      participant_(DdsOptionsOf(context.options, options.max_valves),
                   std::move(log), options.program),
      models_(participant_),
      events_(participant_),
      status_(participant_),
      states_(participant_) {
  if (options.vectors == Vectors::kLive) {
    decisions_.emplace(participant_);
  } else if (options.vectors == Vectors::kAll) {
    batches_.emplace(participant_);
  }
}

std::uint64_t BusView::lost() const {
  const auto lost = [](const idl::SubscriberStatus& status) {
    return status.lost + status.undecodable + status.rejected_instances;
  };
  return lost(events_.status()) + lost(status_.status()) +
         lost(states_.status()) +
         (decisions_ ? lost(decisions_->status()) : 0) +
         (batches_ ? lost(batches_->status()) : 0);
}

bool BusView::Matches(const std::string& valve_id) const {
  return GlobMatches(valves_, valve_id);
}

void ModelNames::Add(const idl::ModelSetInfoMessage& info) {
  infos_[info.model_hash] = info;
}

const idl::ModelSetInfoMessage* ModelNames::Find(std::uint64_t hash) const {
  const auto found = infos_.find(hash);
  return found == infos_.end() ? nullptr : &found->second;
}

bool ModelNames::Explains(const idl::DecisionMessage& message) const {
  return message.fault_count + message.channel_count == 0 ||
         infos_.contains(message.model_hash);
}

report::Json ModelNames::Residuals(const idl::DecisionMessage& message) const {
  const idl::ModelSetInfoMessage* info = Find(message.model_hash);
  report::Json residuals = report::Json::object();
  for (std::size_t c = 0; c < static_cast<std::size_t>(message.channel_count);
       ++c) {
    residuals[info != nullptr && c < info->channels.size()
                  ? info->channels[c].name
                  : Position(c)] = message.verdict.residuals[c];
  }
  return residuals;
}

std::vector<std::string> ModelNames::KnownTo(std::uint64_t hash) const {
  const idl::ModelSetInfoMessage* info = Find(hash);
  return info != nullptr ? KnownFaults(info->faults, info->observers)
                         : std::vector<std::string>();
}

report::Json ModelNames::Factors(const idl::DecisionMessage& message) const {
  const idl::ModelSetInfoMessage* info = Find(message.model_hash);
  report::Json factors = report::Json::object();
  for (std::size_t f = 0; f < static_cast<std::size_t>(message.fault_count);
       ++f) {
    factors[info != nullptr && f < info->faults.size()
                ? FaultName(info->faults[f])
                : Position(f)] = message.verdict.fault_factors[f];
  }
  return factors;
}

}  // namespace fdi::monitor
