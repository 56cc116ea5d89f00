#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "base/error.h"
#include "monitor/checkpoint.h"
#include "monitor/episode_tracker.h"
#include "monitor/sinks.h"

/// Sinks that remember, wait or fail as a test wants. Thread safe.
namespace fdi::monitor {

/// Waits for a condition that other threads bring about; 20 s at most.
class Notice {
 public:
  template <typename Change>
  void Apply(Change&& change) {
    const std::lock_guard lock(mutex_);
    change();
    changed_.notify_all();
  }
  template <typename Condition>
  bool Await(Condition&& condition) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, std::chrono::seconds(20), condition);
  }
  template <typename Read>
  auto Look(Read&& read) {
    const std::lock_guard lock(mutex_);
    return read();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
};

class FixedResolver : public ModelResolver {
 public:
  explicit FixedResolver(std::shared_ptr<const ModelSet> models,
                         std::vector<std::string> assigned = {})
      : models_(std::move(models)), assigned_(std::move(assigned)) {}
  std::vector<std::string> AssignedValves() const override { return assigned_; }
  bool IsolationHeld(std::string_view valve_id) const override {
    return valve_id.starts_with("provisional");
  }
  std::shared_ptr<const ModelSet> ModelsFor(
      std::string_view valve_id) const override {
    if (valve_id.starts_with("broken")) {
      throw std::runtime_error("CRC");
    }
    return valve_id.starts_with("bare") ? nullptr : models_;
  }

 private:
  std::shared_ptr<const ModelSet> models_;
  std::vector<std::string> assigned_;
};

class FakeBus : public DecisionSink, public EventSink {
 public:
  struct Decision {
    std::string valve_id;
    std::uint64_t seq;
    std::uint64_t model_hash;
    Quality quality;
  };

  bool Publish(const std::string& valve_id, const ModelSet* models,
               const Verdict& verdict) override {
    notice.Await([this] { return !held; });
    if (valve_id == unsendable) {
      throw DataError("valve_id cannot be sent");
    }
    notice.Apply([&] {
      decisions.push_back({valve_id, verdict.seq,
                           models != nullptr ? models->content_hash : 0,
                           verdict.quality});
    });
    return true;
  }
  bool Publish(const FaultEvent& event, bool persisted) override {
    notice.Apply([&] {
      events.emplace_back(event.transition.kind, persisted);
      event_times.push_back(std::chrono::steady_clock::now());
    });
    return true;
  }
  void Remove(const std::string& valve_id) override {
    notice.Apply([&] { removed.push_back(valve_id); });
  }

  Notice notice;
  bool held{false};
  std::string unsendable;
  std::vector<Decision> decisions;
  std::vector<std::string> removed;
  std::vector<std::pair<TransitionKind, bool>> events;
  std::vector<std::chrono::steady_clock::time_point> event_times;
};

class FakeHistory : public HistorySink {
 public:
  void CommitBatch(const std::function<void()>& batch) override {
    std::this_thread::sleep_for(commit_time);
    batch();
  }
  bool Record(const FaultEvent& event) override {
    notice.Await([this] { return !stuck; });
    bool taken = true;
    notice.Apply([&] {
      ++attempts;
      FailIfBroken();
      if (event.valve_id == poison) {
        throw RecordError("a trigger says no");
      }
      taken = event.valve_id != refused;
      if (!taken) {
        return;
      }
      ++recorded[{event.episode_id, event.transition.kind}];
      if (event.transition.kind == TransitionKind::kDetected) {
        detected.push_back(event.transition.detection_stamp_ns);
      }
    });
    return taken;
  }
  void Resume(std::uint64_t /*id*/, std::int64_t /*stamp*/) override {
    notice.Apply([&] { FailIfBroken(); });
  }
  void StoreLook(const EpisodeLook& look) override {
    notice.Apply([&] {
      FailIfBroken();
      looks[look.episode_id] = look;
    });
  }
  void StoreStrength(const StrengthPoint& point) override {
    notice.Apply([&] {
      FailIfBroken();
      strengths.push_back(point);
    });
  }
  void ConfirmNormal(const std::string& valve_id,
                     std::int64_t /*stamp_ns*/) override {
    notice.Apply([&] {
      FailIfBroken();
      normal.push_back(valve_id);
    });
  }
  void StoreSilence(const std::string& valve_id,
                    std::optional<std::int64_t> since_ns) override {
    notice.Apply([&] {
      FailIfBroken();
      silences.emplace_back(valve_id, since_ns);
    });
  }
  void AddTrace(const EpisodeTrace& trace) override {
    std::this_thread::sleep_for(trace_time.load());
    notice.Apply([&] {
      FailIfBroken();
      trace_points += trace.trace.size();
    });
  }
  void AddGap(const DataGap& gap) override {
    notice.Apply([&] {
      FailIfBroken();
      gaps.push_back(gap);
    });
  }
  void CommitCheckpoint(const Checkpoint& checkpoint) override {
    notice.Apply([&] {
      FailIfBroken();
      if (checkpoint_poisoned) {
        throw RecordError("a day is refused");
      }
      checkpoint_sum = Merged(std::move(checkpoint_sum), checkpoint);
      ++checkpoints;
    });
  }
  void MarkSent(const FaultEvent& /*event*/) override {
    notice.Apply([&] {
      FailIfBroken();
      ++sent;
    });
  }
  void Commit() override {
    notice.Apply([&] {
      FailIfBroken();
      if (buffer_poisoned) {
        throw RecordError("a gap is refused");
      }
    });
  }
  void DropBuffered() override {
    notice.Apply([&] { buffer_poisoned = false; });
  }

  Notice notice;
  bool broken{false};
  bool stuck{false};
  bool buffer_poisoned{false};
  bool checkpoint_poisoned{false};
  std::string poison;   // A valve whose events fail for their own sake.
  std::string refused;  // A valve whose events are not taken.
  std::chrono::milliseconds commit_time{0};
  std::atomic<std::chrono::milliseconds> trace_time{};
  int attempts{0};
  std::map<std::pair<std::uint64_t, TransitionKind>, int> recorded;
  std::map<std::uint64_t, EpisodeLook> looks;
  std::vector<StrengthPoint> strengths;
  std::vector<std::string> normal;
  std::vector<std::pair<std::string, std::optional<std::int64_t>>> silences;
  std::vector<DataGap> gaps;
  Checkpoint checkpoint_sum;
  int checkpoints{0};
  std::vector<std::int64_t> detected;  // Stamps.
  std::size_t trace_points{0};
  int sent{0};

 private:
  void FailIfBroken() const {
    if (broken) {
      throw std::runtime_error("disk is full");
    }
  }
};

/// Takes what a valve says, and forgets it.
class FakeOutlet : public EpisodeOutlet {
 public:
  void OnEvent(FaultEvent /*event*/) override {}
  void OnEvidence(EpisodeTrace /*trace*/) override {}
  void OnLook(EpisodeLook /*look*/) override {}
  void OnStrength(StrengthPoint /*point*/) override {}
  void OnGap(DataGap /*gap*/) override {}
  void OnNormal(const std::string& /*valve*/, std::int64_t /*ns*/) override {}
  void OnSilence(const std::string& /*valve*/,
                 std::optional<std::int64_t> /*since_ns*/) override {}
  void OnResumed(const OpenEpisode& /*episode*/,
                 std::int64_t /*stamp_ns*/) override {}
};

class FakeRuns : public SampleSink {
 public:
  void Append(const ReceivedSample& sample) override {
    notice.Await([this] { return !held; });
    notice.Apply([&] {
      if (sample.ended) {
        ++ends;
      } else {
        pending.push_back(sample);
      }
    });
  }
  void Commit() override {
    notice.Apply([&] {
      if (broken) {
        throw std::runtime_error("disk is full");
      }
      stored.insert(stored.end(), pending.begin(), pending.end());
      pending.clear();
    });
  }
  std::uint64_t DropPending() override {
    std::uint64_t dropped = 0;
    notice.Apply([&] {
      dropped = pending.size();
      pending.clear();
    });
    return dropped;
  }
  void Close() override { Commit(); }
  std::uint64_t recorded() const override { return stored.size(); }

  Notice notice;
  bool held{false};
  bool broken{false};
  int ends{0};
  std::vector<ReceivedSample> pending;
  std::vector<ReceivedSample> stored;
};

}  // namespace fdi::monitor
