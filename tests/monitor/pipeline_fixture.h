#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "monitor/health_book.h"
#include "monitor/pipeline.h"
#include "monitor/recorder.h"
#include "tests/monitor/fake_sinks.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {

inline std::string ValveName(int v) {
  std::string name("V");
  return name += std::to_string(v);
}

/// A pipeline between sinks that a test holds up or breaks.
class PipelineTest : public testing::Test {
 protected:
  PipelineTest() {
    options_.journal.retry_period = std::chrono::milliseconds(20);
    options_.journal.commit_period = std::chrono::milliseconds(20);
    recorder_options_.commit_period = std::chrono::milliseconds(20);
  }

  void Make(SampleSink* samples = nullptr) {
    pipeline_ = std::make_unique<Pipeline>(
        options_, PipelineSinks{bus_, bus_, history_},
        std::make_shared<FixedResolver>(models_, assigned_), context_);
    pipeline_->Attach(std::make_unique<HealthBooks>(counters_));
    for (ValveListener* listener : listeners_) {
      pipeline_->Attach(*listener);
    }
    if (samples != nullptr) {
      recorder_ = std::make_unique<Recorder>(
          *samples, context_, recorder_options_,
          [this](DataGap gap) { pipeline_->ReportGap(std::move(gap)); });
      pipeline_->Attach(*recorder_);
    }
  }
  void Start(SampleSink* samples = nullptr) {
    Make(samples);
    if (recorder_) {
      recorder_->Start();
    }
    pipeline_->Start({});
  }
  void Stop() {
    if (recorder_) {
      recorder_->Stop();
    }
    pipeline_->Stop();
  }
  void Feed(const std::string& valve, std::uint64_t from, std::uint64_t to,
            double offset = 0.0) {
    for (std::uint64_t k = from; k < to; ++k) {
      pipeline_->OnSample(valve, PlantSample(k, offset), 1);
    }
  }
  void OfferEpisode(const std::string& valve) {
    Feed(valve, 0, 50);
    Feed(valve, 50, 80, kF7Offset);
  }
  bool AwaitEvents(std::size_t count) {
    return bus_.notice.Await([&] { return bus_.events.size() >= count; });
  }

  PipelineOptions options_;
  RecorderOptions recorder_options_;
  std::shared_ptr<const ModelSet> models_{SharedLinearModels()};
  std::vector<std::string> assigned_;
  FakeBus bus_;
  FakeHistory history_;
  std::vector<ValveListener*> listeners_;
  Counters counters_;
  std::vector<std::string> lines_;
  ThrottledLog log_{[this](LogLevel, std::string_view line) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    lines_.emplace_back(line);
  }};
  MonitorContext context_{counters_, log_, [] { return std::int64_t{1'000}; }};
  std::unique_ptr<Recorder> recorder_;
  std::unique_ptr<Pipeline> pipeline_;
};

}  // namespace fdi::monitor
