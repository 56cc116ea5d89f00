#include "monitor/app/watch_print.h"

#include <algorithm>
#include <cstdio>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"
#include "storage/history_types.h"

namespace fdi::monitor {
namespace {

std::string Hex(std::uint64_t value) {
  return storage::EpisodeIdText(value);  // 16 digits
}

std::string IsolatedNames(const idl::FaultEventMessage& message) {
  std::string names;
  for (const idl::FaultCandidate& candidate : message.candidates) {
    if (candidate.isolated) {
      names += (names.empty() ? "" : "|") + FaultName(candidate.fault);
    }
  }
  return names.empty() ? "unknown" : names;
}

// Why there is no name: the faults that may yet be it, or that none is known.
std::string WhyUnknown(const idl::FaultEventMessage& message) {
  if (message.transition.faults != 0) {
    return "";
  }
  std::string names;
  for (const idl::FaultCandidate& candidate : message.candidates) {
    names += (names.empty() ? "" : "|") + FaultName(candidate.fault);
  }
  if (!names.empty()) {
    return " too_early=" + names;
  }
  return message.transition.kind == TransitionKind::kDetected
             ? " too_early"
             : " outside_known";
}

}  // namespace

void WatchPrinter::Learn(const idl::ModelSetInfoMessage& info) {
  infos_[info.model_hash] = info;
}

const idl::ModelSetInfoMessage* WatchPrinter::InfoOf(std::uint64_t hash) const {
  const auto found = infos_.find(hash);
  return found == infos_.end() ? nullptr : &found->second;
}

std::string WatchPrinter::FaultAt(const idl::DecisionMessage& message,
                                  std::size_t index) const {
  const idl::ModelSetInfoMessage* info = InfoOf(message.model_hash);
  return info != nullptr && index < info->faults.size()
             ? FaultName(info->faults[index])
             : "d" + std::to_string(index + 1);
}

std::string WatchPrinter::ChannelAt(const idl::DecisionMessage& message,
                                    std::size_t index) const {
  const idl::ModelSetInfoMessage* info = InfoOf(message.model_hash);
  return info != nullptr && index < info->channels.size()
             ? info->channels[index].name
             : std::to_string(index + 1);
}

std::string WatchPrinter::Line(const idl::DecisionMessage& message) const {
  const Verdict& v = message.verdict;
  std::string line = cli::FormatTime(v.stamp_ns, utc_) + " " +
                     message.valve_id + " " +
                     std::string(QualityName(v.quality)) + " " +
                     std::string(StateName(v.state));
  for (std::size_t c = 0; c < static_cast<std::size_t>(message.channel_count);
       ++c) {
    line += " r_" + ChannelAt(message, c) + "=" +
            cli::FormatNumber(v.residuals[c], 3);
  }
  if (message.channel_count > 0) {
    line += " normal=" + cli::FormatNumber(v.normal_factor, 2);
  }
  for (std::size_t f = 0; f < static_cast<std::size_t>(message.fault_count);
       ++f) {
    const bool isolated = (v.isolated >> f & 1U) != 0;
    if (isolated || v.fault_factors[f] > 0.0) {
      line += " " + FaultAt(message, f) + "=" +
              cli::FormatNumber(v.fault_factors[f], 2) + (isolated ? "*" : "");
    }
  }
  return line;
}

std::string WatchPrinter::Line(const idl::FaultEventMessage& message) const {
  const Transition& t = message.transition;
  std::string line =
      cli::FormatTime(t.stamp_ns, utc_) + " " + message.valve_id + " EVENT " +
      std::string(TransitionName(t.kind)) + " " + IsolatedNames(message) +
      WhyUnknown(message) + " factor=" + cli::FormatNumber(t.factor, 2) +
      " episode=" + Hex(message.episode_id);
  if (t.reason != EndReason::kNone) {
    line += " reason=" + std::string(EndReasonName(t.reason));
  }
  return line + (message.persisted ? "" : " NOT_PERSISTED");
}

std::string WatchPrinter::Line(const idl::MonitorStatusMessage& message) const {
  std::string line = cli::FormatTime(message.stamp_ns, utc_) + " " +
                     message.monitor + " STATUS " +
                     std::string(idl::HealthName(message.health));
  if (!message.text.empty()) {
    line += " (" + message.text + ")";
  }
  for (const auto& [name, value] : message.counters) {
    if (value != 0) {
      line += " " + name + "=" + std::to_string(value);
    }
  }
  return line;
}

std::string WatchPrinter::Line(const idl::ModelSetInfoMessage& message) const {
  return cli::FormatTime(message.created_ns, utc_) + " MODELS " +
         message.model_set + "@" + std::to_string(message.version) +
         " hash=" + Hex(message.model_hash) +
         " channels=" + std::to_string(message.channels.size()) +
         " observers=" + std::to_string(message.observers.size());
}

cli::Json WatchPrinter::Object(const idl::DecisionMessage& message) const {
  const Verdict& v = message.verdict;
  cli::Json json{{"topic", "DecisionVector"},
                 {"valve", message.valve_id},
                 {"source", Hex(v.source_id)},
                 {"seq", v.seq},
                 {"stamp_ns", v.stamp_ns},
                 {"model_hash", Hex(message.model_hash)},
                 {"quality", QualityName(v.quality)},
                 {"state", StateName(v.state)},
                 {"detected", v.detected},
                 {"confidence", v.confidence},
                 {"normal_factor", v.normal_factor}};
  cli::Json residuals = cli::Json::object();
  for (std::size_t c = 0; c < static_cast<std::size_t>(message.channel_count);
       ++c) {
    residuals[ChannelAt(message, c)] = v.residuals[c];
  }
  cli::Json factors = cli::Json::object();
  cli::Json isolated = cli::Json::array();
  for (std::size_t f = 0; f < static_cast<std::size_t>(message.fault_count);
       ++f) {
    factors[FaultAt(message, f)] = v.fault_factors[f];
    if ((v.isolated >> f & 1U) != 0) {
      isolated.push_back(FaultAt(message, f));
    }
  }
  json["residuals"] = std::move(residuals);
  json["factors"] = std::move(factors);
  json["isolated"] = std::move(isolated);
  return json;
}

cli::Json WatchPrinter::Object(const idl::FaultEventMessage& message) const {
  const Transition& t = message.transition;
  cli::Json candidates = cli::Json::array();
  for (const idl::FaultCandidate& candidate : message.candidates) {
    candidates.push_back({{"fault", FaultName(candidate.fault)},
                          {"factor", candidate.factor},
                          {"strength", candidate.strength},
                          {"isolated", candidate.isolated}});
  }
  return {{"topic", "FaultEvent"},
          {"valve", message.valve_id},
          {"episode_id", Hex(message.episode_id)},
          {"transition", TransitionName(t.kind)},
          {"stamp_ns", t.stamp_ns},
          {"detection_stamp_ns", t.detection_stamp_ns},
          {"fault", IsolatedNames(message)},
          {"factor", t.factor},
          {"strength", t.strength},
          {"reason", EndReasonName(t.reason)},
          {"candidates", std::move(candidates)},
          {"model_set",
           message.model_set + "@" + std::to_string(message.model_version)},
          {"persisted", message.persisted}};
}

cli::Json WatchPrinter::Object(const idl::MonitorStatusMessage& message) const {
  cli::Json counters = cli::Json::object();
  for (const auto& [name, value] : message.counters) {
    counters[name] = value;
  }
  return {{"topic", "MonitorStatus"},
          {"monitor", message.monitor},
          {"software", message.software},
          {"started_ns", message.started_ns},
          {"stamp_ns", message.stamp_ns},
          {"health", idl::HealthName(message.health)},
          {"text", message.text},
          {"counters", std::move(counters)}};
}

cli::Json WatchPrinter::Object(const idl::ModelSetInfoMessage& message) const {
  cli::Json faults = cli::Json::array();
  for (const int fault : message.faults) {
    faults.push_back(FaultName(fault));
  }
  cli::Json channels = cli::Json::array();
  for (const ChannelSpec& channel : message.channels) {
    channels.push_back(channel.name);
  }
  return {{"topic", "ModelSetInfo"},
          {"model_set", message.model_set},
          {"version", message.version},
          {"model_hash", Hex(message.model_hash)},
          {"sample_period_s", message.sample_period_s},
          {"channels", std::move(channels)},
          {"faults", std::move(faults)},
          {"observers", message.observers.size()}};
}

}  // namespace fdi::monitor
