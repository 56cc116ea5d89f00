#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/log.h"
#include "bench/study/report_page.h"
#include "bench/study/verbs.h"
#include "diagnosis/model/model_set.h"
#include "report/output_folder.h"
#include "report/plot/figure.h"
#include "report/program.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"
#include "storage/runs/runs.h"
#include "trainer/campaign/run_input.h"
#include "trainer/regression.h"
#include "trainer/rule_text.h"
#include "trainer/training.h"

namespace fdi::trainer::study {
namespace {

constexpr std::size_t kFewResiduals = 20;  // As in the calibration.
constexpr double kSameStrength = 1e-3;
constexpr int kPoints = 561;  // On the curve of a fuzzy set.
constexpr int kBars = 56;

// The runs of ModelSet::training_runs that can be read; `missing` tells why
// others cannot.
std::vector<storage::StoredRun> LoadRuns(
    const ModelSet& models, const storage::DataDirectory& directory,
    std::vector<std::string>& missing) {
  std::vector<storage::StoredRun> runs;
  std::optional<storage::RunStore> store;
  for (const std::string& run : models.training_runs) {
    try {
      if (!store) {
        store.emplace(directory.runs());
      }
      runs.push_back(store->Load(run));
    } catch (const std::exception& error) {
      missing.push_back("run " + run + ": " + error.what());
    }
  }
  return runs;
}

std::vector<Condition> ConditionsOf(const std::vector<storage::StoredRun>& runs,
                                    DatasetOptions options,
                                    std::vector<std::string>& missing) {
  if (runs.empty()) {
    return {};
  }
  std::vector<TrainingRun> training;
  for (const storage::StoredRun& run : runs) {
    options.assume_normal |= !HasTruth(run);
  }
  for (const storage::StoredRun& run : runs) {
    training.push_back(ToTrainingRun(run, options.assume_normal));
  }
  try {
    return BuildConditions(training, options);
  } catch (const DataError& error) {
    missing.push_back(std::string("training data: ") + error.what());
    return {};
  }
}

// The residuals that the membership of an observer came from: of a fault those
// of the validation stretches, or of all stretches if those are short; of
// normal operation those of all stretches, as its membership rests on
// cross-validation over them.
std::vector<double> ResidualsOf(const TsModel& model,
                                const Condition& condition, int settling) {
  std::vector<double> residuals =
      RunResiduals(model, condition.validation, settling);
  if (condition.fault == 0 || residuals.size() < kFewResiduals) {
    const std::vector<double> more =
        RunResiduals(model, condition.training, settling);
    residuals.insert(residuals.end(), more.begin(), more.end());
  }
  std::erase_if(residuals, [](double r) { return !std::isfinite(r); });
  return residuals;
}

// The data of a training, cut again as the preset of the set cuts them; a
// campaign may have cut them otherwise.
class TrainingData {
 public:
  TrainingData(const ModelSet& models, const storage::DataDirectory& directory,
               std::vector<std::string>& missing) {
    TrainingOptions options;
    try {
      options = PresetOptions(models.preset);
    } catch (const ConfigError&) {
      // Not made by `fdi-trainer train`: the defaults serve.
    }
    settling_ = options.fit.settling;
    conditions_ = ConditionsOf(LoadRuns(models, directory, missing),
                               options.dataset, missing);
  }

  // Empty if the data of the observer's condition are gone.
  std::vector<double> Residuals(const Observer& observer, std::size_t c) const {
    const auto found =
        std::find_if(conditions_.begin(), conditions_.end(),
                     [&](const Condition& condition) {
                       return condition.fault == observer.fault &&
                              std::abs(condition.strength - observer.strength) <
                                  kSameStrength;
                     });
    return found == conditions_.end()
               ? std::vector<double>()
               : ResidualsOf(observer.channels[c].model, *found, settling_);
  }

 private:
  int settling_{0};
  std::vector<Condition> conditions_;
};

double Membership(const FuzzySet& set, double x) {
  const double left = (set.left_center - x) / set.left_width;
  const double right = (x - set.right_center) / set.right_width;
  const double beyond = std::max({left, right, 0.0});
  return std::exp(-0.5 * beyond * beyond);
}

plot::Figure MakeFigure(std::string title, std::string x_label,
                        plot::Range range) {
  plot::Figure figure;
  figure.title = std::move(title);
  figure.x_label = std::move(x_label);
  figure.x_range = range;
  figure.width = 900.0;
  figure.legend_width = 300.0;
  figure.panels.push_back({.label = "membership [-]",
                           .range = plot::Range{0.0, 1.05},
                           .height = 260.0});
  return figure;
}

// The antecedent sets of all rules on regressor `j`, each in the words of
// RulesText().
plot::Figure MembershipFigure(const TsModel& model, std::size_t j,
                              FlowUnit flow_unit, const std::string& title) {
  const double low = model.regressor_min[j];
  const double high = std::max(model.regressor_max[j], low + 1e-9);
  const Regressor& regressor = model.regressors[j];
  plot::Figure figure =
      MakeFigure(title,
                 RegressorText(regressor) + " [" +
                     UnitOf(regressor.signal, flow_unit) + "]",
                 {low, high});
  for (int i = 0; i < kPoints; ++i) {
    figure.x.push_back(low + (high - low) * i / (kPoints - 1));
  }
  for (std::size_t r = 0; r < model.rules.size(); ++r) {
    const std::string words =
        AntecedentWords(model, model.rules[r], j, flow_unit);
    plot::Series series{.title = "rule " + std::to_string(r + 1) + ": " +
                                 (words.empty() ? "any" : words),
                        .colour = SeriesColour(r),
                        .width = 2.0,
                        .y = {}};
    for (const double x : figure.x) {
      series.y.push_back(Membership(model.rules[r].antecedents[j], x));
    }
    figure.panels[0].series.push_back(std::move(series));
  }
  return figure;
}

// Shares of `residuals` in kBars equal bins over the range.
std::vector<double> Histogram(const std::vector<double>& residuals,
                              plot::Range range) {
  std::vector<double> shares(kBars);
  for (const double residual : residuals) {
    const double at = (residual - range.from) / (range.to - range.from) * kBars;
    const double bin = std::clamp(std::floor(at), 0.0, kBars - 1.0);
    shares[static_cast<std::size_t>(bin)] +=
        1.0 / static_cast<double>(residuals.size());
  }
  return shares;
}

// The membership of an observer's residual in channel `c` over the histogram
// of `residuals`, whose tallest bar is as high as the plot.
plot::Figure ResidualFigure(const ModelSet& models, const Observer& observer,
                            std::size_t c,
                            const std::vector<double>& residuals) {
  const Trapezoid& membership = observer.channels[c].membership;
  plot::Range range{membership.a, membership.d};
  for (const double residual : residuals) {
    range.from = std::min(range.from, residual);
    range.to = std::max(range.to, residual);
  }
  const double margin = std::max(0.05 * (range.to - range.from), 1e-9);
  range = {range.from - margin, range.to + margin};
  plot::Figure figure = MakeFigure(
      "Observer " + observer.name + ", channel " + models.channels[c].name,
      "residual r = y - ŷ [" +
          UnitOf(models.channels[c].output, models.flow_unit) + "]",
      range);
  plot::Panel& panel = figure.panels[0];
  panel.notes = {
      "1 from " + Digits(membership.b, 4) + " to " + Digits(membership.c, 4),
      "0 beyond " + Digits(membership.a, 4) + ", " + Digits(membership.d, 4)};
  if (residuals.empty()) {
    panel.notes.emplace_back("no residuals: training runs missing");
  } else {
    plot::Series bars{.title = "residuals in training",
                      .colour = plot::ink::kPale,
                      .y = Histogram(residuals, range),
                      .shape = plot::Shape::kBars};
    const double tallest = *std::max_element(bars.y.begin(), bars.y.end());
    for (std::size_t i = 0; i < bars.y.size(); ++i) {
      bars.y[i] /= tallest;
      bars.x.push_back(range.from + (range.to - range.from) *
                                        (static_cast<double>(i) + 0.5) / kBars);
    }
    panel.series.push_back(std::move(bars));
    panel.notes.push_back(std::to_string(residuals.size()) + " residuals");
    panel.notes.push_back("tallest bar: " + Digits(100.0 * tallest, 4) + " %");
  }
  panel.series.push_back(
      {.title = "membership",
       .colour = plot::ink::kVermilion,
       .width = 2.0,
       .y = {0.0, 1.0, 1.0, 0.0},
       .x = {membership.a, membership.b, membership.c, membership.d}});
  return figure;
}

// Letters, digits, points and signs; "CV(k-1)" gives "CV_k-1".
std::string FileName(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool kept = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                      c == '.' || c == '-';
    if (kept || (!name.empty() && name.back() != '_')) {
      name += kept ? c : '_';
    }
  }
  return name.ends_with('_') ? name.substr(0, name.size() - 1) : name;
}

// Draws to a file of the folder; a number tells equal names apart.
void Write(const std::filesystem::path& folder, const std::string& name,
           const plot::Figure& figure, std::set<std::string>& names) {
  std::string unique = FileName(name);
  for (int n = 2; !names.insert(unique).second; ++n) {
    unique = FileName(name) + '_' + std::to_string(n);
  }
  plot::DrawFigure(figure, folder / (unique + ".svg"));
}

// Writes membership_CHANNEL_REGRESSOR.svg, the fuzzy sets of the rules, for
// every regressor of the normal observer, and residual_OBSERVER_CHANNEL.svg,
// the membership over the histogram of the training residuals, for every
// observer and channel. The residuals are computed anew; runs that are gone
// are logged, and their histograms left out.
// @throws DataError naming what cannot be written; std::runtime_error if
//   gnuplot is missing or fails.
void WriteModelPictures(const ModelSet& models,
                        const storage::DataDirectory& directory,
                        const std::filesystem::path& folder,
                        const LogSink& log) {
  std::filesystem::create_directory(folder);
  std::set<std::string> names;
  std::vector<std::string> missing;
  const TrainingData data(models, directory, missing);
  for (const std::string& reason : missing) {
    log(LogLevel::kWarning,
        EventLine("residuals_missing", {{"reason", reason}}));
  }
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const std::string& channel = models.channels[c].name;
    const TsModel& model = models.observers.front().channels[c].model;
    for (std::size_t j = 0; j < model.regressors.size(); ++j) {
      const std::string regressor = RegressorText(model.regressors[j]);
      Write(folder, "membership " + channel + ' ' + regressor,
            MembershipFigure(model, j, models.flow_unit,
                             "Normal observer, channel " + channel +
                                 ": sets of the rules on " + regressor),
            names);
    }
  }
  for (const Observer& observer : models.observers) {
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      Write(folder, "residual " + observer.name + ' ' + models.channels[c].name,
            ResidualFigure(models, observer, c, data.Residuals(observer, c)),
            names);
    }
  }
  log(LogLevel::kInfo, EventLine("pictures_written",
                                 {{"folder", folder.string()},
                                  {"pictures", std::to_string(names.size())}}));
}

struct PictureOptions {
  std::string model_set;
  std::filesystem::path folder;
};

}  // namespace

void AddPicturesVerb(report::Program& program) {
  auto options = std::make_shared<PictureOptions>();
  CLI::App& verb = program.AddVerb(
      "pictures",
      "Draw a model set: the fuzzy sets of its normal models, the residual "
      "memberships of all observers over their residuals",
      [options](const report::Context& context) -> report::Report {
        const storage::DataDirectory directory{context.options.data_dir};
        WriteModelPictures(
            storage::ModelStore(directory.models()).Load(options->model_set),
            directory, options->folder, context.log);
        return {};
      });
  verb.add_option("model-set", options->model_set,
                  "NAME (its active version) or NAME@VERSION")
      ->required()
      ->type_name("NAME[@VERSION]");
  verb.add_option("folder", options->folder, "Where the SVG files go")
      ->required()
      ->type_name("DIR");
}

}  // namespace fdi::trainer::study
