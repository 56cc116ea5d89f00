#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/snapshot.h"
#include "diagnosis/model/verdict.h"
#include "diagnosis/observers/residual_windows.h"

namespace fdi {

/// Mean residuals in blocks of half an hour over a day, and of fifteen hours
/// over a month.
class SlowMemory {
 public:
  SlowMemory() = default;
  explicit SlowMemory(double period_s);

  void Restart();
  /// @returns true where a block has ended.
  bool Push(double residual);

  /// The line through the shortest span that has one: its slope is significant,
  /// leads away from zero to `least` or more, and it leaves less than the best
  /// single step does. Nothing with less than three hours.
  std::optional<SlowDrift> Line(double least) const;

  void Save(SnapshotWriter& writer) const;
  bool Restore(SnapshotReader& reader);

 private:
  static constexpr std::size_t kBlocks = 48;
  struct Span {
    double hours{0.0};                    // of a block
    std::int64_t length{1};               // the same [samples]
    std::int64_t count{0};                // samples in the block that has begun
    double sum{0.0};                      // of them
    std::uint64_t filled{0};              // blocks
    std::array<double, kBlocks> means{};  // the oldest first
  };

  std::array<Span, 2> spans_{};
};

/// Appends the finding to the faults, behind those of the floor, where it can
/// be judged: with a floor and an X that is predicted, and with strengths
/// between those that were trained.
void AddDriftFinding(ModelSet& models);

/// Tells a slow drift of X from a fault (finding kPositionDrift).
///
/// By its form it can be a fault of the actuator or the transmitter, so what
/// counts is how it came and how far: X alone deviates when it is detected, it
/// had grown over hours before, and no fault of medium size is left to explain
/// it. Then the drift is reported, and no fault is named. Growth over hours
/// that exceeds no limit yet is reported, too.
class DriftWatch {
 public:
  /// `models` must outlive it. It watches sets that list the finding.
  explicit DriftWatch(const ModelSet& models);
  bool watches() const { return watches_; }

  /// Forgets all earlier samples.
  void Restart();

  /// A judged sample.
  /// @param beyond channels beyond a limit, by bit.
  void Push(const Verdict& verdict, std::uint32_t beyond);

  /// This sample opens an episode.
  void Begin(std::uint32_t beyond);
  /// Without an episode: whether X has drifted, so that this sample opens one.
  bool Emerges();
  /// X is still off by at least half of what it drifted.
  bool present() const;
  /// The episode after that sample; none: it ends.
  void Follow(const Verdict& verdict);

  /// The open episode is a drift.
  const std::optional<SlowDrift>& drift() const { return drift_; }

  void Save(SnapshotWriter& writer) const { memory_.Save(writer); }
  bool Restore(SnapshotReader& reader);

 private:
  bool Alone(std::uint32_t beyond) const { return (beyond & ~follow_) == 0; }
  bool OnTop() const;
  void Take();
  void Judge(std::uint32_t beyond);

  const ModelSet* models_;
  std::size_t channel_{0};  // of X
  bool watches_{false};
  std::uint32_t follow_{0};  // channels that move with X
  FaultSet faults_{0};       // that a drift may be taken for
  double least_{0.0};        // drift [%]
  SlowMemory memory_;
  ResidualWindow recent_;
  bool ended_{false};              // a block, with this sample
  std::optional<SlowDrift> line_;  // at the last such end
  std::optional<SlowDrift> drift_;
  int against_{0};     // samples that speak against a drift
  int age_{0};         // samples since the detection
  double share_{0.0};  // of which left a fault of medium size
};

}  // namespace fdi
