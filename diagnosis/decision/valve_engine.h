#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "diagnosis/decision/engine_plan.h"
#include "diagnosis/decision/name_beside.h"
#include "diagnosis/model/held_readings.h"
#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// Diagnoses one valve. Pure: the result of Step() depends only on the samples
/// so far; no clock, no I/O, and no allocation after construction but
/// for what a named fault needs (SecondFaultWatch). The monitor and
/// `fdi-trainer evaluate` run this very class.
///
/// Not thread safe: one thread at a time per engine, and for all engines that
/// share EngineParts. Model sets are shared.
class ValveEngine {
 public:
  /// @throws DataError if `models` is not usable (Validate).
  explicit ValveEngine(std::shared_ptr<const ModelSet> models);
  /// For many valves of one model set, which share its parts: they belong to
  /// one thread, all of them.
  explicit ValveEngine(EngineParts parts);
  ~ValveEngine();
  ValveEngine(ValveEngine&&) noexcept;
  ValveEngine& operator=(ValveEngine&&) noexcept;
  ValveEngine(const ValveEngine&) = delete;
  ValveEngine& operator=(const ValveEngine&) = delete;

  /// From the next sample on, values may be wrong by so much, and observers
  /// count as that much less certain.
  void Allow(const Unseen& unseen);

  /// Takes the next sample in order of arrival. The result stands until the
  /// next call.
  const Verdict& Step(const Sample& sample);

  /// Ends an open episode for a reason from outside (stream ended, stale,
  /// ...); the engine settles again. @returns its kClosed transition, or
  /// nothing if no episode was open.
  std::optional<Transition> EndEpisode(EndReason reason);

  /// Continues with another model set from the next sample on; order and
  /// source of the samples stay known. As EndEpisode(kModelChanged).
  std::optional<Transition> Adopt(std::shared_ptr<const ModelSet> models);
  std::optional<Transition> Adopt(EngineParts parts);

  /// While held, episodes are detected and stay unknown: for a valve whose
  /// baseline is not trusted. Stays over Adopt().
  void HoldIsolation(bool hold);

  /// See SourceOrder::ForgetSuperseded().
  void ForgetSuperseded();

  /// Sets whether information from outside the engine calls the valve abnormal.
  /// While it does, a valve that is judged has an episode, which does
  /// not clear. Ends with EndEpisode() and Adopt().
  void Suspect(bool suspected);

  /// Takes the name of the open episode if it is not the engine's own, as the
  /// basis on which a second fault is sought (SecondFaultWatch).
  void TakeName(const NameBeside& name);

  /// The slow accumulators, for Restore() after a restart of the program:
  /// windows of detection, whether the valve is armed (Coverage), and which
  /// channels are doubted (LoneReadings), with the
  /// stamp of the last sample and the content hash of the model set. An open
  /// episode is not among them.
  std::vector<std::byte> Save() const;

  /// Goes on with what Save() gave, if the next sample that reaches the
  /// observers is at most 10 minutes younger; otherwise it counts for nothing.
  /// @returns false and changes nothing if the bytes are damaged, of another
  ///   format or of another model set.
  bool Restore(std::span<const std::byte> bytes);

  /// The last sample as the observers took it: readings that were wrong or
  /// unusable by themselves, and stand there no more, are UNCERTAIN. Null if it
  /// did not reach them. Until the next call.
  const Sample* judged() const;

  /// The result of the last Step().
  const Verdict& verdict() const;
  const ModelSet& models() const;
  bool episode_open() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace fdi
