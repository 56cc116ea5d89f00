#include "gateway/valve_wire.h"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <random>
#include <set>
#include <thread>
#include <utility>

#include "base/error.h"
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
                                                  static_cast<int>(room()))),
                   context.log, "fdi-gateway") {}

ValveWire::Writer& ValveWire::WriterOf(const std::string& group) {
  const std::string partition = options_.by_group ? PartitionOf(group) : "";
  auto& writer = writers_[partition];
  if (!writer) {
    writer = std::make_unique<Writer>(
        participant_,
        idl::PublisherOptions{
            options_.lossless ? idl::Profile::kLossless : idl::Profile::kLive,
            static_cast<int>(room()),
            partition.empty()
                ? ParsePartitions(context_.options.partition, false)
                : std::vector{partition}});
  }
  return *writer;
}

void ValveWire::Use(const std::vector<importer::LiveValve>& valves) {
  const auto former = std::exchange(valves_, {});
  std::set<const Writer*> used;
  for (const importer::LiveValve& valve : valves) {
    Writer& writer = WriterOf(valve.group);
    used.insert(&writer);
    const auto known = former.find(valve.id);
    const bool stays = known != former.end() && known->second.writer == &writer;
    valves_[valve.id] = {&writer,
                         stays ? known->second.source_id : NewSourceId()};
  }
  for (const auto& [valve_id, valve] : former) {
    const auto known = valves_.find(valve_id);
    if (known == valves_.end() || known->second.writer != valve.writer) {
      message_.valve_id = valve_id;
      valve.writer->Unregister(message_);
    }
  }
  Writers gone;
  for (auto next = writers_.begin(); next != writers_.end();) {
    const auto writer = next++;
    if (!used.contains(writer->second.get())) {
      gone.insert(writers_.extract(writer));
    }
  }
  AwaitAcknowledged(gone);
  flows_.clear();
}

void ValveWire::AwaitReader() {
  const auto end = std::chrono::steady_clock::now() + kFound;
  while (!signals_.stop_requested() && std::chrono::steady_clock::now() < end &&
         readers() == 0) {
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

void ValveWire::Publish(const std::string& valve_id, const Sample& sample) {
  const Valve& valve = valves_.at(valve_id);
  message_.valve_id = valve_id;
  message_.sample = sample;
  message_.sample.source_id = valve.source_id;
  ConvertFlow(valve_id, message_.sample);
  int looks = 0;
  while (!signals_.stop_requested()) {
    const auto result = valve.writer->Write(message_, {}, kLook);
    if (result == idl::WriteResult::kSent) {
      ++sent_;
      return;
    }
    if (!options_.lossless) {
      break;
    }
    if (result == idl::WriteResult::kTooManyValves) {
      // Its place is that of a valve whose end readers do not have yet, and
      // Write() does not wait for that.
      std::this_thread::sleep_for(kLook);
    }
    if (++looks == kStalled) {
      context_.log(LogLevel::kWarning,
                   EventLine("reader_behind",
                             {{"effect", "waiting until it takes samples"}}));
    }
  }
  ++not_sent_;
}

// As `fdi-simulator replay` does. A set that cannot be read is the monitor's to
// refuse, and no reason to withhold the samples of any valve.
void ValveWire::ConvertFlow(const std::string& valve_id, Sample& sample) {
  if (!sample.Has(Signal::kF)) {
    return;
  }
  auto known = flows_.find(valve_id);
  if (known == flows_.end()) {
    known = flows_.emplace(valve_id, std::nullopt).first;
    try {
      const storage::DataDirectory data{context_.options.data_dir};
      if (std::filesystem::exists(data.models())) {
        storage::ModelStore store(data.models());
        if (const auto set = store.AssignedModelSet(valve_id)) {
          known->second.emplace(simulator::FlowTargetOf(store.Load(*set)));
        }
      }
    } catch (const DataError& error) {
      context_.log(LogLevel::kWarning,
                   EventLine("flow_not_converted",
                             {{"valve", valve_id}, {"reason", error.what()}}));
    }
  }
  if (known->second) {
    known->second->Apply(sample);
  }
}

void ValveWire::AwaitAcknowledged(const Writers& writers) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  for (const auto& [partition, writer] : writers) {
    writer->WaitForAcknowledged(
        std::max(milliseconds(0), std::chrono::duration_cast<milliseconds>(
                                      end - std::chrono::steady_clock::now())));
  }
}

}  // namespace fdi::gateway
