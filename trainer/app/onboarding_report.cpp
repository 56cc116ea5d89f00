#include "trainer/app/onboarding_report.h"

#include <array>
#include <cstdio>

#include "diagnosis/fault_catalogue.h"
#include "storage/cli/text_table.h"
#include "trainer/app/model_report.h"
#include "trainer/event_rate.h"

namespace fdi::trainer {
namespace {

using cli::Align;
using cli::FormatNumber;

std::string SignalsText(SignalMask signals) {
  std::string text;
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    const auto signal = static_cast<Signal>(i);
    if ((signals & MaskOf(signal)) != 0) {
      text += (text.empty() ? "" : " ") + std::string(SignalName(signal));
    }
  }
  return text;
}

std::string UnitOf(const ModelSet& models, Signal output) {
  return std::string(output == Signal::kF ? FlowUnitName(models.flow_unit)
                                          : SignalUnit(output));
}

// Four significant digits: coefficients of a relay are small, pressures large.
std::string Significant(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

void PrintFit(std::ostream& out, const simulator::ValveFit& fit) {
  cli::TextTable table({{"parameter"},
                        {"nominal", Align::kRight},
                        {"fitted", Align::kRight},
                        {"sd [%]", Align::kRight},
                        {"identified"}});
  for (const simulator::FittedParameter& value : fit.values) {
    table.AddRow({value.name, Significant(value.nominal),
                  Significant(value.value),
                  FormatNumber(100.0 * value.relative_sd, 1),
                  value.identified ? "yes" : "no, stays nominal"});
  }
  table.Print(out);
  out << "command " << (fit.interpolated_command ? "interpolated" : "held")
      << " from sample to sample; simulation against record: X RMSE "
      << FormatNumber(fit.nominal.x_rmse_pct, 3) << " -> "
      << FormatNumber(fit.fitted.x_rmse_pct, 3) << " %, F RMSE "
      << FormatNumber(fit.nominal.flow_rmse, 3) << " -> "
      << FormatNumber(fit.fitted.flow_rmse, 3) << "\n\n";
}

void PrintChannels(std::ostream& out, const Onboarding& onboarding) {
  cli::TextTable table({{"channel"},
                        {"unit"},
                        {"RMSE", Align::kRight},
                        {"bias", Align::kRight},
                        {"VAF [%]", Align::kRight},
                        {"naive RMSE", Align::kRight}});
  for (const ChannelFit& fit : onboarding.channels) {
    table.AddRow({fit.name, UnitOf(onboarding.models, fit.output),
                  FormatNumber(fit.rmse, 3), FormatNumber(fit.bias, 3),
                  FormatNumber(fit.vaf, 1), FormatNumber(fit.naive_rmse, 3)});
  }
  table.Print(out);
  out << "normal observer on data it was not fitted to; naive: X = CV, "
         "else the mean\n\n";
}

std::string StrengthText(const std::optional<double>& strength, bool negative) {
  return strength ? FormatNumber(negative ? -*strength : *strength, 2)
                  : std::string("-");
}

cli::Json StrengthJson(const std::optional<double>& strength, bool negative) {
  return strength ? cli::Json(negative ? -*strength : *strength)
                  : cli::Json(nullptr);
}

cli::Json NamesJson(const std::vector<int>& faults) {
  cli::Json names = cli::Json::array();
  for (const int fault : faults) {
    names.push_back(FaultName(fault));
  }
  return names;
}

}  // namespace

void PrintCoverage(std::ostream& out, const CoverageTable& table) {
  out << "coverage with " << SignalsText(table.signals) << ", each fault given "
      << FormatNumber(table.seconds, 0) << " s to show; smallest strength\n";
  cli::TextTable rows({{"fault"},
                       {"description"},
                       {"detected from", Align::kRight},
                       {"isolated from", Align::kRight},
                       {"looks like"}});
  for (const FaultCoverage& coverage : table.faults) {
    rows.AddRow(
        {FaultName(coverage.fault) + (coverage.negative ? " (-)" : ""),
         std::string(FaultFactsOf(coverage.fault).description),
         StrengthText(coverage.detectable, coverage.negative),
         StrengthText(coverage.isolable, coverage.negative),
         coverage.look_alikes.empty() ? "" : FaultsText(coverage.look_alikes)});
  }
  rows.Print(out);
  out << "isolated: named in a set of at most two\n";
  for (const TransmitterGain& gain : table.gains) {
    out << "one more transmitter, " << SignalName(gain.signal)
        << ": detects also " << FaultsText(gain.detectable)
        << "; isolates also " << FaultsText(gain.isolable) << '\n';
  }
}

cli::Json CoverageJson(const CoverageTable& table) {
  cli::Json json;
  json["signals"] = SignalsText(table.signals);
  json["seconds"] = table.seconds;
  json["faults"] = cli::Json::array();
  for (const FaultCoverage& coverage : table.faults) {
    json["faults"].push_back(
        {{"fault", FaultName(coverage.fault)},
         {"direction", coverage.negative ? -1 : 1},
         {"detectable_from",
          StrengthJson(coverage.detectable, coverage.negative)},
         {"isolable_from", StrengthJson(coverage.isolable, coverage.negative)},
         {"look_alikes", NamesJson(coverage.look_alikes)}});
  }
  json["gains"] = cli::Json::array();
  for (const TransmitterGain& gain : table.gains) {
    json["gains"].push_back({{"signal", SignalName(gain.signal)},
                             {"detectable", NamesJson(gain.detectable)},
                             {"isolable", NamesJson(gain.isolable)}});
  }
  return json;
}

void PrintOnboarding(std::ostream& out, const Onboarding& onboarding) {
  const ModelSet& models = onboarding.models;
  if (onboarding.fit) {
    PrintFit(out, *onboarding.fit);
  }
  PrintChannels(out, onboarding);
  out << "model set " << models.name << '@' << models.version << ", hash "
      << HashText(models.content_hash) << ", " << models.observers.size()
      << " observers; thresholds for "
      << FormatNumber(models.false_alarms_per_hour * kHoursPerYear, 1)
      << " false alarms per valve-year from "
      << FormatNumber(models.threshold_hours, 2) << " h\n"
      << "not told apart: " << GroupsText(models)
      << "; not seen at half their strengths: "
      << FaultsText(models.undetectable) << "\n\n";
  if (onboarding.coverage) {
    PrintCoverage(out, *onboarding.coverage);
  }
}

cli::Json OnboardingJson(const Onboarding& onboarding) {
  cli::Json json = ModelsJson(onboarding.models);
  json["hours"] = onboarding.hours;
  json["parameters"] = cli::Json::array();
  if (onboarding.fit) {
    for (const simulator::FittedParameter& value : onboarding.fit->values) {
      json["parameters"].push_back({{"name", value.name},
                                    {"nominal", value.nominal},
                                    {"value", value.value},
                                    {"identified", value.identified}});
    }
  }
  json["fit"] = cli::Json::array();
  for (const ChannelFit& fit : onboarding.channels) {
    json["fit"].push_back({{"channel", fit.name},
                           {"rmse", fit.rmse},
                           {"bias", fit.bias},
                           {"vaf", fit.vaf},
                           {"naive_rmse", fit.naive_rmse}});
  }
  if (onboarding.coverage) {
    json["coverage"] = CoverageJson(*onboarding.coverage);
  }
  return json;
}

storage::BaselineRecord BaselineOf(const Onboarding& onboarding,
                                   std::uint32_t epoch) {
  storage::BaselineRecord record;
  record.epoch = epoch;
  record.model_set = onboarding.models.name;
  record.version = onboarding.models.version;
  record.hours = onboarding.hours;
  if (onboarding.fit) {
    for (const simulator::FittedParameter& value : onboarding.fit->values) {
      record.parameters.emplace_back(value.name, value.value);
    }
  }
  for (const ChannelFit& fit : onboarding.channels) {
    record.channels.push_back({fit.name, fit.rmse, fit.bias, fit.vaf});
  }
  return record;
}

}  // namespace fdi::trainer
