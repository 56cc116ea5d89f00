#include "trainer/app/model_pictures.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "storage/cli/envelope.h"
#include "storage/cli/output_folder.h"
#include "storage/cli/svg.h"
#include "trainer/app/rule_text.h"

namespace fdi::trainer {
namespace {

using cli::SvgArea;
using cli::SvgPanel;

constexpr SvgArea kPlot{52.0, 44.0, 560.0, 220.0};  // px
constexpr double kWidth = 860.0;
constexpr double kFoot = 40.0;
constexpr double kLegendStep = 15.0;
constexpr int kBars = 56;

double Membership(const FuzzySet& set, double x) {
  const double left = (set.left_center - x) / set.left_width;
  const double right = (x - set.right_center) / set.right_width;
  const double beyond = std::max({left, right, 0.0});
  return std::exp(-0.5 * beyond * beyond);
}

cli::SvgCanvas MakeCanvas(std::size_t legend_entries,
                          const std::string& title) {
  const double legend = kLegendStep * static_cast<double>(legend_entries);
  cli::SvgCanvas canvas(
      kWidth, kPlot.top + std::max(kPlot.height, legend) + kFoot, title);
  canvas.Text(kPlot.left, 18.0, title, "head");
  return canvas;
}

// Shares of `residuals` in kBars equal bins over [low, high].
std::vector<double> Histogram(std::span<const double> residuals, double low,
                              double high) {
  std::vector<double> shares(kBars);
  for (const double residual : residuals) {
    const double at = (residual - low) / (high - low) * kBars;
    const double bin = std::clamp(std::floor(at), 0.0, kBars - 1.0);
    shares[static_cast<std::size_t>(bin)] +=
        1.0 / static_cast<double>(residuals.size());
  }
  return shares;
}

void DrawHistogram(cli::SvgCanvas& canvas, const SvgPanel& panel,
                   const std::vector<double>& shares, double tallest) {
  const double width = kPlot.width / kBars;
  for (std::size_t i = 0; i < shares.size(); ++i) {
    const double top = panel.y()(shares[i] / tallest);
    if (shares[i] > 0.0) {
      canvas.Rectangle({kPlot.left + static_cast<double>(i) * width, top,
                        width - 1.0, kPlot.bottom() - top},
                       "bar");
    }
  }
}

void DrawTrapezoid(cli::SvgCanvas& canvas, const SvgPanel& panel,
                   const Trapezoid& membership) {
  const SvgArea& area = panel.area();
  const auto line = [&](double x1, double y1, double x2, double y2) {
    canvas.Line(std::clamp(panel.x()(x1), area.left, area.right()),
                panel.y()(y1),
                std::clamp(panel.x()(x2), area.left, area.right()),
                panel.y()(y2), "s1 wide");
  };
  line(membership.a, 0.0, membership.b, 1.0);
  line(membership.b, 1.0, membership.c, 1.0);
  line(membership.c, 1.0, membership.d, 0.0);
}

// Letters, digits, points and signs; "CV(k-1)" gives "CV_k-1".
std::string FileName(const std::string& text) {
  std::string name;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' ||
        c == '-') {
      name += c;
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') {
    name.pop_back();
  }
  return name;
}

// Writes files whose names are told apart by a number where they must be.
class PictureFolder {
 public:
  explicit PictureFolder(std::filesystem::path folder)
      : folder_(std::move(folder)) {}

  void Write(const std::string& name, const std::string& picture) {
    std::string unique = FileName(name);
    for (int n = 2; !names_.insert(unique).second; ++n) {
      unique = FileName(name) + '_' + std::to_string(n);
    }
    cli::WriteFile(folder_ / (unique + ".svg"), picture);
  }
  int count() const { return static_cast<int>(names_.size()); }

 private:
  std::filesystem::path folder_;
  std::set<std::string> names_;
};

}  // namespace

std::string MembershipPicture(const TsModel& model, std::size_t j,
                              FlowUnit flow_unit, const std::string& title) {
  const double low = model.regressor_min[j];
  const double high = std::max(model.regressor_max[j], low + 1e-9);
  const Regressor& regressor = model.regressors[j];
  cli::SvgCanvas canvas = MakeCanvas(model.rules.size(), title);
  const SvgPanel panel(canvas, kPlot,
                       {low, high,
                        RegressorText(regressor) + " [" +
                            UnitOf(regressor.signal, flow_unit) + "]",
                        8, true},
                       {0.0, 1.05, "membership [-]", 5, true});
  std::vector<cli::SvgLegendEntry> legend;
  for (std::size_t r = 0; r < model.rules.size(); ++r) {
    const std::string words =
        AntecedentWords(model, model.rules[r], j, flow_unit);
    legend.push_back({cli::SvgSeries(r), "rule " + std::to_string(r + 1) +
                                             ": " +
                                             (words.empty() ? "any" : words)});
    const int columns = static_cast<int>(kPlot.width);
    cli::Envelope line(low, high, columns);
    for (int i = 0; i < columns; ++i) {
      const double x = low + (high - low) * (i + 0.5) / columns;
      line.Add(x, Membership(model.rules[r].antecedents[j], x));
    }
    canvas.Path(line.PathData(kPlot, panel.y()), cli::SvgSeries(r) + " wide");
  }
  cli::DrawLegend(canvas, kPlot.right() + 10.0, kPlot.top + 8.0, legend);
  return canvas.Document();
}

std::string ResidualPicture(const ModelSet& models, std::size_t observer,
                            std::size_t c, std::span<const double> residuals) {
  const ChannelSpec& channel = models.channels[c];
  const Trapezoid& membership =
      models.observers[observer].channels[c].membership;
  double low = membership.a;
  double high = membership.d;
  for (const double residual : residuals) {
    low = std::min(low, residual);
    high = std::max(high, residual);
  }
  const double margin = std::max(0.05 * (high - low), 1e-9);
  low -= margin;
  high += margin;
  cli::SvgCanvas canvas =
      MakeCanvas(4, "Observer " + models.observers[observer].name +
                        ", channel " + channel.name);
  const SvgPanel panel(canvas, kPlot,
                       {low, high,
                        "residual r = y - \xC5\xB7 [" +
                            UnitOf(channel.output, models.flow_unit) + "]",
                        8, true},
                       {0.0, 1.05, "membership [-]", 5, true});
  const auto note = [&](int line, const std::string& text) {
    canvas.Text(kPlot.right() + 33.0, kPlot.top + 11.5 + kLegendStep * line,
                text);
  };
  note(1, "1 from " + cli::ShortNumber(membership.b) + " to " +
              cli::ShortNumber(membership.c));
  note(2, "0 beyond " + cli::ShortNumber(membership.a) + ", " +
              cli::ShortNumber(membership.d));
  if (!residuals.empty()) {
    const std::vector<double> shares = Histogram(residuals, low, high);
    const double tallest = *std::max_element(shares.begin(), shares.end());
    DrawHistogram(canvas, panel, shares, tallest);
    note(4, std::to_string(residuals.size()) + " residuals in training");
    note(5, "tallest bar: " + cli::ShortNumber(100.0 * tallest) + " %");
    canvas.Rectangle({kPlot.right() + 10.0, kPlot.top + 60.0, 18.0, 10.0},
                     "bar");
  } else {
    note(4, "no residuals: training runs missing");
  }
  DrawTrapezoid(canvas, panel, membership);
  cli::DrawLegend(canvas, kPlot.right() + 10.0, kPlot.top + 8.0,
                  {{"s1 wide", "membership of the residual"}});
  return canvas.Document();
}

int WriteModelPictures(const ModelSet& models,
                       const TrainingResiduals& residuals,
                       const std::filesystem::path& folder) {
  PictureFolder pictures(folder);
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const std::string& channel = models.channels[c].name;
    const TsModel& model = models.observers.front().channels[c].model;
    for (std::size_t j = 0; j < model.regressors.size(); ++j) {
      const std::string regressor = RegressorText(model.regressors[j]);
      pictures.Write(
          "membership " + channel + ' ' + regressor,
          MembershipPicture(model, j, models.flow_unit,
                            "Normal observer, channel " + channel +
                                ": sets of the rules on " + regressor));
    }
  }
  for (std::size_t o = 0; o < models.observers.size(); ++o) {
    for (std::size_t c = 0; c < models.channels.size(); ++c) {
      pictures.Write("residual " + models.observers[o].name + ' ' +
                         models.channels[c].name,
                     ResidualPicture(models, o, c, residuals.values[o][c]));
    }
  }
  return pictures.count();
}

}  // namespace fdi::trainer
