#include "monitor/app/top_board.h"

#include <algorithm>
#include <cctype>
#include <tuple>

#include "diagnosis/fault_catalogue.h"

namespace fdi::monitor {
namespace {

constexpr std::chrono::seconds kMonitorSilence{5};
constexpr std::size_t kShownFactors = 3;

std::string Lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return text;
}

bool Contains(const TopRow& row, const std::string& filter) {
  for (const std::string& text :
       {row.valve_id, row.faults, std::string(StateName(row.state)),
        std::string(QualityName(row.quality)), row.model_set}) {
    if (Lower(text).find(filter) != std::string::npos) {
      return true;
    }
  }
  return false;
}

// Smaller is worse: isolated, detected, not diagnosed, normal.
int Rank(const TopRow& row) {
  return row.state == State::kIsolated   ? 0
         : row.state == State::kDetected ? 1
         : row.silent                    ? 2
         : row.quality != Quality::kLive ? 3
                                         : 4;
}

bool Precedes(const TopRow& a, const TopRow& b, TopSort sort) {
  switch (sort) {
    case TopSort::kWorst:
      return std::tuple(Rank(a), -a.factor, a.valve_id) <
             std::tuple(Rank(b), -b.factor, b.valve_id);
    case TopSort::kValve:
      return a.valve_id < b.valve_id;
    case TopSort::kFactor:
      return std::tuple(-a.factor, a.valve_id) <
             std::tuple(-b.factor, b.valve_id);
    case TopSort::kSince:  // The newest first, those without last.
      return std::tuple(-a.since_ns.value_or(0), a.valve_id) <
             std::tuple(-b.since_ns.value_or(0), b.valve_id);
  }
  return false;
}

}  // namespace

std::string_view TopSortName(TopSort sort) {
  switch (sort) {
    case TopSort::kWorst:
      return "worst first";
    case TopSort::kValve:
      return "by valve";
    case TopSort::kFactor:
      return "by factor";
    case TopSort::kSince:
      return "newest first";
  }
  return "";
}

TopSort NextSort(TopSort sort) {
  return sort == TopSort::kSince
             ? TopSort::kWorst
             : static_cast<TopSort>(static_cast<int>(sort) + 1);
}

void TopBoard::Learn(const idl::ModelSetInfoMessage& info) {
  infos_[info.model_hash] = info;
}

void TopBoard::Update(const idl::DecisionMessage& message,
                      Clock::time_point now) {
  decisions_[message.valve_id] = {message, now};
}

void TopBoard::Update(const idl::FaultEventMessage& message) {
  const Transition& transition = message.transition;
  if (transition.kind != TransitionKind::kClosed) {
    open_[message.valve_id] = {transition.detection_stamp_ns,
                               message.episode_id};
    return;
  }
  const auto found = open_.find(message.valve_id);
  if (found != open_.end() && found->second.second == message.episode_id) {
    open_.erase(found);
  }
}

void TopBoard::Update(const idl::MonitorStatusMessage& message,
                      Clock::time_point now) {
  monitors_[message.monitor] = {message, now};
}

void TopBoard::Remove(const std::string& valve_id) {
  decisions_.erase(valve_id);
  open_.erase(valve_id);
}

std::vector<TopRow> TopBoard::Rows(TopSort sort, const std::string& filter,
                                   Clock::time_point now) const {
  const std::string lower = Lower(filter);
  std::vector<TopRow> rows;
  for (const auto& [valve_id, heard] : decisions_) {
    TopRow row = RowOf(heard, now);
    if (lower.empty() || Contains(row, lower)) {
      rows.push_back(std::move(row));
    }
  }
  std::sort(rows.begin(), rows.end(), [sort](const TopRow& a, const TopRow& b) {
    return Precedes(a, b, sort);
  });
  return rows;
}

std::string TopBoard::Health(Clock::time_point now) const {
  std::string text;
  for (const auto& [monitor, heard] : monitors_) {
    const auto& [status, at] = heard;
    if (now - at > kMonitorSilence) {
      continue;
    }
    const std::string health = std::string(idl::HealthName(status.health)) +
                               (status.text.empty() ? "" : ": " + status.text);
    text += (text.empty() ? "" : ", ") + health;
  }
  return text;
}

const idl::ModelSetInfoMessage* TopBoard::InfoOf(std::uint64_t hash) const {
  const auto found = infos_.find(hash);
  return found == infos_.end() ? nullptr : &found->second;
}

TopRow TopBoard::RowOf(const Heard& heard, Clock::time_point now) const {
  const idl::DecisionMessage& message = heard.message;
  const Verdict& verdict = message.verdict;
  const idl::ModelSetInfoMessage* info = InfoOf(message.model_hash);
  TopRow row;
  row.valve_id = message.valve_id;
  row.state = verdict.state;
  row.quality = verdict.quality;
  row.silent = now - heard.at > silence_;
  row.normal_factor = verdict.normal_factor;
  row.stamp_ns = verdict.stamp_ns;
  const auto faults = static_cast<std::size_t>(message.fault_count);
  for (std::size_t f = 0; f < faults; ++f) {
    const std::string name = info != nullptr && f < info->faults.size()
                                 ? FaultName(info->faults[f])
                                 : "d" + std::to_string(f + 1);
    const double factor = verdict.fault_factors[f];
    if ((verdict.isolated >> f & 1U) != 0) {
      row.faults += (row.faults.empty() ? "" : "|") + name;
      if (factor >= row.factor) {
        row.strength = verdict.strengths[f];
      }
    }
    if (factor > 0.0) {
      row.factors.emplace_back(name, factor);
    }
    const bool counts =
        verdict.isolated == 0 || (verdict.isolated >> f & 1U) != 0;
    row.factor = counts ? std::max(row.factor, factor) : row.factor;
  }
  std::stable_sort(
      row.factors.begin(), row.factors.end(),
      [](const auto& a, const auto& b) { return a.second > b.second; });
  row.factors.resize(std::min(row.factors.size(), kShownFactors));
  for (int c = 0; c < message.channel_count; ++c) {
    const auto channel = static_cast<std::size_t>(c);
    row.residuals.emplace_back(
        info != nullptr ? info->channels[channel].name : std::to_string(c + 1),
        verdict.residuals[channel]);
  }
  if (row.faults.empty() && verdict.state != State::kNormal) {
    row.faults = "unknown";
  }
  const auto open = open_.find(row.valve_id);
  if (open != open_.end() && verdict.state != State::kNormal) {
    row.since_ns = open->second.first;
  }
  row.model_set = info == nullptr
                      ? ""
                      : info->model_set + "@" + std::to_string(info->version);
  return row;
}

}  // namespace fdi::monitor
