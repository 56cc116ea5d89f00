#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "diagnosis/model/model_set.h"

namespace fdi {

/// Numbers of four observers, or of four rules, side by side, for one vector
/// instruction.
struct alignas(32) Quad {
  std::array<double, 4> lane{};
};
inline constexpr std::size_t kLanes = 4;

/// FuzzySet of four lanes on one regressor.
struct QuadSet {
  Quad left_center;
  Quad right_center;
  Quad left_width;
  Quad right_width;
};

/// The inputs to the exponents of four lanes. Sets that are 1 everywhere in all
/// lanes are omitted.
struct QuadPremise {
  Quad start;  ///< 0; −∞ in a lane without a rule.
  Quad least;  ///< Lower bound of the exponent.
  std::size_t first_set{0};
  std::size_t set_count{0};
  std::size_t first_nearness{0};  ///< v, then the rows of L.
  std::size_t nearness_rows{0};
};

/// Where a regressor is read from.
struct RegressorSource {
  bool own{false};  ///< From the model's predictions, not the readings.
  std::size_t signal{0};
  int lag{0};
};

/// Observers of one channel with the same regressors, evaluated four at a time.
/// If they also have the same antecedents, their rules are weighted once for
/// all, four rules at a time.
struct ObserverGroup {
  std::size_t channel{0};
  bool difference{false};
  bool shared{false};  ///< One premise for all observers.
  std::vector<RegressorSource> regressors;
  std::size_t first_block{0};
  std::size_t blocks{0};
  bool free_running{false};
  std::size_t own_block{0};  ///< First of its own past, if it runs on itself.
  /// Rules of each block of observers; the same in all if shared.
  std::vector<std::size_t> rules;
  std::vector<std::size_t> first_premise;     ///< By block; 0 if shared.
  std::vector<std::size_t> first_consequent;  ///< By block.
  std::vector<QuadPremise>
      premises;  ///< By four rules if shared, else by rule.
  std::vector<QuadSet> sets;
  std::vector<std::size_t> set_regressors;  ///< One per set.
  std::vector<Quad> nearness;
  std::vector<Quad> consequents;  ///< By rule: b, then a.
  std::vector<Quad> minimum;      ///< By regressor, or block and regressor.
  std::vector<Quad> maximum;
};

/// Parameters of four observers of one channel, side by side in a block.
struct ObserverBlock {
  Quad output_min;
  Quad output_max;
  Quad saturation;
  Quad a;  ///< Corners of the membership.
  Quad b;
  Quad c;
  Quad d;
  Quad rise;  ///< b − a
  Quad fall;  ///< d − c
  Quad sd;    ///< Deviation of the residual.
  Quad variance;
  Quad log_variance;
};

/// ObserverBank's data derived from a model set, in order of access; shared by
/// all valves. Every observer and channel has a slot; the slots of a group are
/// contiguous in blocks of four.
class ObserverPlan {
 public:
  /// `models` must be valid and outlive the plan.
  explicit ObserverPlan(const ModelSet& models);

  const ModelSet& models() const { return *models_; }
  const std::vector<ObserverGroup>& groups() const { return groups_; }
  const std::vector<ObserverBlock>& blocks() const { return blocks_; }
  /// Longest lag + 1.
  int depth() const { return depth_; }
  std::size_t own_blocks() const { return own_blocks_; }
  /// First block of channel c; for c one past the last, the number of blocks.
  std::size_t first_block(std::size_t c) const { return first_blocks_[c]; }
  std::size_t slot(std::size_t observer, std::size_t channel) const {
    return slots_[observer * channels_ + channel];
  }
  /// True if the slots of channel c have the same order as the observers.
  bool in_order(std::size_t c) const { return in_order_[c] != 0; }
  /// The signals needed for channel c, including its output.
  SignalMask signals(std::size_t c) const { return signals_[c]; }

 private:
  using Members = std::vector<std::size_t>;  // observers

  const ChannelObserver& At(std::size_t observer, std::size_t channel) const {
    return models_->observers[observer].channels[channel];
  }
  void AddChannel(std::size_t channel);
  void AddGroup(std::size_t channel, const Members& members, bool shared);
  void AddSlots(const ObserverGroup& group, const Members& members);

  const ModelSet* models_;
  std::size_t channels_;
  int depth_{1};
  std::size_t own_blocks_{0};
  std::vector<std::size_t> slots_;
  std::vector<std::size_t> first_blocks_;
  std::vector<SignalMask> signals_;
  std::vector<char> in_order_;
  std::vector<ObserverGroup> groups_;
  std::vector<ObserverBlock> blocks_;
};

}  // namespace fdi
