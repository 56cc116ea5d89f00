#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// The rules by which an episode gets, keeps and loses its name, in the order
/// in which they act. Each later one may override what the earlier ones made of
/// the same sample. To add a rule: a row here, its case where its stage runs,
/// the test that fails without it, its row in docs/method.md, and the row of
/// docs/results/ablation.md that shows what it buys.
namespace fdi {

/// In the order in which they act, as kRules has them.
enum class Rule : std::uint8_t {
  kTrackedStrength,
  kTrainedStrengths,
  kAllowance,
  kShortMemory,
  kOnset,
  kApart,
  kFitVariance,
  kFitLimits,
  kAccounted,
  kInputsOdd,
  kInputsMoved,
  kMemberships,
  kTolerates,
  kEvidence,
  kSupport,
  kMisfits,
  kSecondHolds,
  kWithdraw,
  kMisfitIsNoName,
  kRecognise,
  kHeld,
  kDrift,
  kNormalGate,
  kProven,
  kNothingSupported,
  kFourAtMost,
  kLasting,
  kLossBeside,
  kFirstName,
  kReisolation,
  kMisfitsAreNoCandidates,
  kUnknown,
  kFloorNames,
  kForgetFindings,
  kCleared,
  kSecondStands,
  kLook,
  kInherited,
  kObservers,
};

/// Where a rule runs; the stages follow each other.
enum class Stage : std::uint8_t {
  kEvidence,  ///< FaultBank, StrengthTracker: how good an explanation is.
  kFit,       ///< StrengthTracker::PushFit(): does it look like the fault.
  kFactors,   ///< FaultBank::ApplyEvidence(): what caps a decision factor.
  kName,      ///< Once the observers have settled, until a rule says that no
              ///< further one acts.
  kJudge,     ///< Once they have settled.
  kFloor,     ///< Before the observers have settled, too.
  kEnd,       ///< Once they have settled.
  kSource,    ///< EpisodeName::Choose(): the first that speaks is the name.
};

struct RuleRow {
  Rule rule;
  Stage stage;
  /// In `fdi-study ablate` and its table. Empty: without it there is no name at
  /// all, so that nothing is learnt by leaving it out.
  std::string_view name;
  std::string_view may;        ///< The change it may make.
  std::string_view overrides;  ///< Decisions over which it has precedence.
  std::string_view constants;  ///< Each with where its value comes from.
  std::string_view test;       ///< Fails without it.
};

// In "constants": `campaign` is a value of DecisionParameters, which a campaign
// or a preset sets; `hand` is one that was chosen by looking at runs.
inline constexpr auto kRules = std::to_array<RuleRow>({
    {Rule::kTrackedStrength, Stage::kEvidence, "tracked_strength",
     "a strength between two trained ones explains, too", "-",
     "40 samples of grid search, 33 cells: hand; rate 1/1500: full strength "
     "in ten minutes",
     "ValveEngineTest.LookAlikesSeparateWhileTheValveMoves"},
    {Rule::kTrainedStrengths, Stage::kEvidence, "trained_strengths",
     "a fault has the evidence of its best observer", "tracked_strength", "-",
     "EpisodeTest.InALongEpisodeWhatIsAheadForAWhileDoesNotReplaceTheName"},
    {Rule::kAllowance, Stage::kEvidence, "allowance",
     "caps nothing that only an error of interpolation refutes", "evidence",
     "interpolation_allowance .04: fifteen ramps of other seeds",
     "FaultBankTest.ErrorsOfInterpolationDoNotAddUpToAVerdict"},
    {Rule::kShortMemory, Stage::kEvidence, "short_memory",
     "what was refuted long ago may be true again", "evidence",
     "4 supports, 2 beyond the allowance: hand",
     "FitWindowTest.AFaultThatHasGoneKeepsItsName"},
    {Rule::kOnset, Stage::kFit, "onset",
     "while an input shows the fault, its effect may be off by half",
     "fit_limits", ".5: hand", "RulesTest.AFaultThatAnInputShowsMayBeOnItsWay"},
    {Rule::kApart, Stage::kFit, "apart",
     "no error of interpolation where normal operation is nearer", "fit_limits",
     "-", "FaultBankTest.AnErrorOfInterpolationExcusesNoEffectThatIsNotThere"},
    {Rule::kFitVariance, Stage::kFit, "fit_variance",
     "extrapolation excuses no more than so much", "fit_limits",
     "10 variances: hand",
     "RulesTest.WhatIsFarFromWhereItWasTrainedDoesNotFit"},
    {Rule::kFitLimits, Stage::kFit, "fit_limits",
     "a fault whose residuals are not like its own data is a misfit", "-",
     "FitBounds: training; t_k: campaign",
     "FitWindowTest.AFaultThatIsBestButDoesNotFitIsNotNamed"},
    {Rule::kAccounted, Stage::kFit, "accounted",
     "a fault that leaves most of what it ought to explain is a misfit", "-",
     "share .5, telling 3 variances: hand",
     "RulesTest.WhatLeavesMostOfWhatItOughtToExplainIsNoName"},
    {Rule::kInputsOdd, Stage::kFit, "inputs_odd",
     "where P1, P2 or T1 is odd, only what acts on it fits", "-",
     "half of t_k: hand",
     "FitWindowTest.AnInputThatHasMovedNamesTheFaultThatAlwaysMovesIt"},
    {Rule::kInputsMoved, Stage::kFit, "inputs_moved",
     "a fault that always moves an input does not fit where that is as usual",
     "-", "half of t_k: hand",
     "FitWindowTest.AFaultThatMovesAnInputIsNotNamedWhereTheInputIsAsUsual"},
    {Rule::kMemberships, Stage::kFactors, "memberships",
     "caps a fault by the residuals of this sample", "-",
     "trapezoids: training",
     "ValveEngineTest.FaultThatMatchesNoObserverStaysUnknown"},
    {Rule::kTolerates, Stage::kFactors, "tolerates",
     "caps what only tolerates what is seen at (1 + T)/2: it is not sure", "-",
     "half of the largest: hand",
     "ValveEngineTest.AFaultThatOnlyToleratesWhatIsSeenIsNeverSure"},
    {Rule::kEvidence, Stage::kFactors, "evidence",
     "caps a fault by how far it is behind the best", "-",
     "core, support, memory: campaign",
     "FaultBankTest.ErrorsOfInterpolationDoNotAddUpToAVerdict"},
    {Rule::kSupport, Stage::kName, "", "joins what equation (6) supports", "-",
     "T, t_k, fractions: campaign", "IsolationWindowTest.NeedsTkSamples"},
    {Rule::kMisfits, Stage::kName, "misfits",
     "refutes what has not fitted for long", "-",
     "weight 2, 1.5 t_k: own seeds, a single disturbance refutes nothing",
     "FitWindowTest.AFaultThatFitsNowAndThenIsNotNamedAgain"},
    {Rule::kSecondHolds, Stage::kName, "second",
     "blocks every change while something may be on top", "all below", "-",
     "SecondFaultTest.ASecondFaultGetsItsOwnNameAndTheFirstKeepsIts"},
    {Rule::kWithdraw, Stage::kName, "withdraw",
     "takes back the name of one fault once that is refuted", "the name", "-",
     "FitWindowTest.ANameThatFitsNoMoreIsTakenBack"},
    {Rule::kMisfitIsNoName, Stage::kName, "misfit_is_no_name",
     "blocks a set of which nothing fits", "-", "-",
     "FitWindowTest.AFaultThatIsBestButDoesNotFitIsNotNamed"},
    {Rule::kRecognise, Stage::kName, "recognise",
     "a taught observer that explains stands for the set, and alone",
     "misfit_is_no_name", "core, support: campaign",
     "RulesTest.WhatHasHappenedOnThisValveStandsForItsLookAlikes"},
    {Rule::kHeld, Stage::kName, "", "blocks while a person holds it",
     "all below", "-", "ValveEngineTest.HeldIsolationNamesNothing"},
    {Rule::kDrift, Stage::kName, "drift",
     "a drift of X opens an episode, holds it open, and blocks while it "
     "explains it",
     "all below", "3 h, 99.9 %, a quarter of a deviation: healthy days",
     "DriftOfAValveTest.ItIsSaidUntilItIsAsLargeAsAFault"},
    {Rule::kNormalGate, Stage::kName, "normal_gate",
     "blocks while normal operation explains it", "all below", "T: campaign",
     "EpisodeTest.AnotherSetHasToHoldWithoutTheValveLookingNormal"},
    {Rule::kProven, Stage::kName, "proven",
     "joins before t_k what alone is not refuted", "the name",
     "early_error: campaign; n_d + 1 samples: models err in the first",
     "ValveEngineTest.WhatIsNotRefutedIsNamedOnceAllOthersAre"},
    {Rule::kNothingSupported, Stage::kName, "",
     "without a supported set nothing below acts", "all below", "-", ""},
    {Rule::kFourAtMost, Stage::kName, "four_at_most", "a set of more is none",
     "all above", "4: a shortlist for a person",
     "FloorTest.MoreThanFourFaultsAreNoName"},
    {Rule::kLasting, Stage::kName, "lasting",
     "after a day a fault joins and leaves by its share of the episode",
     "all above", "a day, 4 memories, 1/2, 1/4, 2 memories: ramps of 7 days",
     "EpisodeTest.InALongEpisodeWhatIsAheadForAWhileDoesNotReplaceTheName"},
    {Rule::kLossBeside, Stage::kName, "loss_beside",
     "joins a lost flow to a fault of valve or sensor, but to one that was the "
     "name long before",
     "lasting", "half a memory: hand",
     "FloorTest.LostFlowIsNeverAFaultOfTheValveAlone"},
    {Rule::kFirstName, Stage::kName, "",
     "says the first supported set at once, also in place of an early name",
     "reisolation", "-", ""},
    {Rule::kReisolation, Stage::kName, "reisolation",
     "another set has to hold before it is the name", "-",
     "reisolation_samples: campaign",
     "EpisodeTest.AnotherSetHasToHoldWithoutTheValveLookingNormal"},
    {Rule::kMisfitsAreNoCandidates, Stage::kJudge, "misfits_are_no_candidates",
     "caps what does not fit at T/4, without a name", "-", "1/4: hand",
     "FitWindowTest.AFaultThatIsBestButDoesNotFitIsNotNamed"},
    {Rule::kUnknown, Stage::kJudge, "", "says why there is no name", "-",
     "t_k: campaign",
     "ValveEngineTest.UnknownIsOutsideWhatIsKnownOnceNothingExplainsIt"},
    {Rule::kFloorNames, Stage::kFloor, "floor_names",
     "says what the floor found, without a fault", "-", "-",
     "FloorTest.OpensAnEpisodeBeforeTheObserversMay"},
    {Rule::kForgetFindings, Stage::kFloor, "forget_findings",
     "a finding that is over leaves the episode and the name", "floor_names",
     "1.5 t_k, twice as long each time: hand",
     "EpisodeTest.AFindingThatIsOverIsNotTheNameOfWhatGoesOn"},
    {Rule::kCleared, Stage::kEnd, "", "ends the episode", "all above",
     "t_c: campaign; mean .3 of a threshold: hand",
     "ClearingWindowTest.ClearsAfterTcQuietSamples"},
    {Rule::kSecondStands, Stage::kSource, "",
     "the name stays while something is on top of it", "all below", "-",
     "EpisodeNameTest.ASecondFaultIsAnnouncedAndNoLookAtBothRenames"},
    {Rule::kLook, Stage::kSource, "", "says what a look found", "all below",
     "-", "EpisodeNameTest.ALookOutranksTheObserversToTheEnd"},
    {Rule::kInherited, Stage::kSource, "inherited",
     "says what the session before said; two faults are not renamed as a third",
     "look, observers", "ten minutes: five looks",
     "EpisodeNameTest.AnInheritedNameStandsUntilTheObserversNameAFault"},
    {Rule::kObservers, Stage::kSource, "", "says what the observers say", "-",
     "-", "EpisodeNameTest.TheFloorNamesItUntilTheObserversDo"},
});

static_assert(
    [] {
      for (std::size_t i = 0; i < kRules.size(); ++i) {
        if (static_cast<std::size_t>(kRules[i].rule) != i) {
          return false;
        }
      }
      return kRules.back().rule == Rule::kObservers;
    }(),
    "every rule has one row, in the order of Rule");

/// The rules of a stage in the order of the table.
template <Stage kStage>
inline constexpr auto kRulesOf = [] {
  std::array<Rule, std::ranges::count(kRules, kStage, &RuleRow::stage)> rules{};
  std::size_t next = 0;
  for (const RuleRow& row : kRules) {
    if (row.stage == kStage) {
      rules[next++] = row.rule;
    }
  }
  return rules;
}();

#ifdef FDI_RULE_SWITCHES
// Only the study is built with it: an installed program cannot leave out a
// rule.
inline namespace switched {
/// The rules that are left out, by bit. Set before any engine runs.
inline constinit std::uint64_t rules_off = 0;
inline bool Acts(Rule rule) {
  return (rules_off >> static_cast<unsigned>(rule) & 1U) == 0;
}
}  // namespace switched
#else
constexpr bool Acts(Rule /*rule*/) {
  return true;
}
#endif

}  // namespace fdi
