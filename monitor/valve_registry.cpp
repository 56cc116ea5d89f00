#include "monitor/valve_registry.h"

#include <exception>
#include <utility>

#include "diagnosis/quality_count.h"

namespace fdi::monitor {

ValveRegistry::ValveRegistry(const RegistryOptions& options,
                             std::shared_ptr<const ModelResolver> resolver,
                             EpisodeOutlet& outlet, Counters& counters,
                             ThrottledLog& log, LiveSink* live)
    : options_(options),
      resolver_(std::move(resolver)),
      outlet_(outlet),
      counters_(counters),
      log_(log),
      live_(live) {}

void ValveRegistry::Recover(const std::vector<OpenEpisode>& episodes,
                            std::vector<Accumulator> accumulators,
                            TimePoint now) {
  for (Accumulator& accumulator : accumulators) {
    accumulators_[accumulator.valve_id] = std::move(accumulator);
  }
  for (const OpenEpisode& episode : episodes) {
    const auto [known, fresh] = recovered_.emplace(episode.valve_id, episode);
    if (fresh) {
      continue;
    }
    // A valve has one open episode; the older one of two cannot go on.
    OpenEpisode older = episode;
    if (older.detection_stamp_ns > known->second.detection_stamp_ns) {
      std::swap(older, known->second);
    }
    EpisodeTracker tracker(older.valve_id, options_.trace);
    tracker.Recover(older);
    tracker.AbandonRecovery(EndReason::kUnknown, outlet_);
  }
  recovering_ = !recovered_.empty();
  recovery_deadline_ = now + options_.recovery_window;
}

// @returns false if the model set of the valve cannot be had.
bool ValveRegistry::Resolve(const std::string& valve_id,
                            std::optional<EngineParts>& parts) {
  parts.reset();
  try {
    if (const auto models = resolver_->ModelsFor(valve_id)) {
      parts = plans_.For(models);
    }
  } catch (const std::exception& error) {
    counters_.Add(Counter::kModelFailures);
    const std::string reason = error.what();
    log_.Report(
        LogId::kModelFailure, "model_set_unusable",
        [&] { return "valve=" + valve_id + " reason=\"" + reason + "\""; },
        LogLevel::kError);
    return false;
  }
  if (!parts) {
    log_.Report(LogId::kUnassigned, "valve_unassigned",
                [&valve_id] { return "valve=" + valve_id; });
  }
  return true;
}

ValveMonitor& ValveRegistry::At(const ValveDirectory::Entry& valve) {
  if (valve.index >= valves_.size()) {
    valves_.resize(valve.index + 1);
  }
  std::unique_ptr<ValveMonitor>& place = valves_[valve.index];
  if (!place) {
    const std::string& id = *valve.name;
    std::optional<EngineParts> parts;
    Resolve(id, parts);
    const ModelSet* models = parts ? &parts->plan->models() : nullptr;
    log_.Line(LogLevel::kDebug,
              "valve_seen valve=" + id + " model_set=" +
                  (models ? models->name + "@" + std::to_string(models->version)
                          : "none"));
    place = std::make_unique<ValveMonitor>(id, parts, options_.trace);
    if (const auto open = recovered_.find(id); open != recovered_.end()) {
      place->Recover(open->second);
      recovered_.erase(open);
    }
    place->HoldIsolation(resolver_->IsolationHeld(id));
    if (const auto kept = accumulators_.find(id); kept != accumulators_.end()) {
      place->Resume(std::move(kept->second));
      accumulators_.erase(kept);
    }
    const std::lock_guard lock(mutex_);
    names_.push_back(id);
  }
  return *place;
}

ValveOutcome ValveRegistry::Step(const ValveDirectory::Entry& valve,
                                 const Sample& sample, std::uint64_t writer,
                                 TimePoint received) {
  return At(valve).Step(sample, writer, received, outlet_);
}

bool ValveRegistry::EndStream(const ValveDirectory::Entry& valve,
                              std::uint64_t writer) {
  return At(valve).EndStream(writer, outlet_);
}

void ValveRegistry::Reassign(std::shared_ptr<const ModelResolver> resolver) {
  resolver_ = std::move(resolver);
  std::uint64_t swapped = 0;
  std::vector<EngineParts> alive;  // A plan is made once, adopted or not.
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    std::optional<EngineParts> parts;
    // A valve whose new set cannot be had goes on with the one it has.
    if (valve && Resolve(valve->id(), parts) && valve->Adopt(parts, outlet_)) {
      ++swapped;
    }
    if (parts) {
      alive.push_back(*parts);
    }
    if (valve) {
      valve->HoldIsolation(resolver_->IsolationHeld(valve->id()));
    }
  }
  counters_.Add(Counter::kModelSwaps, swapped);
  log_.Line(LogLevel::kInfo,
            "models_reassigned valves_swapped=" + std::to_string(swapped));
}

void ValveRegistry::Tend(TimePoint now, std::int64_t now_ns) {
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    if (!valve) {
      continue;
    }
    if (valve->CheckStale(now)) {
      counters_.Add(Counter::kStaleEvents);
      log_.Report(LogId::kStale, "valve_stale",
                  [&valve] { return "valve=" + valve->id(); });
      if (live_ != nullptr) {
        live_->ShowSilence(valve->id(), Silence::kStale);
      }
    }
    counters_.Add(Quality::kStale, valve->CountStale(now));
    valve->CheckTimeout(now, options_.stale_timeout, outlet_);
  }
  if (recovering_ && now >= recovery_deadline_) {
    recovering_ = false;
    for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
      if (valve) {
        valve->GiveUpRecovery(now_ns, outlet_);
      }
    }
    for (const auto& [id, episode] : recovered_) {
      EpisodeTracker tracker(id, options_.trace);
      tracker.Recover(episode);
      tracker.GiveUpRecovery(now_ns, outlet_);
    }
    recovered_.clear();
  }
  TakeCensus();
}

void ValveRegistry::TakeCensus() {
  ValveCensus census;
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    if (!valve) {
      continue;
    }
    ++census.valves;
    census.unassigned += valve->models() == nullptr ? 1 : 0;
    census.stale += valve->stale() ? 1 : 0;
    census.ended += valve->ended() ? 1 : 0;
    census.open_episodes += valve->episode_open() ? 1 : 0;
    census.trace_bytes += valve->trace_bytes();
  }
  const std::lock_guard lock(mutex_);
  census_ = census;
}

void ValveRegistry::PublishLast(DecisionSink& decisions) const {
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    // No stamp: a model set was adopted since.
    if (valve && valve->seen() && CountsAsTime(valve->verdict()) &&
        valve->verdict().stamp_ns != 0) {
      decisions.PublishLast(valve->id(), valve->models(), valve->verdict());
    }
  }
}

void ValveRegistry::Flush() {
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    if (valve) {
      valve->Flush(outlet_);
    }
  }
}

Checkpoint ValveRegistry::TakeCheckpoint() {
  Checkpoint checkpoint;
  for (const std::unique_ptr<ValveMonitor>& valve : valves_) {
    if (valve) {
      valve->TakeCheckpoint(checkpoint);
    }
  }
  return checkpoint;
}

ValveCensus ValveRegistry::census() const {
  const std::lock_guard lock(mutex_);
  return census_;
}

std::vector<std::string> ValveRegistry::names() const {
  const std::lock_guard lock(mutex_);
  return names_;
}

}  // namespace fdi::monitor
