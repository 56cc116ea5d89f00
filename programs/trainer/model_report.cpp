#include "programs/trainer/model_report.h"

#include <cmath>
#include <map>
#include <sstream>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/models/model_codec.h"
#include "storage/models/models.h"
#include "trainer/campaign/campaign_runs.h"
#include "trainer/rule_text.h"
#include "trainer/scoring/evaluated_run.h"
#include "trainer/statistics.h"

namespace fdi::trainer {
namespace {

using report::Align;
using report::FormatNumber;
using report::Json;

Json RegressorsJson(const TsModel& model) {
  Json regressors = Json::array();
  for (const Regressor& regressor : model.regressors) {
    regressors.push_back(RegressorText(regressor));
  }
  return regressors;
}

Json ChannelJson(const ChannelSpec& channel, const ModelSet& models) {
  Json windows = Json::array();
  for (const WindowLimits& window : channel.windows) {
    windows.push_back({{"length", window.length},
                       {"lower_mean", window.lower_mean},
                       {"upper_mean", window.upper_mean},
                       {"upper_log_rms", window.upper_log_rms},
                       {"activity_slope", window.activity_slope},
                       {"log_activity", window.log_activity}});
  }
  return {{"name", channel.name},
          {"output", SignalName(channel.output)},
          {"unit", UnitOf(channel.output, models.flow_unit)},
          {"lower_threshold", channel.lower_threshold},
          {"upper_threshold", channel.upper_threshold},
          {"windows", std::move(windows)}};
}

Json ObserverJson(const Observer& observer, const ModelSet& models) {
  Json channels = Json::array();
  for (std::size_t c = 0; c < observer.channels.size(); ++c) {
    const ChannelObserver& channel = observer.channels[c];
    channels.push_back({{"name", models.channels[c].name},
                        {"regressors", RegressorsJson(channel.model)},
                        {"rules", channel.model.rules.size()},
                        {"mse", channel.validation.mse},
                        {"vaf", VafJson(channel.validation.vaf)},
                        {"bias", channel.validation.bias},
                        {"samples", channel.validation.samples}});
  }
  return {{"name", observer.name},
          {"fault", FaultName(observer.fault)},
          {"strength", observer.strength},
          {"channels", std::move(channels)}};
}

// A figure of one channel in a table with one row per observer.
report::Column OfChannel(std::size_t c, std::string heading, const char* key,
                         int decimals) {
  const auto text = [=](const Json& row) {
    const Json& value = row["channels"][c][key];
    return value.is_number_integer() ? value.dump()
           : value.is_null()         ? "-"
                                     : FormatNumber(value, decimals);
  };
  return {.heading = std::move(heading),
          .key = "",
          .text = text,
          .align = Align::kRight};
}

// One line per channel and window, which no array of the document has.
std::string WindowsText(const ModelSet& models) {
  report::TextTable table({{"channel"},
                           {"window [samples]", Align::kRight},
                           {"mean below", Align::kRight},
                           {"mean above", Align::kRight},
                           {"deviation above", Align::kRight}});
  for (const ChannelSpec& channel : models.channels) {
    for (const WindowLimits& window : channel.windows) {
      table.AddRow({channel.name, std::to_string(window.length),
                    FormatNumber(window.lower_mean, 3),
                    FormatNumber(window.upper_mean, 3),
                    FormatNumber(std::exp(window.upper_log_rms), 3)});
    }
  }
  std::ostringstream text;
  if (!table.empty()) {
    text << '\n';
    table.Print(text);
  }
  return text.str();
}

}  // namespace

void RequireStorable(const std::string& name, const std::string& option) {
  try {
    if (!storage::ParseModelReference(name).version) {
      return;
    }
  } catch (const ConfigError&) {
    // Refused likewise.
  }
  throw ConfigError(option + " " + name +
                    ": expected letters, digits, . _ -, at most 64, and no "
                    "version, which is given when it is stored");
}

report::Json FaultsJson(const std::vector<int>& faults) {
  Json names = Json::array();
  for (const int fault : faults) {
    names.push_back(FaultName(fault));
  }
  return names;
}

Json VafJson(double vaf) {
  constexpr double kMinVaf = -1e9;  // %
  return vaf > kMinVaf ? Json(vaf) : Json();
}

report::Json ModelsJson(const ModelSet& models) {
  Json json = {{"model_set", models.name},
               {"version", models.version},
               {"content_hash", Hex16(models.content_hash)},
               {"channels", Json::array()},
               {"observers", Json::array()},
               {"groups", Json::array()},
               {"undetectable", FaultsJson(models.undetectable)}};
  for (const ChannelSpec& channel : models.channels) {
    json["channels"].push_back(ChannelJson(channel, models));
  }
  for (const Observer& observer : models.observers) {
    json["observers"].push_back(ObserverJson(observer, models));
  }
  for (const std::vector<int>& group : models.groups) {
    json["groups"].push_back(FaultsJson(group));
  }
  return json;
}

void AddModelTables(const ModelSet& models, report::Report& report) {
  std::map<std::string, std::string> regressors;
  std::vector<report::Column> figures = {{"observer", "name"}};
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const std::string& name = models.channels[c].name;
    const std::string unit =
        UnitOf(models.channels[c].output, models.flow_unit);
    for (const Regressor& regressor :
         models.observers.front().channels[c].model.regressors) {
      std::string& text = regressors[name];
      text += (text.empty() ? "" : ", ") + RegressorText(regressor);
    }
    figures.push_back(OfChannel(c, name + ": rules", "rules", 0));
    figures.push_back(OfChannel(c, "MSE [(" + unit + ")^2]", "mse", 4));
    figures.push_back(OfChannel(c, "VAF [%]", "vaf", 1));
    figures.push_back(OfChannel(c, "bias [" + unit + "]", "bias", 3));
  }
  const auto regressors_of = [regressors](const Json& row) {
    return regressors.at(row["name"]);
  };
  report.Table(
      "channels",
      {{"channel", "name"},
       {"unit", "unit"},
       {.heading = "lower threshold", .key = "lower_threshold", .decimals = 3},
       {.heading = "upper threshold", .key = "upper_threshold", .decimals = 3},
       {.heading = "regressors", .key = "", .text = regressors_of}});
  report.Line(WindowsText(models));
  report.Table("observers", std::move(figures));
  report.Line("\n" + AlarmRateText(models) +
              "\nnot told apart: " + GroupsText(models) +
              "\nundetectable: " + FaultsText(models.undetectable));
}

Progress Reporting(report::Progress& bar, const report::StopSignals& signals) {
  return [&](double share, std::string_view stage) {
    if (signals.stop_requested()) {
      throw Interrupted("interrupted: nothing was stored");
    }
    bar.Update(share, std::string(stage));
  };
}

std::string AlarmRateText(const ModelSet& models) {
  std::string text =
      "limits set for one false alarm in " +
      FormatNumber(1.0 / models.false_alarms_per_hour, 0) + " h; seen were " +
      FormatNumber(models.threshold_hours, 2) + " h without fault";
  if (models.threshold_hours > 0.0) {
    const double bound =
        RateOf(0, models.threshold_hours).upper / kHoursPerYear;
    text += ", which alone say below " + FormatNumber(bound, 2) +
            " false alarms per hour (95 %)";
  }
  return text;
}

report::Column StrengthColumn() {
  const auto text = [](const Json& row) -> std::string {
    const bool faulty =
        row["fault"].is_string() && row["fault"] != FaultName(0);
    return faulty ? FormatNumber(row["strength"], 2) : "-";
  };
  return {.heading = "strength [-]",
          .key = "strength",
          .text = text,
          .align = Align::kRight};
}

void AddEpisodeTable(report::Report& report) {
  report.Table("lineage/episodes",
               {{"episode", "episode_id"},
                {"valve", "valve_id"},
                {"label", "label"},
                {"by", "labelled_by"},
                {"at", "labelled_utc", report::Format::kTime},
                {"taken as", "fault"},
                StrengthColumn(),
                {"samples", "samples"},
                {"run", "run"}});
}

}  // namespace fdi::trainer
