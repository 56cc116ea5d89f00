#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "idl/endpoint.h"
#include "storage/models/models.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {

inline void StorePairModels(const std::filesystem::path& data) {
  storage::ModelStore store(data / "models.db",
                            storage::Access::kOccasionalWriter);
  store.Save(LinearModels(), storage::Activation::kAlways);
}

/// @returns whether the condition came true before the patience ended.
inline bool Await(
    const std::function<bool()>& condition,
    std::chrono::milliseconds patience = std::chrono::milliseconds(30'000)) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

/// Valves of a pair of monitors and a subscriber of what these publish: whether
/// every sample got its vector, how late, and every transition came once.
class PairPlant {
 public:
  using Clock = std::chrono::steady_clock;
  using Milliseconds = std::chrono::duration<double, std::milli>;

  /// What became of the vectors of a stretch of time [ms].
  struct Delay {
    double median{0.0};
    double worst{0.0};
    std::size_t missing{0};  ///< Valves without a vector.
  };

  /// @param faulty so many of them, once SetFaulty() is called.
  PairPlant(const idl::DdsOptions& dds, int valves, int faulty,
            std::chrono::milliseconds period)
      : valves_(valves),
        faulty_(faulty),
        period_(period),
        participant_(dds),
        samples_(participant_, {idl::Profile::kLive, valves}),
        vectors_(participant_),
        events_(participant_),
        words_(participant_),
        hears_([this](const std::stop_token& stop) { Hear(stop); }),
        sends_([this](const std::stop_token& stop) { Send(stop); }) {}

  void SetFaulty(bool on) { offset_ = on ? kF7Offset : 0.0; }
  /// Faults grow and go by so much with each sample, and begin with a different
  /// sample at each valve. Monitors that run for a different time detect such
  /// faults at different samples.
  void SetGrowth(double per_sample) { growth_ = per_sample; }

  /// The newest words of the monitors that spoke within 200 ms and stay.
  std::map<std::string, PairState> Words() {
    const std::lock_guard lock(mutex_);
    std::map<std::string, PairState> words;
    for (const auto& [monitor, heard] : words_heard_) {
      if (!heard.first.leaving &&
          Clock::now() - heard.second < std::chrono::milliseconds(200)) {
        words[monitor] = heard.first;
      }
    }
    return words;
  }
  /// The end of the names of those that say that they lead.
  std::vector<std::string> Leaders() {
    std::vector<std::string> leaders;
    for (const auto& [monitor, word] : Words()) {
      if (word.leads) {
        leaders.push_back(monitor.substr(monitor.rfind(':') + 1));
      }
    }
    return leaders;
  }
  /// Two speak, one leads, both judge all valves.
  bool Settled() {
    const auto words = Words();
    return words.size() == 2 && Leaders().size() == 1 &&
           std::ranges::all_of(words, [this](const auto& each) {
             return each.second.judged == valves_;
           });
  }

  /// Of the first sample of each valve that was sent at or after `from`: how
  /// much later its vector came.
  Delay NextVectors(Clock::time_point from) {
    const std::lock_guard lock(mutex_);
    Delay delay;
    std::vector<double> delays;
    for (auto& sent : sent_) {
      const auto first = std::ranges::find_if(
          sent, [&](const auto& each) { return each.second.sent >= from; });
      if (first == sent.end() || !first->second.heard) {
        ++delay.missing;
      } else {
        delays.push_back(
            Milliseconds(first->second.at - first->second.sent).count());
      }
    }
    std::ranges::sort(delays);
    if (!delays.empty()) {
      delay.median = delays[delays.size() / 2];
      delay.worst = delays.back();
    }
    return delay;
  }

  /// Vectors of samples since `from` that came more than once.
  std::size_t Repeated(Clock::time_point from) {
    const std::lock_guard lock(mutex_);
    std::size_t repeated = 0;
    for (const auto& sent : sent_) {
      repeated += static_cast<std::size_t>(
          std::ranges::count_if(sent, [&](const auto& each) {
            return each.second.sent >= from && each.second.heard > 1;
          }));
    }
    return repeated;
  }

  struct Totals {
    std::size_t samples{0};  ///< Older than 3 s,
    std::size_t missing{0};  ///< of these without a vector,
    std::size_t twice{0};    ///< with more than one.
    std::size_t over_500ms{0};
    double worst_ms{0.0};
    std::size_t episodes{0};           ///< By id.
    std::size_t transitions{0};        ///< By episode, kind and stamp.
    std::size_t repeats{0};            ///< Of these, dropped.
    std::size_t transitions_twice{0};  ///< With another stamp.
    std::string twice_of;              ///< The first of these, or empty.
  };
  Totals Count() {
    const std::lock_guard lock(mutex_);
    Totals totals = totals_;
    const auto limit = Clock::now() - std::chrono::seconds(3);
    for (const auto& sent : sent_) {
      for (const auto& [seq, vector] : sent) {
        if (vector.sent > limit || vector.sent < counts_from_) {
          continue;
        }
        ++totals.samples;
        totals.missing += vector.heard == 0 ? 1 : 0;
        totals.twice += vector.heard > 1 ? 1 : 0;
        const double ms = vector.heard == 0
                              ? 0.0
                              : Milliseconds(vector.at - vector.sent).count();
        totals.over_500ms += ms > 500.0 ? 1 : 0;
        totals.worst_ms = std::max(totals.worst_ms, ms);
      }
    }
    totals.transitions = transitions_.size();
    totals.episodes = episodes_.size();
    std::map<std::pair<std::uint64_t, TransitionKind>, std::int64_t> stamps;
    for (const auto& [episode, kind, stamp] : transitions_) {
      if (kind == TransitionKind::kReisolated) {
        continue;
      }
      const auto [first, fresh] = stamps.try_emplace({episode, kind}, stamp);
      if (!fresh && totals.transitions_twice++ == 0) {
        totals.twice_of = std::string(TransitionName(kind)) + "@" +
                          std::to_string(first->second) + "," +
                          std::to_string(stamp);
      }
    }
    return totals;
  }
  /// What was sent before does not count.
  void CountFromNow() {
    const std::lock_guard lock(mutex_);
    counts_from_ = Clock::now();
  }
  /// Every transition that came, in order, and whether it ever came as
  /// persisted.
  std::vector<FaultEvent> Events() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }
  /// Episodes without an end.
  std::size_t Open() {
    const std::lock_guard lock(mutex_);
    std::set<std::uint64_t> open = episodes_;
    for (const auto& [episode, kind, stamp] : transitions_) {
      if (kind == TransitionKind::kClosed) {
        open.erase(episode);
      }
    }
    return open.size();
  }
  std::size_t Isolated() {
    const std::lock_guard lock(mutex_);
    return static_cast<std::size_t>(
        std::ranges::count_if(transitions_, [](const auto& each) {
          return std::get<1>(each) == TransitionKind::kIsolated;
        }));
  }

 private:
  struct Vector {
    Clock::time_point sent;
    Clock::time_point at{};
    int heard{0};
  };

  double Offset(int v, std::uint64_t k) {
    if (v >= faulty_) {
      return 0.0;
    }
    double& level = levels_[static_cast<std::size_t>(v)];
    const double missing = offset_.load() - level;
    const double growth = growth_.load();
    // A valve that rests begins with a sample of its own.
    if (std::isinf(growth) || std::abs(missing) < -kF7Offset ||
        k % kStagger == static_cast<std::uint64_t>(v) % kStagger) {
      level += std::clamp(missing, -growth, growth);
    }
    return level;
  }

  void Send(const std::stop_token& stop) {
    Clock::time_point due = Clock::now();
    for (std::uint64_t k = 0; !stop.stop_requested(); ++k) {
      for (int v = 0; v < valves_; ++v) {
        {
          const std::lock_guard lock(mutex_);
          sent_[static_cast<std::size_t>(v)][k].sent = Clock::now();
        }
        samples_.Write(
            {"V" + std::to_string(v), PlantSample(k, Offset(v, k), source_)});
      }
      due += period_;
      std::this_thread::sleep_until(due);
    }
  }

  void Hear(const std::stop_token& stop) {
    constexpr std::chrono::milliseconds kNow{0};
    while (!stop.stop_requested()) {
      vectors_.Take(
          {[this](const idl::DecisionMessage& m, const auto&) { Take(m); }, {}},
          std::chrono::milliseconds(5));
      events_.Take({[this](const FaultEvent& m, const auto&) { Take(m); }, {}},
                   kNow);
      words_.Take({[this](const PairState& word, const auto&) {
                     const std::lock_guard lock(mutex_);
                     words_heard_[word.monitor] = {word, Clock::now()};
                   },
                   {}},
                  kNow);
    }
  }

  void Take(const idl::DecisionMessage& message) {
    const std::lock_guard lock(mutex_);
    const auto v = std::stoul(message.valve_id.substr(1));
    const auto found = sent_.at(v).find(message.verdict.seq);
    if (message.verdict.source_id == source_ && found != sent_[v].end() &&
        found->second.heard++ == 0) {
      found->second.at = Clock::now();
    }
  }
  void Take(const FaultEvent& event) {
    const std::lock_guard lock(mutex_);
    episodes_.insert(event.episode_id);
    const bool fresh = transitions_
                           .insert({event.episode_id, event.transition.kind,
                                    event.transition.stamp_ns})
                           .second;
    totals_.repeats += fresh ? 0 : 1;
    if (fresh) {
      heard_.push_back(event);
    } else if (event.persisted) {
      std::ranges::find_if(heard_, [&event](const FaultEvent& each) {
        return each.episode_id == event.episode_id &&
               each.transition.kind == event.transition.kind &&
               each.transition.stamp_ns == event.transition.stamp_ns;
      })->persisted = true;
    }
  }

  const int valves_;
  const int faulty_;
  const std::chrono::milliseconds period_;
  const std::uint64_t source_{
      static_cast<std::uint64_t>(Clock::now().time_since_epoch().count())};
  std::atomic<double> offset_{0.0};
  static constexpr std::uint64_t kStagger = 5;
  std::atomic<double> growth_{std::numeric_limits<double>::infinity()};
  std::vector<double> levels_ =
      std::vector<double>(static_cast<std::size_t>(valves_));  // By Send().
  std::mutex mutex_;  // Guards what follows.
  std::vector<std::map<std::uint64_t, Vector>> sent_{
      static_cast<std::size_t>(valves_)};  // By valve and seq.
  std::map<std::string, std::pair<PairState, Clock::time_point>> words_heard_;
  std::set<std::uint64_t> episodes_;
  std::vector<FaultEvent> heard_;
  std::set<std::tuple<std::uint64_t, TransitionKind, std::int64_t>>
      transitions_;
  Totals totals_;
  Clock::time_point counts_from_{};

  idl::Participant participant_;
  idl::Publisher<idl::ValveSampleMessage> samples_;
  idl::Subscriber<idl::DecisionMessage> vectors_;
  idl::Subscriber<FaultEvent> events_;
  idl::Subscriber<PairState> words_;
  std::jthread hears_;
  std::jthread sends_;
};

}  // namespace fdi::monitor
