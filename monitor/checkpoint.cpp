#include "monitor/checkpoint.h"

#include <map>
#include <tuple>
#include <utility>

#include "base/time_units.h"

namespace fdi::monitor {
namespace {

constexpr std::size_t kMaxRecords = 100'000;

std::int64_t DayOf(std::int64_t stamp_ns) {
  return stamp_ns / kNsPerDay - (stamp_ns % kNsPerDay < 0 ? 1 : 0);
}

// Combines each record of `newer` with the record of `older` that has the same
// key; appends it if there is none or `combine` returns false.
template <typename T, typename KeyOf, typename Combine>
void Merge(std::vector<T>& older, std::vector<T> newer, KeyOf key_of,
           Combine combine) {
  std::map<decltype(key_of(newer.front())), std::size_t> places;
  for (std::size_t i = 0; i < older.size(); ++i) {
    places[key_of(older[i])] = i;
  }
  for (T& record : newer) {
    const auto [place, added] =
        places.try_emplace(key_of(record), older.size());
    const bool combined = !added && place->second < older.size() &&
                          combine(older[place->second], record);
    if (!combined && older.size() < kMaxRecords) {
      older.push_back(std::move(record));
    }
  }
}

}  // namespace

Checkpoint Merged(Checkpoint older, Checkpoint newer) {
  Merge(
      older.coverage, std::move(newer.coverage),
      [](const CoverageDay& d) { return std::pair(d.valve_id, d.day); },
      [](CoverageDay& old, CoverageDay& fresh) {
        if (old.period_s != fresh.period_s) {
          return false;
        }
        old.samples.Add(fresh.samples);
        return true;
      });
  Merge(
      older.health, std::move(newer.health),
      [](const HealthHour& h) {
        return std::tuple(h.valve_id, h.hour, h.model_hash, h.epoch);
      },
      [](HealthHour& old, HealthHour& fresh) {
        if (old.channels != fresh.channels) {
          return false;
        }
        old.Add(fresh);
        return true;
      });
  // The newer of two accumulators of a valve is kept.
  Merge(
      older.accumulators, std::move(newer.accumulators),
      [](const Accumulator& a) { return a.valve_id; },
      [](Accumulator& old, Accumulator& fresh) {
        old = std::move(fresh);
        return true;
      });
  return older;
}

void CoverageBook::Add(std::int64_t stamp_ns, Quality quality,
                       std::uint64_t samples, bool accepted) {
  const std::int64_t day = DayOf(stamp_ns);
  Day* row = FindRow(
      days_, [day](const Day& other) { return other.day == day; }, accepted);
  if (row == nullptr) {
    row = &days_.emplace_back(Day{day, {}});
  }
  row->samples.Add(quality, samples);
}

void CoverageBook::DrainInto(const std::string& valve_id, double period_s,
                             std::vector<CoverageDay>& days) {
  for (const Day& day : days_) {
    days.push_back({valve_id, day.day, period_s, day.samples});
  }
  days_.clear();
}

}  // namespace fdi::monitor
