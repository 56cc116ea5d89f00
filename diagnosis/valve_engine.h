#pragma once

#include <memory>
#include <optional>

#include "diagnosis/model_set.h"
#include "diagnosis/sample.h"
#include "diagnosis/verdict.h"

namespace fdi {

/// Diagnoses one valve. Pure: what Step() returns depends on the samples given
/// so far alone; no clock, no I/O, no allocation after construction. The
/// monitor and `fdi-trainer evaluate` run this very class.
///
/// Not thread safe: one thread at a time per engine. Model sets are shared.
class ValveEngine {
 public:
  /// @throws DataError if `models` is not usable (Validate).
  explicit ValveEngine(std::shared_ptr<const ModelSet> models);
  ~ValveEngine();
  ValveEngine(ValveEngine&&) noexcept;
  ValveEngine& operator=(ValveEngine&&) noexcept;
  ValveEngine(const ValveEngine&) = delete;
  ValveEngine& operator=(const ValveEngine&) = delete;

  /// Takes the next sample in order of arrival. The result stands until the
  /// next call.
  const Verdict& Step(const Sample& sample);

  /// Ends an open episode for a reason from outside (stream ended, stale,
  /// ...); the engine settles anew. @returns its kClosed transition, or
  /// nothing if no episode was open.
  std::optional<Transition> EndEpisode(EndReason reason);

  /// Continues with another model set from the next sample on; order and
  /// source of the samples stay known. As EndEpisode(kModelChanged).
  std::optional<Transition> Adopt(std::shared_ptr<const ModelSet> models);

  const ModelSet& models() const;
  bool episode_open() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi
