#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "diagnosis/model/model_set.h"
#include "diagnosis/model/sample.h"
#include "trainer/dataset.h"
#include "trainer/difference_observers.h"

namespace fdi::trainer {

/// Detection and isolation of one fault in one direction by model sets.
struct FaultCoverage {
  int fault{0};
  bool negative{false};
  /// Smallest |strength| that is detected, as are all greater ones tried.
  std::optional<double> detectable{};
  /// Smallest |strength| from which on the fault stands in a final set of at
  /// most two.
  std::optional<double> isolable{};
  std::vector<int> look_alikes{};  ///< Beside it in some final set, or instead.
};

struct CoverageTable {
  SignalMask signals{0};
  double seconds{0.0};  ///< That a fault was given to show.
  std::vector<FaultCoverage> faults;
  int parts{1};    ///< Healthy parts that faults were put onto.
  int alarmed{0};  ///< Parts that have an alarm without a fault.
  /// Share of them that was within what the models know: the least of a part.
  double judged{1.0};
};

/// A part of a healthy record, what faults make of it, and who is to judge it.
struct ScoredPart {
  std::shared_ptr<const ModelSet> models;
  Stretch healthy;
  std::vector<std::vector<Sample>> faulty;  ///< By fault.
};

/// Scores every fault on every part: 120 healthy samples, then the fault. The
/// engine decides as in service. The strengths are those of the observers:
/// between them and beyond it is interpolation. A fault is detected or named if
/// it is so in every part, and where a part has an alarm without a fault, only
/// what is detected before it counts.
///
/// @param parts at least one.
CoverageTable ScoreCoverage(const std::vector<FaultCondition>& faults,
                            const std::vector<ScoredPart>& parts, int threads);

/// The same for one set on the last 17 minutes of `healthy`.
CoverageTable AssessCoverage(std::shared_ptr<const ModelSet> models,
                             const std::vector<FaultCondition>& faults,
                             const FaultSynthesis& synthesize,
                             const Stretch& healthy, int threads);

/// Samples of a stretch, in a row.
struct RecordPart {
  std::size_t stretch{0};
  std::size_t from{0};
  std::size_t count{0};
};

/// The two parts of a record that are left out in turn: its first and its last
/// 600 samples, or the halves of a shorter record.
/// @throws DataError where a half is too short for a fault to show.
std::vector<RecordPart> PartsOf(const std::vector<Stretch>& stretches);

/// The runs without the samples of `part`.
std::vector<TrainingRun> RunsWithout(const std::vector<TrainingRun>& runs,
                                     const Stretch& part);

Stretch CutOut(const Stretch& stretch, const RecordPart& part);

/// The rest of the stretches without `part`; of a long rest, four blocks of
/// 300 samples; rests too short to tell anything are left out.
FaultyStretches Without(const FaultyStretches& all, const RecordPart& part);

/// The smallest strength of a fault that is detected, by two sets.
struct CoverageChange {
  int fault{0};
  bool negative{false};
  std::optional<double> before{};
  std::optional<double> after{};

  bool lost() const { return before && !after; }
};

/// Faults whose smallest strength differs.
std::vector<CoverageChange> ChangesOf(const CoverageTable& before,
                                      const CoverageTable& after);

}  // namespace fdi::trainer
