#include "programs/simulator/sample_publisher.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "base/log.h"
#include "diagnosis/records/partitions.h"

namespace fdi::simulator {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

constexpr double kRequiredWaitS = 30.0;
constexpr double kOptionalWaitS = 2.0;
// Interval at which waits check for signals and for readers that have left.
constexpr milliseconds kLook(100);
constexpr int kStalled = 50;  // checks before a stall is logged
constexpr milliseconds kStopGrace(700);
constexpr milliseconds kLiveAcknowledge(2000);
constexpr milliseconds kLosslessAcknowledge(60'000);

idl::PublisherOptions WriterOptions(const SamplePublisherOptions& options,
                                    std::size_t valves,
                                    const std::string& partition) {
  return {options.lossless ? idl::Profile::kLossless : idl::Profile::kLive,
          static_cast<int>(valves), ParsePartitions(partition, false)};
}

std::string Seconds(double seconds) {
  std::string text = std::to_string(seconds);
  text.erase(text.find_last_not_of('0') + 1);
  return (text.back() == '.' ? text.substr(0, text.size() - 1) : text) + " s";
}

}  // namespace

idl::DdsOptions DdsOptionsOf(const report::GlobalOptions& options,
                             std::size_t valves) {
  idl::DdsOptions dds;
  dds.domain = options.domain;
  dds.interfaces = options.interface;
  dds.transport = options.transport;
  dds.qos_file = options.qos_file.string();
  dds.security = options.security.string();
  dds.max_valves = std::max(dds.max_valves, static_cast<int>(valves));
  idl::Validate(dds);
  return dds;
}

SamplePublisher::SamplePublisher(const SamplePublisherOptions& options,
                                 std::vector<std::string> valve_ids,
                                 const report::Context& context,
                                 report::StopSignals& signals)
    : options_(options),
      valve_ids_(std::move(valve_ids)),
      log_(context.log),
      signals_(signals),
      participant_(DdsOptionsOf(context.options, valve_ids_.size()), log_,
                   "fdi-simulator"),
      writer_(participant_, WriterOptions(options, valve_ids_.size(),
                                          context.options.partition)) {}

void SamplePublisher::AwaitReader() {
  const bool needed = options_.needs_reader;
  const double wait_s =
      options_.wait_s.value_or(needed ? kRequiredWaitS : kOptionalWaitS);
  const auto deadline =
      steady_clock::now() + std::chrono::duration_cast<milliseconds>(
                                std::chrono::duration<double>(wait_s));
  while (!writer_.WaitForReaders(1, kLook)) {
    participant_.RequireInterfaces();
    if (signals_.stop_requested()) {
      return;
    }
    if (steady_clock::now() < deadline) {
      continue;
    }
    const idl::DdsOptions& dds = participant_.options();
    const std::string where = "domain " + std::to_string(dds.domain) +
                              ", interface " + dds.interfaces;
    if (needed) {
      throw NoReaderError("nobody reads the samples (" + where +
                          "): no reader within " + Seconds(wait_s) +
                          "; start fdi-monitor, or wait longer with "
                          "--wait-reader S");
    }
    log_(LogLevel::kWarning,
         EventLine("no_reader",
                   {{"where", where}, {"effect", "samples go nowhere"}}));
    return;
  }
}

// A lossless writer tries a sample until there is room, so that the reader sets
// the pace. Otherwise a sample that finds no room is gone, as on a live bus.
bool SamplePublisher::Publish(std::size_t valve, const Sample& sample) {
  message_.valve_id = valve_ids_[valve];
  message_.sample = sample;
  participant_.RequireInterfaces();
  int looks = 0;
  while (!signals_.stop_requested()) {
    if (options_.needs_reader && readers() == 0) {
      log_(LogLevel::kWarning,
           EventLine("reader_left", {{"effect", "waiting for another"}}));
      AwaitReader();
      continue;
    }
    if (writer_.Write(message_, {}, kLook) == idl::WriteResult::kSent ||
        !options_.lossless) {
      return true;
    }
    if (++looks == kStalled) {
      log_(LogLevel::kWarning,
           EventLine("reader_behind",
                     {{"effect", "waiting until it takes samples"}}));
    }
  }
  return false;
}

// A stop shortens the wait and does not end it: the last samples are on their
// way.
bool SamplePublisher::AwaitAcknowledged() {
  auto deadline = steady_clock::now() +
                  (options_.lossless ? kLosslessAcknowledge : kLiveAcknowledge);
  bool stopping = false;
  while (!writer_.WaitForAcknowledged(kLook)) {
    if (signals_.stop_requested() && !stopping) {
      stopping = true;
      deadline = std::min(deadline, steady_clock::now() + kStopGrace);
    }
    if (writer_.status().matched == 0 || steady_clock::now() >= deadline) {
      return false;
    }
  }
  return true;
}

// The streams end after their samples have arrived. After a stop that left some
// unacknowledged they are not ended, because that would be waited for, too.
bool SamplePublisher::Finish() {
  bool complete = AwaitAcknowledged();
  const bool giving_up = !complete && signals_.stop_requested();
  if (!options_.keep_alive && !giving_up) {
    for (const std::string& valve_id : valve_ids_) {
      message_.valve_id = valve_id;
      writer_.Dispose(message_);
    }
    complete = AwaitAcknowledged() && complete;
  }
  if (!complete) {
    log_(LogLevel::kWarning,
         EventLine("not_acknowledged",
                   {{"effect", "readers may lack the last samples"}}));
  }
  return complete;
}

}  // namespace fdi::simulator
