#include "trainer/app/model_report.h"

#include <array>
#include <cmath>
#include <cstdio>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "trainer/app/rule_text.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

std::string RegressorsText(const TsModel& model) {
  std::string text;
  for (const Regressor& regressor : model.regressors) {
    text += text.empty() ? "" : ", ";
    text += RegressorText(regressor);
  }
  return text;
}

void PrintChannels(std::ostream& out, const ModelSet& models) {
  cli::TextTable table({{"channel"},
                        {"unit"},
                        {"lower threshold", Align::kRight},
                        {"upper threshold", Align::kRight},
                        {"regressors"}});
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    const ChannelSpec& channel = models.channels[c];
    table.AddRow({channel.name, UnitOf(channel.output, models.flow_unit),
                  FormatNumber(channel.lower_threshold, 3),
                  FormatNumber(channel.upper_threshold, 3),
                  RegressorsText(models.observers[0].channels[c].model)});
  }
  table.Print(out);
}

// Limits on windows, if there are any.
void PrintWindows(std::ostream& out, const ModelSet& models) {
  cli::TextTable table({{"channel"},
                        {"window [samples]", Align::kRight},
                        {"mean below", Align::kRight},
                        {"mean above", Align::kRight},
                        {"deviation above", Align::kRight}});
  bool any = false;
  for (const ChannelSpec& channel : models.channels) {
    for (const WindowLimits& window : channel.windows) {
      any = true;
      table.AddRow({channel.name, std::to_string(window.length),
                    FormatNumber(window.lower_mean, 3),
                    FormatNumber(window.upper_mean, 3),
                    FormatNumber(std::exp(window.upper_log_rms), 3)});
    }
  }
  if (any) {
    out << '\n';
    table.Print(out);
  }
}

void PrintObservers(std::ostream& out, const ModelSet& models) {
  std::vector<cli::TextTable::Column> columns{{"observer"}};
  for (const ChannelSpec& channel : models.channels) {
    const std::string unit = UnitOf(channel.output, models.flow_unit);
    columns.push_back({channel.name + ": rules", Align::kRight});
    columns.push_back({"MSE [(" + unit + ")^2]", Align::kRight});
    columns.push_back({"VAF [%]", Align::kRight});
    columns.push_back({"bias [" + unit + "]", Align::kRight});
  }
  cli::TextTable table(std::move(columns));
  for (const Observer& observer : models.observers) {
    std::vector<std::string> row{observer.name};
    for (const ChannelObserver& channel : observer.channels) {
      row.push_back(std::to_string(channel.model.rules.size()));
      row.push_back(FormatNumber(channel.validation.mse, 4));
      row.push_back(FormatNumber(channel.validation.vaf, 1));
      row.push_back(FormatNumber(channel.validation.bias, 3));
    }
    table.AddRow(std::move(row));
  }
  table.Print(out);
}

cli::Json ChannelJson(const ChannelSpec& spec, const ChannelObserver& channel) {
  cli::Json regressors = cli::Json::array();
  for (const Regressor& regressor : channel.model.regressors) {
    regressors.push_back(RegressorText(regressor));
  }
  return {{"name", spec.name},
          {"regressors", std::move(regressors)},
          {"rules", channel.model.rules.size()},
          {"mse", channel.validation.mse},
          {"vaf", channel.validation.vaf},
          {"bias", channel.validation.bias}};
}

cli::Json FaultNames(const std::vector<int>& faults) {
  cli::Json names = cli::Json::array();
  for (const int fault : faults) {
    names.push_back(FaultName(fault));
  }
  return names;
}

}  // namespace

std::string HashText(std::uint64_t hash) {
  std::array<char, 17> text{};
  std::snprintf(text.data(), text.size(), "%016llx",
                static_cast<unsigned long long>(hash));
  return text.data();
}

std::string FaultsText(const std::vector<int>& faults) {
  std::string text;
  for (const int fault : faults) {
    text += text.empty() ? "" : ", ";
    text += FaultName(fault);
  }
  return text.empty() ? "none" : text;
}

std::string GroupsText(const ModelSet& models) {
  std::string text;
  for (const std::vector<int>& group : models.groups) {
    std::string names;
    for (const int fault : group) {
      names += names.empty() ? "" : "|";
      names += FaultName(fault);
    }
    text += text.empty() ? "" : ", ";
    text += names;
  }
  return text.empty() ? "none" : text;
}

void PrintModels(std::ostream& out, const ModelSet& models) {
  PrintChannels(out, models);
  PrintWindows(out, models);
  out << '\n';
  PrintObservers(out, models);
  out << "\nnot told apart: " << GroupsText(models)
      << "\nundetectable: " << FaultsText(models.undetectable) << '\n';
}

cli::Json ModelsJson(const ModelSet& models) {
  cli::Json observers = cli::Json::array();
  for (const Observer& observer : models.observers) {
    cli::Json channels = cli::Json::array();
    for (std::size_t c = 0; c < observer.channels.size(); ++c) {
      channels.push_back(ChannelJson(models.channels[c], observer.channels[c]));
    }
    observers.push_back({{"name", observer.name},
                         {"fault", FaultName(observer.fault)},
                         {"strength", observer.strength},
                         {"channels", std::move(channels)}});
  }
  cli::Json groups = cli::Json::array();
  for (const std::vector<int>& group : models.groups) {
    groups.push_back(FaultNames(group));
  }
  return {{"model_set", models.name},
          {"version", models.version},
          {"content_hash", HashText(models.content_hash)},
          {"observers", std::move(observers)},
          {"groups", std::move(groups)},
          {"undetectable", FaultNames(models.undetectable)}};
}

}  // namespace fdi::trainer
