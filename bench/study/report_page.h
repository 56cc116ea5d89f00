#pragma once

#include <cstddef>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "bench/study/study_detectors.h"
#include "diagnosis/model/model_set.h"
#include "report/fault_texts.h"

namespace fdi::trainer::study {

/// Colour for series number `index`, repeating; never black or grey.
const char* SeriesColour(std::size_t index);

/// The page of `evaluate --report`: one HTML file that needs no script and no
/// other file. Figures over all runs, by fault and by group; indices of every
/// run; confusion by fault and by group; a picture of every run. Without
/// gnuplot it says so and has no pictures.
///
///     ReportPage page(models, LoadFaultTexts(options), runs.size());
///     settings.watch = [&](const ScoredRun& run) { return page.Watch(run); };
///     settings.scored = [&](...) { page.Draw(...); };
///     Evaluate(detector, runs, settings);
///     page.Print(file, detector, results, software, command_line);
class ReportPage {
 public:
  /// @param runs how many there are. `models` must outlive the page.
  ReportPage(const ModelSet& models, report::FaultTexts texts,
             std::size_t runs);
  ~ReportPage();
  ReportPage(const ReportPage&) = delete;
  ReportPage& operator=(const ReportPage&) = delete;

  /// The sink that collects what the picture of `run` shows. A run is followed
  /// by one thread; different runs may be followed by different ones.
  VerdictSink Watch(const ScoredRun& run);
  /// Draws the picture and forgets what was collected for it.
  /// @throws std::runtime_error if gnuplot fails.
  void Draw(const ScoredRun& run, const EvaluatedRun& result,
            const std::vector<Indication>& indications);

  void Print(std::ostream& out, const Detector& detector, const Scores& scores,
             const std::string& software,
             const std::string& command_line) const;

 private:
  class RunPicture;

  const ModelSet& models_;
  report::FaultTexts texts_;
  bool draws_;
  std::vector<std::unique_ptr<RunPicture>> open_;  // By ScoredRun::position.
  std::vector<std::string> pictures_;              // The same.
};

}  // namespace fdi::trainer::study
