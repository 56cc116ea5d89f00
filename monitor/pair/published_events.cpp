#include "monitor/pair/published_events.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace fdi::monitor {
namespace {

bool Same(const FaultEvent& a, const FaultEvent& b) {
  return a.episode_id == b.episode_id &&
         OnTheBus(a.transition.kind) == OnTheBus(b.transition.kind) &&
         a.transition.stamp_ns == b.transition.stamp_ns;
}

}  // namespace

bool Covers(const FaultEvent& said, const FaultEvent& found) {
  const Transition& a = said.transition;
  const Transition& b = found.transition;
  const bool like =
      IsIsolation(OnTheBus(a.kind)) && IsIsolation(OnTheBus(b.kind))
          ? a.faults == b.faults
          : a.kind == b.kind;
  return said.episode_id == found.episode_id &&
         (a.kind == TransitionKind::kClosed ||
          (b.kind != TransitionKind::kClosed &&
           (like || b.stamp_ns <= a.stamp_ns)));
}

bool IsEarlier(const FaultEvent& a, const FaultEvent& b) {
  return std::pair(a.transition.stamp_ns, a.transition.kind) <
         std::pair(b.transition.stamp_ns, b.transition.kind);
}

bool PublishedEvents::Add(const FaultEvent& event, TimePoint now) {
  if (valves_.size() >= kMaxValves && !valves_.contains(event.valve_id)) {
    ForgetOlderHalf();
  }
  std::deque<Said>& last = valves_[event.valve_id];
  if (std::ranges::any_of(
          last, [&](const Said& each) { return Same(each.event, event); })) {
    return false;
  }
  // The stamps of two sources are not compared.
  auto place = last.end();
  while (place != last.begin() &&
         std::prev(place)->event.source_id == event.source_id &&
         IsEarlier(event, std::prev(place)->event)) {
    --place;
  }
  // A model set lasts no longer for it.
  last.insert(place, {now, event})->event.models = nullptr;
  if (last.size() > kEventsPerValve) {
    last.pop_front();
  }
  return true;
}

bool PublishedEvents::Cover(const FaultEvent& found) const {
  const auto known = valves_.find(found.valve_id);
  return known != valves_.end() &&
         std::ranges::any_of(known->second, [&](const Said& each) {
           return Covers(each.event, found);
         });
}

void PublishedEvents::ForgetEnded(TimePoint now) {
  std::erase_if(valves_, [&](const auto& each) {
    const Said& last = each.second.back();
    return last.event.transition.kind == TransitionKind::kClosed &&
           now - last.at > kMaxRepeatAge;
  });
}

std::vector<FaultEvent> PublishedEvents::Since(TimePoint begin) const {
  std::vector<FaultEvent> events;
  for (const auto& [valve_id, said] : valves_) {
    for (const Said& each : said) {
      if (each.at >= begin) {
        events.push_back(each.event);
      }
    }
  }
  return events;
}

// The valves that were silent for longest.
void PublishedEvents::ForgetOlderHalf() {
  std::vector<std::pair<TimePoint, std::string>> ages;
  ages.reserve(valves_.size());
  for (const auto& [valve_id, said] : valves_) {
    ages.emplace_back(said.back().at, valve_id);
  }
  const auto middle =
      ages.begin() + static_cast<std::ptrdiff_t>(ages.size() / 2);
  std::ranges::nth_element(ages, middle);
  std::for_each(ages.begin(), middle,
                [this](const auto& each) { valves_.erase(each.second); });
}

}  // namespace fdi::monitor
