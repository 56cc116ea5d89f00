#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "storage/database/data_directory.h"
#include "storage/history/history_database.h"
#include "storage/history/history_editor.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "tests/storage/temporary_directory.h"

namespace fdi::storage {

/// An empty history.db, and one valve that falls ill.
class HistoryFixture : public testing::Test {
 protected:
  static constexpr std::int64_t kSecond = 1'000'000'000;
  /// 2026-11-20T14:56:11Z
  static constexpr std::int64_t kDetected = 1'795'186'571 * kSecond;
  static constexpr std::uint64_t kSource = 0xF00DULL;

  HistoryFixture() {
    models_.name = "demo";
    models_.version = 3;
    models_.content_hash = 0xFEDC'BA98'7654'3210ULL;
    models_.channels.resize(2);
    models_.channels[0].name = std::string("X");
    models_.channels[1].name = std::string("F");
    models_.faults = {1, 7, 19};
  }

  FaultEvent Event(TransitionKind kind, double after_s, FaultSet faults = 0,
                   double factor = 0.0, EndReason reason = EndReason::kNone,
                   const std::string& valve = "LV-1") const {
    Transition transition;
    transition.kind = kind;
    transition.stamp_ns = kDetected + static_cast<std::int64_t>(after_s * 1e9);
    transition.detection_stamp_ns = kDetected;
    transition.faults = faults;
    transition.factor = factor;
    transition.strength = 0.5;
    transition.reason = reason;
    FaultEvent event;
    event.valve_id = valve;
    event.source_id = kSource;
    event.episode_id = Id(valve);
    event.transition = transition;
    event.models = {std::shared_ptr<void>(), &models_};  // Not owned.
    return event;
  }

  static OperatorNote By(const std::string& who, std::int64_t now_ns,
                         const std::string& comment = "") {
    return {who, comment, "test", now_ns};
  }

  std::uint64_t Id(const std::string& valve = "LV-1") const {
    return EpisodeId(valve, kSource, kDetected);
  }

  /// The end of an episode that no engine knows any more.
  static FaultEvent End(std::uint64_t episode_id, std::int64_t stamp_ns) {
    FaultEvent event;
    event.episode_id = episode_id;
    event.transition.kind = TransitionKind::kClosed;
    event.transition.stamp_ns = stamp_ns;
    event.transition.reason = EndReason::kUnknown;
    return event;
  }

  /// The whole life of an episode that ends as fault bits `faults`.
  void RecordEpisode(HistoryWriter& writer, FaultSet faults,
                     const std::string& valve = "LV-1") {
    using Kind = TransitionKind;
    const auto none = EndReason::kNone;
    writer.Record(Event(Kind::kDetected, 0, 0, 0.3, none, valve), kDetected);
    writer.Record(Event(Kind::kIsolated, 20, faults, 0.8, none, valve),
                  kDetected);
    writer.Record(Event(Kind::kCleared, 90, faults, 0.1, none, valve),
                  kDetected);
    writer.Record(
        Event(Kind::kClosed, 91, faults, 0.1, EndReason::kCleared, valve),
        kDetected);
  }

  /// Plausible instant k, 1 Hz from `first_s` before or after detection.
  TracePoint Instant(int k, double first_s = 0.0) const {
    TracePoint instant;
    Sample& sample = instant.sample;
    sample.stamp_ns =
        kDetected + static_cast<std::int64_t>(first_s * 1e9) + k * kSecond;
    sample.source_id = kSource;
    sample.seq = static_cast<std::uint64_t>(k);
    sample.Set(Signal::kCv, 40.0 + std::sin(0.01 * k));
    sample.Set(Signal::kX, 39.5 + std::sin(0.01 * k - 0.1));
    sample.Set(Signal::kF, 120.0 - 0.1 * k);
    instant.quality = Quality::kLive;
    instant.state =
        sample.stamp_ns < kDetected ? State::kNormal : State::kDetected;
    instant.normal_factor = std::exp(-0.02 * k);
    instant.residuals = {0.01 * std::cos(k), -0.1 * k};
    instant.factors = {0.0, std::min(1.0, 0.001 * k), 1.0 / (k + 3.0)};
    return instant;
  }
  std::vector<TracePoint> Instants(int count, double first_s) const {
    std::vector<TracePoint> instants;
    for (int k = 0; k < count; ++k) {
      instants.push_back(Instant(k, first_s));
    }
    return instants;
  }

  /// The first column of the first row of plain SQL; "NULL" for that.
  std::string Sql(const std::string& query) const {
    Database database(path_, HistorySchema(), Access::kReader);
    Statement row = database.Prepare(query);
    if (!row.Step()) {
      return "no row";
    }
    return row.IsNull(0) ? "NULL" : row.Text(0);
  }

  TemporaryDirectory directory_;
  const std::filesystem::path path_ =
      DataDirectory{directory_.path()}.history();
  ModelSet models_;
};

}  // namespace fdi::storage
