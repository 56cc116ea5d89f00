#include "gateway/valve_wire.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <random>
#include <utility>

#include "base/log.h"
#include "diagnosis/records/partitions.h"
#include "monitor/bus/dds_options.h"
#include "simulator/second_look/valve_physics.h"
#include "storage/database/data_directory.h"
#include "storage/models/models.h"

namespace fdi::gateway {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLook(100);
constexpr milliseconds kPatience(2000);
// Longer than a reader that runs takes to be found on a busy machine.
constexpr milliseconds kFound(5000);
// Looks before a reader that is behind is said.
constexpr int kStalled = 50;

// A table that is read again may have more rows.
int Room(std::size_t valves) {
  return static_cast<int>(2 * valves + 100);
}

// The letters that --partition accepts.
std::string PartitionOf(const std::string& group) {
  std::string name = group.substr(0, 30);
  std::ranges::replace_if(
      name,
      [](unsigned char c) {
        return std::isalnum(c) == 0 &&
               std::string_view("-_./").find(static_cast<char>(c)) ==
                   std::string_view::npos;
      },
      '_');
  return name;
}

std::uint64_t NewSourceId() {
  std::random_device random;
  return (std::uint64_t{random()} << 32U) | random();
}

}  // namespace

ValveWire::ValveWire(const ValveWireOptions& options,
                     const report::Context& context,
                     report::StopSignals& signals)
    : options_(options),
      context_(context),
      signals_(signals),
      participant_(monitor::DdsOptionsOf(context.options,
                                         std::max(idl::DdsOptions{}.max_valves,
                                                  Room(options.valves))),
                   context.log, "fdi-gateway") {
  if (!options_.by_group) {
    WriterOf("");
  }
}

ValveWire::Writer& ValveWire::WriterOf(const std::string& group) {
  const std::string partition =
      options_.by_group && !group.empty() ? PartitionOf(group) : "";
  auto& writer = writers_[partition];
  if (!writer) {
    writer = std::make_unique<Writer>(
        participant_,
        idl::PublisherOptions{
            options_.lossless ? idl::Profile::kLossless : idl::Profile::kLive,
            Room(options_.valves),
            partition.empty()
                ? ParsePartitions(context_.options.partition, false)
                : std::vector{partition}});
  }
  return *writer;
}

void ValveWire::AwaitReader() {
  const auto end = std::chrono::steady_clock::now() + kFound;
  while (!signals_.stop_requested() && std::chrono::steady_clock::now() < end &&
         readers() == 0) {
    if (writers_.empty()) {
      return;  // Writers of groups come with their first samples.
    }
    writers_.begin()->second->WaitForReaders(1, kLook);
  }
  if (readers() == 0) {
    context_.log(LogLevel::kWarning,
                 EventLine("no_reader", {{"effect", "samples go nowhere"}}));
  }
}

int ValveWire::readers() const {
  int most = 0;
  for (const auto& [partition, writer] : writers_) {
    most = std::max(most, writer->matched());
  }
  return most;
}

bool ValveWire::Publish(const std::string& valve_id, const std::string& group,
                        const Sample& sample) {
  auto known = valves_.find(valve_id);
  if (known == valves_.end()) {
    known =
        valves_.emplace(valve_id, Valve{&WriterOf(group), NewSourceId()}).first;
  }
  message_.valve_id = valve_id;
  message_.sample = sample;
  message_.sample.source_id = known->second.source_id;
  ConvertFlow(valve_id, message_.sample);
  int looks = 0;
  while (!signals_.stop_requested()) {
    if (known->second.writer->Write(message_, {}, kLook) ==
        idl::WriteResult::kSent) {
      ++sent_;
      return true;
    }
    if (!options_.lossless) {
      break;
    }
    if (++looks == kStalled) {
      context_.log(LogLevel::kWarning,
                   EventLine("reader_behind",
                             {{"effect", "waiting until it takes samples"}}));
    }
  }
  ++not_sent_;
  return false;
}

// As `fdi-simulator replay` does. A set that cannot be read is the monitor's to
// refuse.
void ValveWire::ConvertFlow(const std::string& valve_id, Sample& sample) {
  if (!sample.Has(Signal::kF)) {
    return;
  }
  auto known = flows_.find(valve_id);
  if (known == flows_.end()) {
    known = flows_.emplace(valve_id, std::nullopt).first;
    const storage::DataDirectory data{context_.options.data_dir};
    if (std::filesystem::exists(data.models())) {
      storage::ModelStore store(data.models());
      if (const auto set = store.AssignedModelSet(valve_id)) {
        known->second.emplace(simulator::FlowTargetOf(store.Load(*set)));
      }
    }
  }
  if (known->second) {
    known->second->Apply(sample);
  }
}

void ValveWire::End(const std::string& valve_id) {
  if (const auto known = valves_.find(valve_id); known != valves_.end()) {
    message_.valve_id = valve_id;
    known->second.writer->Unregister(message_);
    valves_.erase(known);
  }
}

void ValveWire::Finish() {
  for (const auto& [partition, writer] : writers_) {
    writer->WaitForAcknowledged(kPatience);
  }
}

}  // namespace fdi::gateway
