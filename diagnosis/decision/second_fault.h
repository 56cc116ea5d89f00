#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "diagnosis/decision/engine_plan.h"
#include "diagnosis/decision/episode.h"
#include "diagnosis/decision/name_beside.h"
#include "diagnosis/decision/standing_fault.h"
#include "diagnosis/model/verdict.h"

namespace fdi {

/// Finds a second fault on top of the one that an open episode is named after.
///
/// 1. Watching: the fault at its strength is part of the expected values. Once
///    the residuals have long been inside the limits of normal operation, the
///    fault is settled. If a simulation names several faults, each is watched
///    separately: the standing one is the likeliest of those settled, and
///    another one may take its place without a new start.
/// 2. In doubt: the limits are exceeded, as a detection asks for. The name is
///    held. Pairs of the settled fault and another one compete with every
///    single fault at every strength, both on the evidence from here on.
/// 3. Open: no single fault fits, and a pair does or none does either.
///
/// A set that does not judge the fit (FitBounds) never has a second fault.
/// Memory is allocated with a name, most of it once that has stayed for
/// some time, and freed with the episode.
class SecondFaultWatch {
 public:
  SecondFaultWatch(std::shared_ptr<const EnginePlan> plan,
                   InstructionSet instructions);
  ~SecondFaultWatch();
  SecondFaultWatch(SecondFaultWatch&&) noexcept;
  SecondFaultWatch& operator=(SecondFaultWatch&&) noexcept;

  /// There is no episode, or it is not judged by the observers.
  void Restart();

  /// Samples are missing.
  void Interrupt();

  /// The next judged sample of an open episode, before Episode::Step().
  void Judge(const Sample& sample, const ObserverBank& bank);

  /// Tells how Episode::Step() has to take this sample.
  Episode::NameHold hold() const;
  /// The first fault is gone and the second one is left: the episode is over.
  bool outlived() const { return outlived_; }

  /// The same sample, after Episode::Step().
  void Follow(const Episode& episode, const NameBeside& beside,
              Verdict& verdict);

 private:
  enum class Phase : std::uint8_t { kNone, kWatching, kDoubt, kOpen };
  struct Member;
  struct Rivals;

  FaultSet NameOf(const NameBeside& beside, const Verdict& verdict) const;
  FaultSet members() const;
  Member& MemberAt(const FaultBank::Leader& leader);
  // The faults of the name, likeliest first; then null.
  using Likeliest = std::array<Member*, NameBeside::kMost>;
  Likeliest Present(const Episode& episode, const NameBeside& beside);
  void Begin();
  void Watch(Member& member, bool fits);
  void Compete(const Sample& sample, const ObserverBank& bank);
  void Balance();
  void Decide();
  double Handicap(bool own) const;
  bool IsPair(const FaultBank::Leader& pair) const;
  void WatchOn();
  void GiveUp();
  FaultSet Likely() const;
  void Write(Verdict& verdict) const;

  std::shared_ptr<const EnginePlan> plan_;
  InstructionSet instructions_;
  FaultSet known_{0};  // faults that some observer knows
  std::unique_ptr<Rivals> rivals_;
  Phase phase_{Phase::kNone};
  FaultSet name_{0};
  std::vector<std::unique_ptr<Member>> members_;  // of the name, now or before
  Member* standing_{nullptr};                     // one of them
  int age_{0};      // samples since the doubt began
  int decided_{0};  // samples in a row that one fault explains
  int paired_{0};   // samples in a row that only a pair does
  bool outlived_{false};
  std::int64_t stamp_ns_{0};  // of the detection of the second fault
};

}  // namespace fdi
