#include "monitor/checkpoint.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>

namespace fdi::monitor {
namespace {

constexpr std::int64_t kDayNs = 86'400'000'000'000;

std::int64_t DayOf(std::int64_t stamp_ns) {
  return stamp_ns / kDayNs - (stamp_ns % kDayNs < 0 ? 1 : 0);
}

void MergeHealth(std::vector<HealthHour>& older,
                 std::vector<HealthHour> newer) {
  using Key =
      std::tuple<std::string, std::int64_t, std::uint64_t, std::uint32_t>;
  const auto key_of = [](const HealthHour& h) {
    return Key(h.valve_id, h.hour, h.model_hash, h.epoch);
  };
  std::map<Key, std::size_t> places;
  for (std::size_t i = 0; i < older.size(); ++i) {
    places[key_of(older[i])] = i;
  }
  for (HealthHour& hour : newer) {
    const auto [place, added] = places.try_emplace(key_of(hour), older.size());
    if (added || older[place->second].channels != hour.channels) {
      older.push_back(std::move(hour));
    } else {
      older[place->second].Add(hour);
    }
  }
}

void MergeAccumulators(std::vector<Accumulator>& older,
                       std::vector<Accumulator> newer) {
  std::map<std::string, Accumulator> latest;
  for (auto* list : {&older, &newer}) {
    for (Accumulator& accumulator : *list) {
      latest[accumulator.valve_id] = std::move(accumulator);
    }
  }
  older.clear();
  for (auto& [valve, accumulator] : latest) {
    older.push_back(std::move(accumulator));
  }
}

}  // namespace

Checkpoint Merged(Checkpoint older, Checkpoint newer) {
  std::map<std::pair<std::string, std::int64_t>, std::size_t> places;
  for (std::size_t i = 0; i < older.coverage.size(); ++i) {
    places[{older.coverage[i].valve_id, older.coverage[i].day}] = i;
  }
  for (CoverageDay& day : newer.coverage) {
    const auto place = places.find({day.valve_id, day.day});
    if (place == places.end() ||
        older.coverage[place->second].period_s != day.period_s) {
      older.coverage.push_back(std::move(day));
    } else {
      older.coverage[place->second].samples.Add(day.samples);
    }
  }
  MergeAccumulators(older.accumulators, std::move(newer.accumulators));
  MergeAccumulators(older.shadow_accumulators,
                    std::move(newer.shadow_accumulators));
  MergeHealth(older.health, std::move(newer.health));
  older.shadow = Merged(std::move(older.shadow), std::move(newer.shadow));
  return older;
}

void CoverageBook::Add(std::int64_t stamp_ns, Quality quality,
                       std::uint64_t samples) {
  const std::int64_t day = DayOf(stamp_ns);
  auto place = std::ranges::find(days_, day, &Day::day);
  if (place == days_.end()) {
    days_.push_back({day, {}});
    place = days_.end() - 1;
  }
  place->samples.Add(quality, samples);
}

void CoverageBook::TakeTo(const std::string& valve_id, double period_s,
                          std::vector<CoverageDay>& days) {
  for (const Day& day : days_) {
    days.push_back({valve_id, day.day, period_s, day.samples});
  }
  days_.clear();
}

}  // namespace fdi::monitor
