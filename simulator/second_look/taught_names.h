#pragma once

#include <algorithm>
#include <iterator>
#include <optional>
#include <vector>

#include "diagnosis/model/taught.h"
#include "diagnosis/model/verdict.h"
#include "simulator/second_look/episode_looks.h"

namespace fdi::simulator {

/// NamesOf() beside what the observers say: a fault that they know from this
/// very valve (TaughtOnly()) stands for the set of which it is one, and for no
/// name at all. Where the physics names others, it is not heard.
inline std::optional<std::vector<int>> NamesBeside(const Verdict& engine,
                                                   const ModelSet& models,
                                                   const LookAnswer& answer) {
  auto names = NamesOf(answer, ObserversName(models, engine.isolated));
  const FaultSet taught = TaughtOnly(models, engine.isolated, engine.strengths);
  if (!names || taught == 0) {
    return names;
  }
  if (names->empty()) {
    return std::nullopt;
  }
  std::vector<int> both;
  std::ranges::copy_if(*names, std::back_inserter(both), [&](int fault) {
    const int bit = FaultIndex(models, fault);
    return bit >= 0 && Has(taught, static_cast<std::size_t>(bit));
  });
  return both.empty() ? names : std::optional(both);
}

}  // namespace fdi::simulator
