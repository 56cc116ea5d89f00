#include "monitor/pipeline.h"

#include <utility>

namespace fdi::monitor {
namespace {

constexpr std::size_t kMaxIdLength = 64;
constexpr std::chrono::milliseconds kTick{100};
constexpr std::chrono::milliseconds kTendPeriod{250};
constexpr std::size_t kBeatItems = 64;

// In the order of Intake.
constexpr std::array<LogId, kIntakeCount> kRejectionIds{
    LogId::kRange /* accepted: never used */,
    LogId::kRepeat,
    LogId::kLate,
    LogId::kSuperseded,
    LogId::kBadQuality,
    LogId::kNotFinite,
    LogId::kRange,
    LogId::kUnit,
    LogId::kPeriod};

SampleRecorderOptions RecorderOptionsOf(const PipelineOptions& options) {
  SampleRecorderOptions recorder = options.recorder;
  recorder.utc_now_ns = options.history.utc_now_ns;
  return recorder;
}

}  // namespace

Pipeline::Pipeline(PipelineOptions options, PipelineSinks sinks,
                   std::shared_ptr<const ModelResolver> resolver,
                   Counters& counters, ThrottledLog& log)
    : options_(std::move(options)),
      decisions_(sinks.decisions),
      live_(sinks.live),
      counters_(counters),
      log_(log),
      writer_(sinks.history, sinks.events, counters, log, options_.history),
      recorder_(sinks.samples != nullptr
                    ? std::make_unique<SampleRecorder>(
                          *sinks.samples, counters, log,
                          RecorderOptionsOf(options_),
                          [this](DataGap gap) { writer_.Gap(std::move(gap)); })
                    : nullptr),
      directory_(options_.max_valves, options_.valve_glob),
      registry_(options_.registry, std::move(resolver), writer_, counters, log,
                sinks.live),
      shadow_(options_.shadow.candidate
                  ? std::make_unique<ShadowBank>(options_.shadow, log)
                  : nullptr),
      queue_(options_.queue_samples),
      last_tend_(std::chrono::steady_clock::now()),
      last_checkpoint_(last_tend_) {}

Pipeline::~Pipeline() {
  Stop();
}

void Pipeline::Start(const std::vector<OpenEpisode>& open,
                     std::vector<Accumulator> accumulators,
                     std::vector<Accumulator> shadow_accumulators) {
  if (shadow_) {
    shadow_->Restore(std::move(shadow_accumulators));
  }
  registry_.Recover(open, std::move(accumulators),
                    std::chrono::steady_clock::now());
  thread_ = std::thread([this] { Run(); });
}

std::optional<ValveDirectory::Entry> Pipeline::Admit(
    std::string_view valve_id) {
  if (valve_id.empty() || valve_id.size() > kMaxIdLength) {
    counters_.Add(Counter::kBadIds);
    log_.Report(LogId::kBadId, "sample_rejected", [&] {
      return "reason=valve_id length=" + std::to_string(valve_id.size());
    });
    return std::nullopt;
  }
  ValveDirectory::Entry entry{};
  switch (directory_.Find(valve_id, entry)) {
    case ValveDirectory::Answer::kServed:
      return entry;
    case ValveDirectory::Answer::kFiltered:
      counters_.Add(Counter::kFilteredSamples);
      return std::nullopt;
    case ValveDirectory::Answer::kRefused:
      counters_.Add(Counter::kRefusedSamples);
      log_.Report(LogId::kValveRefused, "valve_refused", [&] {
        return "valve=" + std::string(valve_id) +
               " max_valves=" + std::to_string(options_.max_valves) +
               " refused_valves=" + std::to_string(directory_.refused());
      });
      return std::nullopt;
  }
  return std::nullopt;
}

bool Pipeline::Offer(std::string_view valve_id, const Sample& sample,
                     std::uint64_t writer) {
  counters_.Add(Counter::kReceived);
  const std::optional<ValveDirectory::Entry> entry = Admit(valve_id);
  if (!entry) {
    return !failed_;
  }
  return queue_.PushQuietly(
      Item{*entry, writer, std::chrono::steady_clock::now(), false, sample});
}

bool Pipeline::OfferEnd(std::string_view valve_id, std::uint64_t writer) {
  const std::optional<ValveDirectory::Entry> entry = Admit(valve_id);
  if (!entry) {
    return !failed_;
  }
  return queue_.PushQuietly(
      Item{*entry, writer, std::chrono::steady_clock::now(), true, Sample{}});
}

Pipeline::Backlog Pipeline::backlog() const {
  return {queue_.size(), recorder_ ? recorder_->waiting() : 0,
          writer_.backlog()};
}

std::vector<Heartbeat::Member> Pipeline::threads() const {
  std::vector<Heartbeat::Member> threads{{"diagnosis", &pulse_},
                                         {"history", &writer_.pulse()}};
  if (recorder_) {
    threads.push_back({"recorder", &recorder_->pulse()});
  }
  return threads;
}

void Pipeline::Reassign(std::shared_ptr<const ModelResolver> resolver) {
  const std::lock_guard lock(resolver_mutex_);
  next_resolver_ = std::move(resolver);
  queue_.Wake();
}

void Pipeline::Stop() {
  queue_.Close();
  if (thread_.joinable()) {
    thread_.join();
  }
  if (recorder_) {
    recorder_->Stop();
  }
  writer_.Stop();
}

void Pipeline::Rethrow() const {
  if (failed_) {
    std::rethrow_exception(error_);
  }
}

void Pipeline::Run() {
  try {
    Diagnose();
  } catch (...) {
    error_ = std::current_exception();
    failed_ = true;
    queue_.Close();
  }
}

void Pipeline::Diagnose() {
  std::vector<Item> batch;
  while (queue_.PopAll(batch, kTick)) {
    pulse_.Beat();
    AdoptPendingResolver();
    if (decisions_.WantsLast()) {
      registry_.PublishLast(decisions_);
    }
    for (std::size_t i = 0; i < batch.size(); ++i) {
      Handle(batch[i]);
      if (i % kBeatItems == 0) {
        pulse_.Beat();
      }
    }
    // While samples wait, silence is measured up to the newest one handled.
    const TimePoint now = batch.empty() ? std::chrono::steady_clock::now()
                                        : batch.back().received;
    if (now - last_tend_ >= kTendPeriod) {
      last_tend_ = now;
      registry_.Tend(now, options_.history.utc_now_ns());
    }
    if (now - last_checkpoint_ >= options_.checkpoint_period) {
      last_checkpoint_ = now;
      TakeCheckpoint();
    }
  }
  registry_.Tend(std::chrono::steady_clock::now(),
                 options_.history.utc_now_ns());
  registry_.Flush();
  TakeCheckpoint();
}

void Pipeline::TakeCheckpoint() {
  Checkpoint checkpoint = registry_.TakeCheckpoint();
  if (shadow_) {
    shadow_->TakeTo(checkpoint);
  }
  writer_.Keep(std::move(checkpoint));
}

void Pipeline::AdoptPendingResolver() {
  std::shared_ptr<const ModelResolver> next;
  {
    const std::lock_guard lock(resolver_mutex_);
    next = std::exchange(next_resolver_, nullptr);
  }
  if (next) {
    registry_.Reassign(std::move(next));
  }
}

void Pipeline::Handle(const Item& item) {
  if (item.ended) {
    HandleEnd(item);
    return;
  }
  const ValveOutcome outcome =
      registry_.Step(item.valve, item.sample, item.writer, item.received);
  const Verdict& verdict = outcome.verdict;
  if (shadow_) {
    shadow_->Step(item.valve, item.sample, outcome);
  }
  counters_.Add(outcome.models != nullptr ? Counter::kDiagnosed
                                          : Counter::kUnassigned);
  counters_.Add(verdict.intake);
  if (verdict.initialised) {
    counters_.Add(Counter::kInitialisations);
  }
  if (CountsAsTime(verdict)) {
    counters_.Add(verdict.quality);
  }
  if (verdict.intake != Intake::kAccepted) {
    CountRejection(item, verdict.intake);
  }
  if (!OutOfOrder(verdict.intake)) {
    Publish(item, outcome);
    if (live_ != nullptr) {
      live_->Show(*item.valve.name, item.sample, outcome.models, verdict,
                  outcome.model_swapped);
    }
  }
  if (recorder_) {
    recorder_->Record({*item.valve.name, item.sample, verdict.intake,
                       verdict.initialised, outcome.model_swapped, false});
  }
}

void Pipeline::HandleEnd(const Item& item) {
  if (!registry_.EndStream(item.valve, item.writer)) {
    return;
  }
  if (shadow_) {
    shadow_->EndStream(item.valve);
  }
  if (recorder_) {
    recorder_->Record({*item.valve.name, {}, {}, false, false, true});
  }
  if (live_ != nullptr) {
    live_->ShowSilence(*item.valve.name, Silence::kEnded);
  }
}

void Pipeline::Publish(const Item& item, const ValveOutcome& outcome) {
  if (decisions_.Publish(*item.valve.name, outcome.models, outcome.verdict)) {
    counters_.Add(Counter::kDecisions);
    return;
  }
  counters_.Add(Counter::kDecisionsUnsent);
  log_.Report(LogId::kUnsent, "publication_failed", [&item] {
    return "topic=DecisionVector valve=" + *item.valve.name;
  });
}

void Pipeline::CountRejection(const Item& item, Intake intake) {
  log_.Report(kRejectionIds[static_cast<std::size_t>(intake)],
              "sample_rejected", [&] {
                return "reason=" + std::string(IntakeName(intake)) +
                       " valve=" + *item.valve.name +
                       " seq=" + std::to_string(item.sample.seq);
              });
}

}  // namespace fdi::monitor
