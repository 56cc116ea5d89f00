#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "diagnosis/model/snapshot.h"
#include "diagnosis/observers/observer_bank.h"

namespace fdi {

/// Holds out single wrong readings, as loose wires and lost telegrams make
/// them. A reading is held out where the residual of the normal observer passes
/// a bound that it did not pass at the reading before, and has changed by more
/// than that bound since then; a fault that hovers about a bound is not held
/// out. The bound is the threshold of the channel, or less where few readings
/// could bring a window of residuals beyond its limits; there the reading
/// itself has to jump, and no other signal may be out of line. The reading then
/// counts as UNCERTAIN, with the last value in its place, and the next one
/// decides:
///
///  1. The next one passes that bound, too: the step was real. The past of
///     the observers gets the reading back, and nothing more is held out.
///     Windows and evidence begin one sample later than without this class.
///  2. It does not, or cannot be used: the reading stays out of the past of the
///     observers, their windows, and the floor.
///
/// Detection counts the residual() of a held-out reading against the threshold,
/// for n_d samples in a row, so an abrupt fault is detected as soon as ever.
///
/// A channel that has had a wrong reading within a day has a loose wire, which
/// may make two in a row. There a second reading is held out, too, and the
/// third decides; the first one does not count, so detection waits for the
/// third.
///
/// Wrong readings are taken to be rare: a channel that has had more of them of
/// late than kBurst passes all on, as it is its noise that has changed.
class LoneReadings {
 public:
  /// Twenty wrong readings an hour, at a sample a second, hardly ever (Poisson:
  /// less than once a day) leave more than five within two and a half minutes.
  static constexpr double kBurst = 5.0;
  static constexpr double kRecovery = 1.0 / 30.0;  // readings per sample

  /// `models` must outlive it.
  explicit LoneReadings(const ModelSet& models);

  /// After the bank was initialised: there is no reading before.
  void Restart();

  /// Saves which channels are doubted, and until when.
  void Save(SnapshotWriter& writer) const;
  /// @returns false, leaving it undefined, if there is nothing to be read.
  bool Restore(SnapshotReader& reader);

  /// The last sample as it was judged.
  const Sample& judged() const { return judged_; }

  /// Steps `bank` by `sample`, without the readings that are held out.
  /// @returns the sample as it is to be judged; valid until the next call.
  const Sample& Step(ObserverBank& bank, const Sample& sample);

  /// Signals of which the last sample has shown the reading before it to be
  /// wrong.
  SignalMask wrong() const { return wrong_; }

  /// True if a reading of the last sample is held out.
  bool holds() const { return held_ != 0; }
  /// By channel, the residual of the reading that is held out and counts; else
  /// NaN.
  std::span<const double> residuals() const { return residuals_; }

 private:
  /// Two bits by channel: below, above.
  using Sides = std::uint32_t;

  struct HeldOut {
    Sample original;
    Sample judged;
  };
  static constexpr std::size_t kMostHeldOut = 2;  // in a row

  struct Bounds {  // on a residual that one reading may make
    double lower{0.0};
    double upper{0.0};
  };

  static Bounds BoundsOf(const ChannelSpec& channel);
  static Sides SidesBeyond(const Bounds& bounds, double residual);
  void Read(const ObserverBank& bank);
  Sides Beyond() const;
  Sides Jumped(const Sample& sample) const;
  bool IsSupported(std::size_t channel) const;
  Sides Unread() const;
  Sides Confirmed(Sides held, std::int64_t stamp_ns);
  SignalMask WrongIn(Sides refuted) const;
  Sides TakeRare(Sides lone);
  bool Doubted(Sides sides, std::int64_t stamp_ns) const;
  void Judge(ObserverBank& bank, const Sample& sample, bool real);
  void HoldOut(ObserverBank& bank, const Sample& sample, Sides lone,
               Sides again);

  const ModelSet* models_;
  std::array<SignalMask, kMaxChannels> doubtful_{};  // if the channel is lone
  /// Channels of other signals that do not read the channel's, by bit.
  std::array<std::uint32_t, kMaxChannels> independent_{};
  std::array<Bounds, kMaxChannels> bounds_{};
  Sample judged_;
  std::size_t held_count_{0};  // of last_held_, in a row
  Sides beyond_{0};            // at the last reading of each channel
  Sides held_{0};
  SignalMask wrong_{0};
  bool has_past_{false};
  std::array<double, kMaxChannels> residuals_;
  std::array<double, kMaxChannels> now_{};   // NaN: not read
  std::array<double, kMaxChannels> last_{};  // that was read
  std::array<double, kMaxChannels> load_{};  // readings held out of late
  std::array<std::int64_t, kMaxChannels> doubted_until_ns_;
  // Newest first. Last, since other members are read at each sample.
  std::array<HeldOut, kMostHeldOut> last_held_;
};

}  // namespace fdi
