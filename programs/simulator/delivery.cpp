#include "programs/simulator/delivery.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/text.h"
#include "base/time_text.h"
#include "idl/wire.h"
#include "import/csv.h"
#include "report/text_table.h"

namespace fdi::simulator {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

// At full speed samples are committed by number rather than by time.
constexpr std::int64_t kMaxPending = 50'000;
constexpr milliseconds kCommitPeriod(750);  // Bounds the loss to less than 1 s.

std::filesystem::path Prepared(const storage::DataDirectory& directory) {
  storage::EnsureExists(directory);
  return directory.runs();
}

// Delays samples until they are due.
class Pacer {
 public:
  Pacer(double speed, report::StopSignals& signals)
      : speed_(speed), signals_(signals) {}

  // @returns false if a stop was requested.
  bool WaitUntilDue(std::int64_t stamp_ns) {
    if (!first_stamp_ns_) {
      first_stamp_ns_ = stamp_ns;
      start_ = steady_clock::now();
    }
    while (!signals_.stop_requested()) {
      const std::chrono::duration<double, std::nano> offset(
          static_cast<double>(stamp_ns - *first_stamp_ns_) / speed_);
      const auto left = offset - (steady_clock::now() - start_);
      if (std::isinf(speed_) || left.count() <= 0.0) {
        return true;
      }
      constexpr milliseconds kMaxWait(60'000);
      signals_.WaitFor(std::min(
          kMaxWait,
          std::chrono::duration_cast<milliseconds>(left) + milliseconds(1)));
    }
    return false;
  }

 private:
  double speed_;
  report::StopSignals& signals_;
  std::optional<std::int64_t> first_stamp_ns_;
  steady_clock::time_point start_;
};

// Delivers samples until the feed ends or a stop is requested. A sample is
// published first: what nobody could have received is not recorded either.
void DeliverAll(Feed& feed, const FeedSinks& sinks, Pacer pacer,
                std::vector<FedValve>& valves) {
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
    FedValve& valve = valves[next->valve];
    if (valve.samples++ == 0) {
      valve.first_stamp_ns = sample.stamp_ns;
    }
    valve.last_stamp_ns = sample.stamp_ns;
  }
}

report::Json RowOf(const FedValve& valve) {
  report::Json row;
  row["valve_id"] = valve.valve_id;
  row["source_id"] = Hex16(valve.source_id);
  row["samples"] = valve.samples;
  row["start_utc"] = valve.samples > 0
                         ? report::Json(FormatTime(valve.first_stamp_ns, true))
                         : report::Json();
  row["duration_s"] =
      static_cast<double>(valve.last_stamp_ns - valve.first_stamp_ns) / 1e9;
  if (valve.seed) {
    row["seed"] = *valve.seed;
  }
  if (!valve.run_id.empty()) {
    row["run_id"] = valve.run_id;
  }
  return row;
}

// "600 samples published in 1.2 s, nobody listened".
std::string Conclusion(const report::Json& document, bool published) {
  std::string text =
      std::to_string(document["samples"].get<std::uint64_t>()) + " samples" +
      (published ? " published" : "") + " in " +
      report::FormatNumber(document["elapsed_s"].get<double>(), 1) + " s";
  if (document["interrupted"].get<bool>()) {
    text += ", stopped by a signal";
  }
  if (published && !document["acknowledged"].get<bool>()) {
    text += document["readers"] == 0 ? ", nobody listened"
                                     : ", not acknowledged by all readers";
  }
  return text;
}

}  // namespace

void AddDeliveryOptions(CLI::App& verb, DeliveryOptions& options) {
  verb.add_option("--speed", options.speed,
                  "Speed in multiples of real time, or max: as fast as the "
                  "reader takes the samples, without loss (default: 1)")
      ->type_name("N|max");
  verb.add_option("--start", options.start,
                  "UTC of the first sample (default: so early that no stamp is "
                  "ahead of the clock)")
      ->type_name("UTC");
  verb.add_option("--wait-reader", options.wait_reader_s,
                  "Seconds to wait for a reader (default: 30 at --speed max, "
                  "which needs one; otherwise 2, after which the samples are "
                  "published all the same)")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("S");
  verb.add_flag("--keep-alive", options.keep_alive,
                "Do not end the streams: valves go stale instead");
}

std::int64_t StartOf(const DeliveryOptions& options, double duration_s,
                     double speed) {
  constexpr std::int64_t kMillisecond = 1'000'000;
  if (!options.start.empty()) {
    return ParseTime(options.start, true);
  }
  // Slower than real time no stamp is ahead of the clock.
  const double ahead_s = duration_s * std::max(0.0, 1.0 - 1.0 / speed);
  return (NowNs() / kMillisecond - std::llround(1e3 * ahead_s)) * kMillisecond;
}

double ParseSpeed(std::string_view text) {
  if (text == "max") {
    return std::numeric_limits<double>::infinity();
  }
  constexpr double kSlowest = 1e-3;
  constexpr double kFastest = 1e6;
  const double speed = ParseWhole<double>(text).value_or(0.0);
  if (!(speed >= kSlowest && speed <= kFastest)) {
    throw ConfigError("speed '" + std::string(text) +
                      "': expected a number in 0.001..1000000 (1 is real "
                      "time) or max");
  }
  return speed;
}

SamplePublisherOptions PublisherOptionsOf(const DeliveryOptions& options,
                                          double speed) {
  SamplePublisherOptions publishing;
  publishing.lossless = std::isinf(speed);
  publishing.needs_reader = std::isinf(speed) || options.wait_reader_s > 0.0;
  publishing.wait_s = options.wait_reader_s;
  publishing.keep_alive = options.keep_alive;
  return publishing;
}

void RequireValveId(const std::string& valve_id) {
  try {
    idl::ValidateId(valve_id);
  } catch (const DataError& error) {
    throw ConfigError("valve '" + valve_id + "': " + error.what());
  }
}

std::uint64_t NewSourceId() {
  std::random_device random;
  return (static_cast<std::uint64_t>(random()) << 32U) | random();
}

RunSink::RunSink(const storage::DataDirectory& directory)
    : recorder_(Prepared(directory)), last_commit_(steady_clock::now()) {}

std::string RunSink::Begin(const storage::NewRun& run) {
  keys_.push_back(recorder_.Begin(run));
  return recorder_.Id(keys_.back());
}

void RunSink::Append(std::size_t valve, const LabelledSample& sample) {
  recorder_.Append(keys_[valve], sample);
  const auto now = steady_clock::now();
  if (now - last_commit_ >= kCommitPeriod ||
      recorder_.pending() >= kMaxPending) {
    recorder_.Commit();
    last_commit_ = now;
  }
}

CsvSink::CsvSink(const std::filesystem::path& path) : file_(path) {
  if (!file_) {
    throw DataError(path.string() +
                    " cannot be written: " + std::strerror(errno));
  }
}

void CsvSink::Close() {
  if (!samples_.empty()) {
    importer::WriteCsv(file_, samples_, samples_.front().sample.flow_unit,
                       samples_.front().sample.stamp_ns);
  }
}

report::Report Deliver(Feed& feed, const FeedSinks& sinks, double speed,
                       report::StopSignals& signals,
                       std::vector<FedValve> valves) {
  const auto start = steady_clock::now();
  SamplePublisher* const publisher = sinks.publisher.get();
  try {
    DeliverAll(feed, sinks, Pacer(speed, signals), valves);
  } catch (...) {
    // The readers still get the earlier samples, and the end of the streams.
    if (publisher != nullptr) {
      publisher->Finish();
    }
    throw;
  }
  const bool interrupted = signals.stop_requested();
  const int readers = publisher == nullptr ? 0 : publisher->readers();
  const bool acknowledged =
      publisher != nullptr && publisher->Finish() && readers > 0;
  if (sinks.runs != nullptr) {
    sinks.runs->Close();
  }
  if (sinks.csv != nullptr) {
    sinks.csv->Close();
  }

  report::Report report;
  report::Json& document = report.document;
  report::Json rows = report::Json::array();
  std::uint64_t samples = 0;
  for (const FedValve& valve : valves) {
    rows.push_back(RowOf(valve));
    samples += valve.samples;
  }
  document["samples"] = samples;
  document["published"] = publisher == nullptr ? 0 : samples;
  document["readers"] = readers;
  document["acknowledged"] = acknowledged;
  document["interrupted"] = interrupted;
  document["elapsed_s"] =
      std::chrono::duration<double>(steady_clock::now() - start).count();
  document["sources"] = std::move(rows);
  const bool failed = publisher != nullptr && publisher->lossless() &&
                      readers > 0 && !acknowledged && !interrupted;
  report.exit_code = failed ? report::kExitTransport : report::kExitOk;
  report.Table(
      "sources",
      {{.heading = "valve", .key = "valve_id"},
       {.heading = "samples", .key = "samples"},
       {.heading = "time [s]", .key = "duration_s", .decimals = 0},
       {.heading = "start",
        .key = "start_utc",
        .format = report::Format::kTime},
       {.heading = "seed", .key = "seed", .align = report::Align::kRight},
       {.heading = "run", .key = "run_id"}});
  report.Line(Conclusion(document, publisher != nullptr));
  return report;
}

}  // namespace fdi::simulator
