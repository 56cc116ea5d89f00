#include "monitor/shadow_bank.h"

#include <utility>

namespace fdi::monitor {

ShadowBank::ShadowBank(ShadowOptions options, ThrottledLog& log)
    : options_(std::move(options)), log_(log), parts_(options_.candidate) {}

void ShadowBank::Restore(std::vector<Accumulator> accumulators) {
  for (Accumulator& accumulator : accumulators) {
    if (accumulator.model_hash == candidate().content_hash) {
      saved_[accumulator.valve_id] = std::move(accumulator);
    }
  }
}

ShadowBank::Valve& ShadowBank::At(const ValveDirectory::Entry& entry) {
  if (entry.index >= valves_.size()) {
    valves_.resize(entry.index + 1);
  }
  Valve& valve = valves_[entry.index];
  if (!valve.listed) {
    valve.listed = true;
    valve.chosen = GlobMatches(options_.valve_glob, *entry.name);
    if (valve.chosen) {
      valve.shadow =
          std::make_unique<ShadowValve>(*entry.name, parts_, options_.limits);
      const auto saved = saved_.find(*entry.name);
      if (saved != saved_.end()) {
        valve.shadow->Resume(std::move(saved->second));
        saved_.erase(saved);
      }
      ++counts_.valves[static_cast<std::size_t>(valve.fit)];
    }
  }
  return valve;
}

void ShadowBank::Step(const ValveDirectory::Entry& entry, const Sample& sample,
                      const ValveOutcome& active) {
  Valve& valve = At(entry);
  if (!valve.chosen) {
    return;
  }
  const std::uint64_t recorded = valve.shadow->recorded();
  const std::uint64_t left_out = valve.shadow->left_out();
  const auto outcome = valve.shadow->Step(sample, active);
  if (outcome) {
    ++counts_.samples[static_cast<std::size_t>(*outcome)];
  }
  counts_.recorded += valve.shadow->recorded() - recorded;
  counts_.left_out += valve.shadow->left_out() - left_out;
  if (valve.shadow->fit() != valve.fit) {
    NoteFit(*entry.name, valve);
  }
}

void ShadowBank::NoteFit(const std::string& valve_id, Valve& valve) {
  --counts_.valves[static_cast<std::size_t>(valve.fit)];
  valve.fit = valve.shadow->fit();
  ++counts_.valves[static_cast<std::size_t>(valve.fit)];
  if (valve.fit != ShadowFit::kCompared) {
    log_.Report(LogId::kShadow, "shadow_not_compared", [&] {
      return "valve=" + valve_id +
             " reason=" + std::string(ShadowFitName(valve.fit)) +
             " candidate=" + candidate().name + "@" +
             std::to_string(candidate().version);
    });
  }
}

void ShadowBank::EndStream(const ValveDirectory::Entry& entry) {
  Valve& valve = At(entry);
  if (valve.chosen) {
    valve.shadow->EndStream();
  }
}

void ShadowBank::TakeTo(Checkpoint& checkpoint) {
  for (Valve& valve : valves_) {
    if (valve.chosen) {
      valve.shadow->TakeTo(checkpoint);
    }
  }
}

}  // namespace fdi::monitor
