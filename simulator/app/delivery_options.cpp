#include <CLI/CLI.hpp>

#include "diagnosis/error.h"
#include "idl/wire.h"
#include "simulator/app/verbs.h"
#include "storage/cli/time_text.h"

namespace fdi::simulator {

void AddDeliveryOptions(CLI::App& verb, DeliveryOptions& options) {
  verb.add_option("--speed", options.speed,
                  "Times real time, or max: without loss, as fast as the "
                  "reader takes it (default: 1)")
      ->type_name("N|max");
  verb.add_option("--start", options.start,
                  "UTC of the first sample (default: now)")
      ->type_name("UTC");
  verb.add_option("--wait-reader", options.wait_reader_s,
                  "Seconds to wait for a reader, without which nothing is "
                  "published (default: 30 at --speed max; otherwise 2, and "
                  "none is needed)")
      ->check(CLI::Range(0.0, 1e6))
      ->type_name("S");
  verb.add_flag("--keep-alive", options.keep_alive,
                "Do not end the streams: valves go stale instead");
}

SamplePublisherOptions PublisherOptionsOf(const DeliveryOptions& options,
                                          Speed speed) {
  SamplePublisherOptions publishing;
  publishing.lossless = speed.IsMax();
  publishing.needs_reader = speed.IsMax() || options.wait_reader_s > 0.0;
  publishing.wait_s = options.wait_reader_s;
  publishing.keep_alive = options.keep_alive;
  return publishing;
}

std::int64_t StartOf(const DeliveryOptions& options) {
  constexpr std::int64_t kMillisecond = 1'000'000;
  return options.start.empty() ? cli::NowNs() / kMillisecond * kMillisecond
                               : cli::ParseTime(options.start, true);
}

void RequireValveId(const std::string& valve_id) {
  try {
    idl::ValidateId(valve_id);
  } catch (const DataError& error) {
    throw ConfigError("valve '" + valve_id + "': " + error.what());
  }
}

}  // namespace fdi::simulator
