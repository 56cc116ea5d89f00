#include "monitor/service/run_store.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/usual_period.h"

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

// So many steps show the period, whatever gaps and jitter are among them.
constexpr std::size_t kPeriodSteps = 32;

// From one sample of a source to another one [s], allowing for lost ones
// between them; nothing if they are out of order.
std::optional<double> StepBetween(const Sample& first, const Sample& second) {
  if (second.seq <= first.seq || second.stamp_ns <= first.stamp_ns) {
    return std::nullopt;
  }
  return static_cast<double>(second.stamp_ns - first.stamp_ns) /
         static_cast<double>(second.seq - first.seq) / 1e9;
}

// The period of a stream with these steps, 1 s without any. One that keeps its
// step is taken at its word; jitter blurs a round one. (One step may be
// either.)
double PeriodOf(const std::vector<double>& steps) {
  if (steps.empty()) {
    return 1.0;
  }
  const auto [least, most] = std::minmax_element(steps.begin(), steps.end());
  const double median = ShorterMedian(steps);
  const bool steady = steps.size() > 1 && *most - *least <= 1e-6 * median;
  return steady ? median : UsualPeriod(median);
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
  Stream& stream = streams.emplace_back();
  stream.source_id = sample.sample.source_id;
  stream.first = stored;
  stream.last = sample.sample;
}

void RunStore::AppendTo(const std::string& valve_id, Stream& stream,
                        const storage::StoredSample& sample) {
  if (!stream.run) {
    const auto step = StepBetween(stream.first.sample, sample.sample);
    Begin(valve_id, stream, step ? PeriodOf({*step}) : 1.0);
  }
  AddStep(stream, sample);
  if (sample.intake == Intake::kAccepted &&
      sample.sample.stamp_ns - stream.start_ns >= kRunLengthNs) {
    recorder_.End(*stream.run);
    stream.first = sample;
    Begin(valve_id, stream, stream.period_s);
    return;
  }
  recorder_.Append(*stream.run, sample);
}

// A run that begins with a late sample or a jump gets its period later on.
void RunStore::AddStep(Stream& stream, const storage::StoredSample& sample) {
  if (stream.steps.size() >= kPeriodSteps) {
    return;
  }
  if (const auto step = StepBetween(stream.last, sample.sample)) {
    stream.steps.push_back(*step);
    if (const double period_s = PeriodOf(stream.steps);
        period_s != std::exchange(stream.period_s, period_s)) {
      recorder_.SetPeriod(*stream.run, period_s);
    }
  }
  stream.last = sample.sample;
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
