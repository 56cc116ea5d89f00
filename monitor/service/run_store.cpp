#include "monitor/service/run_store.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace fdi::monitor {
namespace {

constexpr std::size_t kStreamsOfAValve = 2;
constexpr std::int64_t kRunLengthNs = 86'400'000'000'000;

storage::StoredSample ToStored(const ReceivedSample& received) {
  storage::StoredSample stored;
  stored.sample = received.sample;
  stored.intake = received.intake;
  stored.initialised = received.initialised;
  stored.model_swapped = received.model_swapped;
  return stored;
}

// Sample period derived from two samples of a source, allowing for lost ones
// between them; 1 s if they are out of order.
double PeriodBetween(const Sample& first, const Sample& second) {
  if (second.seq <= first.seq || second.stamp_ns <= first.stamp_ns) {
    return 1.0;
  }
  return static_cast<double>(second.stamp_ns - first.stamp_ns) /
         static_cast<double>(second.seq - first.seq) / 1e9;
}

}  // namespace

RunStore::RunStore(const std::filesystem::path& path, std::string software)
    : software_(std::move(software)), recorder_(path) {}

void RunStore::Append(const ReceivedSample& sample) {
  if (sample.ended) {
    if (const auto found = valves_.find(sample.valve_id);
        found != valves_.end()) {
      for (Stream& stream : found->second) {
        End(found->first, stream);
      }
      valves_.erase(found);
    }
    return;
  }
  Streams& streams = valves_[sample.valve_id];
  const storage::StoredSample stored = ToStored(sample);
  const auto known = std::find_if(
      streams.begin(), streams.end(), [&sample](const Stream& stream) {
        return stream.source_id == sample.sample.source_id;
      });
  if (known != streams.end()) {
    AppendTo(sample.valve_id, *known, stored);
    return;
  }
  if (streams.size() >= kStreamsOfAValve) {
    End(sample.valve_id, streams.front());
    streams.erase(streams.begin());
  }
  streams.push_back({sample.sample.source_id, std::nullopt, stored});
}

void RunStore::AppendTo(const std::string& valve_id, Stream& stream,
                        const storage::StoredSample& sample) {
  if (!stream.run) {
    Begin(valve_id, stream, PeriodBetween(stream.first.sample, sample.sample));
  }
  if (sample.intake == Intake::kAccepted &&
      sample.sample.stamp_ns - stream.start_ns >= kRunLengthNs) {
    recorder_.End(*stream.run);
    stream.first = sample;
    Begin(valve_id, stream, stream.period_s);
    return;
  }
  recorder_.Append(*stream.run, sample);
}

void RunStore::Begin(const std::string& valve_id, Stream& stream,
                     double period_s) {
  storage::NewRun run;
  run.valve_id = valve_id;
  run.source_id = stream.source_id;
  run.start_ns = stream.first.sample.stamp_ns;
  run.period_s = period_s;
  run.flow_unit = stream.first.sample.flow_unit;
  run.origin = storage::RunOrigin::kRecorded;
  run.software = software_;
  stream.start_ns = run.start_ns;
  stream.period_s = period_s;
  stream.run = recorder_.Begin(run);
  recorder_.Append(*stream.run, stream.first);
}

void RunStore::End(const std::string& valve_id, Stream& stream) {
  if (!stream.run) {
    Begin(valve_id, stream, 1.0);
  }
  recorder_.End(*stream.run);
}

void RunStore::Commit() {
  if (recorder_.Refresh()) {
    throw std::runtime_error(recorder_.database().path().string() +
                             " was deleted or replaced: recording goes on in "
                             "the file that has its name now");
  }
  recorder_.Commit();
}

std::uint64_t RunStore::DropPending() {
  return static_cast<std::uint64_t>(recorder_.DropPending());
}

void RunStore::Close() {
  for (auto& [valve_id, streams] : valves_) {
    for (Stream& stream : streams) {
      End(valve_id, stream);
    }
  }
  valves_.clear();
  recorder_.Refresh();
  recorder_.Close();
}

std::uint64_t RunStore::recorded() const {
  return static_cast<std::uint64_t>(recorder_.recorded());
}

}  // namespace fdi::monitor
