#include <iostream>
#include <memory>

#include <CLI/CLI.hpp>

#include "storage/app/common.h"
#include "storage/app/episode_text.h"
#include "storage/app/history_options.h"
#include "storage/app/verbs.h"
#include "storage/history.h"

namespace fdi::storage {
namespace {

using cli::Context;

// Heading of a signal, as in the CSV contract.
std::string Heading(Signal signal, FlowUnit flow_unit) {
  const std::string name(SignalName(signal));
  if (signal == Signal::kF) {
    return name + (flow_unit == FlowUnit::kM3PerHour ? "_m3_h" : "_t_h");
  }
  const std::string unit(SignalUnit(signal));
  return name + (unit == "%" ? "_pct" : unit.empty() ? "" : "_" + unit);
}

void WriteTrace(const Episode& episode, const std::vector<TraceInstant>& trace,
                std::ostream& out) {
  SignalMask present = 0;
  for (const TraceInstant& instant : trace) {
    present =
        static_cast<SignalMask>(present | instant.received.sample.present);
  }
  out << "t_s,stamp_ns,seq,intake,quality,state";
  for (std::size_t i = 0; i < kSignalCount; ++i) {
    if ((present >> i & 1U) != 0) {
      out << ',' << Heading(static_cast<Signal>(i), episode.flow_unit);
    }
  }
  for (const std::string& channel : episode.channels) {
    out << ",r_" << channel;
  }
  out << ",d_0";
  for (const std::string& fault : episode.faults) {
    out << ",d_" << fault;
  }
  out << '\n';
  for (const TraceInstant& instant : trace) {
    const Sample& sample = instant.received.sample;
    out << CsvCell(static_cast<double>(sample.stamp_ns - episode.detected_ns) /
                   1e9)
        << ',' << sample.stamp_ns << ',' << sample.seq << ','
        << IntakeName(instant.received.intake) << ','
        << QualityName(instant.quality) << ',' << StateName(instant.state);
    for (std::size_t i = 0; i < kSignalCount; ++i) {
      if ((present >> i & 1U) != 0) {
        out << ','
            << (sample.Has(static_cast<Signal>(i)) ? CsvCell(sample.values[i])
                                                   : "nan");
      }
    }
    for (const double residual : instant.residuals) {
      out << ',' << CsvCell(residual);
    }
    out << ',' << CsvCell(instant.normal_factor);
    for (const double factor : instant.fault_factors) {
      out << ',' << CsvCell(factor);
    }
    out << '\n';
  }
}

struct ExportOptions {
  std::string id;
  std::string output{"-"};
  HistoryOptions filter;
};

int Export(const ExportOptions& options, const Context& context) {
  HistoryReader reader(DataOf(context).history());
  if (options.id.empty()) {
    const auto episodes = reader.List(options.filter.Filter(context));
    WriteOutput(options.output,
                [&](std::ostream& out) { WriteEpisodes(episodes, out); });
  } else {
    const Episode episode = reader.Show(options.id);
    const auto trace = reader.Trace(episode.id);
    WriteOutput(options.output,
                [&](std::ostream& out) { WriteTrace(episode, trace, out); });
  }
  return cli::kExitOk;
}

}  // namespace

void AddEvidenceVerbs(cli::Program& program) {
  CLI::App& group = *program.root().get_subcommand("history");
  auto options = std::make_shared<ExportOptions>();
  CLI::App& exporting = program.AddVerb(
      group, "export",
      "Write as CSV the list of episodes, or the trace of one of them",
      [options](const Context& c) { return Export(*options, c); });
  exporting.add_option("episode", options->id,
                       "ID, a unique beginning of it, or last");
  exporting.add_option("-o,--output", options->output, "File, or - for stdout");
  options->filter.AddTo(exporting);
}

}  // namespace fdi::storage
