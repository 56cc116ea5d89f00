#include "simulator/app/feed.h"

#include <chrono>
#include <cstdio>
#include <iostream>
#include <random>

#include "storage/cli/json_output.h"
#include "storage/cli/text_table.h"
#include "storage/cli/time_text.h"

namespace fdi::simulator {
namespace {

void Count(const Sample& sample, SourceSummary& source) {
  if (source.samples++ == 0) {
    source.first_stamp_ns = sample.stamp_ns;
  }
  source.last_stamp_ns = sample.stamp_ns;
}

std::string Hex(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx",
                static_cast<unsigned long long>(value));
  return text;
}

// From the first sample to the last [s].
double SpanOf(const SourceSummary& source) {
  return static_cast<double>(source.last_stamp_ns - source.first_stamp_ns) /
         1e9;
}

const char* Outcome(const FeedSummary& summary) {
  if (!summary.published || summary.acknowledged) {
    return "";
  }
  return summary.readers == 0 ? ", nobody listened"
                              : ", not acknowledged by all readers";
}

void PrintSummaryJson(const FeedSummary& summary) {
  cli::Json json;
  json["samples"] = summary.samples;
  json["published"] = summary.published ? summary.samples : 0;
  json["readers"] = summary.readers;
  json["acknowledged"] = summary.acknowledged;
  json["interrupted"] = summary.interrupted;
  json["elapsed_s"] = summary.elapsed_s;
  json["sources"] = cli::Json::array();
  for (const SourceSummary& source : summary.sources) {
    cli::Json& entry = json["sources"].emplace_back();
    entry["valve"] = source.valve_id;
    entry["source_id"] = Hex(source.source_id);
    entry["samples"] = source.samples;
    entry["start"] = cli::FormatTime(source.first_stamp_ns, true);
    entry["seconds"] = SpanOf(source);
    if (source.seed) {
      entry["seed"] = *source.seed;
    }
    if (!source.run_id.empty()) {
      entry["run_id"] = source.run_id;
    }
  }
  cli::PrintJson(std::cout, json);
}

// Until the feed ends or a stop is requested.
void DeliverAll(Feed& feed, const FeedSinks& sinks, Pacer& pacer,
                FeedSummary& summary) {
  while (const auto next = feed.Next()) {
    const Sample& sample = next->labelled.sample;
    if (!pacer.WaitUntilDue(sample.stamp_ns) ||
        (sinks.publisher != nullptr &&
         !sinks.publisher->Publish(next->valve, sample))) {
      return;
    }
    if (sinks.runs != nullptr) {
      sinks.runs->Append(next->valve, next->labelled);
    }
    if (sinks.csv != nullptr) {
      sinks.csv->Append(next->labelled);
    }
    ++summary.samples;
    Count(sample, summary.sources[next->valve]);
  }
}

}  // namespace

void Deliver(Feed& feed, const FeedSinks& sinks, Pacer pacer,
             cli::StopSignals& signals, FeedSummary& summary) {
  const auto start = std::chrono::steady_clock::now();
  try {
    DeliverAll(feed, sinks, pacer, summary);
  } catch (...) {
    // The readers still get what came before, and the end of the streams.
    if (sinks.publisher != nullptr) {
      sinks.publisher->Finish();
    }
    throw;
  }
  summary.interrupted = signals.stop_requested();
  if (sinks.publisher != nullptr) {
    summary.published = true;
    summary.lossless = sinks.publisher->lossless();
    summary.readers = sinks.publisher->readers();
    summary.acknowledged = sinks.publisher->Finish() && summary.readers > 0;
  }
  if (sinks.runs != nullptr) {
    sinks.runs->Close();
  }
  if (sinks.csv != nullptr) {
    sinks.csv->Close();
  }
  summary.elapsed_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start)
          .count();
}

void PrintSummary(const FeedSummary& summary,
                  const cli::GlobalOptions& options) {
  if (options.json) {
    PrintSummaryJson(summary);
    return;
  }
  using cli::Align;
  cli::TextTable table({{"valve"},
                        {"samples", Align::kRight},
                        {"time [s]", Align::kRight},
                        {"start"},
                        {"seed", Align::kRight},
                        {"run"}});
  for (const SourceSummary& source : summary.sources) {
    table.AddRow({source.valve_id, std::to_string(source.samples),
                  cli::FormatNumber(SpanOf(source), 0),
                  cli::FormatTime(source.first_stamp_ns, options.utc),
                  source.seed ? std::to_string(*source.seed) : "-",
                  source.run_id.empty() ? "-" : source.run_id});
  }
  table.Print(std::cout);
  std::cout << summary.samples << " samples"
            << (summary.published ? " published" : "") << " in "
            << cli::FormatNumber(summary.elapsed_s, 1) << " s"
            << (summary.interrupted ? ", stopped by a signal" : "")
            << Outcome(summary) << '\n';
}

int ExitCodeOf(const FeedSummary& summary) {
  const bool failed = summary.lossless && summary.readers > 0 &&
                      !summary.acknowledged && !summary.interrupted;
  return failed ? cli::kExitTransport : cli::kExitOk;
}

std::uint64_t NewSourceId() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32U) | random();
}

}  // namespace fdi::simulator
