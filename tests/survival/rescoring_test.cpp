// A recorded run, scored again by fdi-study, gives bit for bit what the live
// monitor published over DDS. Left out: a restarted monitor, which resumes its
// slow accumulators, and valves whose isolation is held.

#include <csignal>
#include <cstdio>
#include <fstream>
#include <limits>
#include <map>
#include <random>
#include <sstream>

#include <gtest/gtest.h>

#include "diagnosis/model/fault_catalogue.h"
#include "storage/runs/runs.h"
#include "tests/survival/kill_rounds.h"
#include "tests/system/monitor_fixture.h"

namespace fdi::monitor {
namespace {

constexpr int kValves = 20;
constexpr std::uint64_t kSamples = 400;
constexpr std::uint64_t kSwapAt = 220;
constexpr std::uint64_t kSource = 1;

using Key = std::tuple<std::string, std::uint64_t, std::int64_t>;

std::string Hex(double value) {
  char text[40];
  std::snprintf(text, sizeof text, ",%a", value);
  return text;
}

// As a line of `evaluate --vectors`, from `intake` on.
std::string TextOf(const idl::DecisionMessage& m, const ModelSet& models) {
  const Verdict& v = m.verdict;
  std::string text = std::string(IntakeName(v.intake)) +
                     (v.initialised ? ",1," : ",0,") +
                     std::string(QualityName(v.quality)) + ',' +
                     std::string(StateName(v.state));
  for (std::size_t c = 0; c < models.channels.size(); ++c) {
    text += Hex(v.residuals[c]);
  }
  text += Hex(v.normal_factor);
  for (std::size_t f = 0; f < models.faults.size(); ++f) {
    text += Hex(v.fault_factors[f]);
  }
  std::string isolated;
  for (std::size_t f = 0; f < models.faults.size(); ++f) {
    if ((v.isolated >> f & 1U) != 0) {
      isolated += (isolated.empty() ? "" : "|") + FaultName(models.faults[f]);
    }
  }
  text += ',' + isolated;
  for (std::size_t o = 0; o < models.observers.size(); ++o) {
    text += Hex(v.observer_factors[o]);
  }
  return text;
}

class RescoringTest : public MonitorFixture {
 protected:
  // Sample k of a valve, noisy and sometimes faulty, so that no two are alike.
  Sample Reading(int valve, std::uint64_t k) {
    const bool faulty = k % 150 > 80 + static_cast<std::uint64_t>(valve);
    Sample sample = PlantSample(k, faulty ? kF7Offset : 0.0, kSource);
    std::normal_distribution<double> noise(0.0, 0.7);
    sample.Set(Signal::kCv, 50.0 + 10.0 * noise(random_));
    sample.Set(Signal::kX, sample.values[Index(Signal::kCv)] +
                               (faulty ? kF7Offset : 0.0) + noise(random_));
    return sample;
  }

  // Publishes sample k of valve `v`: rejected samples and gaps included.
  void PublishInstant(int v, std::uint64_t k) {
    const std::string valve = "V" + std::to_string(v);
    const Sample sample = Reading(v, k);
    const std::uint64_t turn = k + 7 * static_cast<std::uint64_t>(v);
    if (turn % 97 < 4) {
      return;  // A gap.
    }
    Sample sent = sample;
    if (turn % 41 == 5) {
      sent.Set(Signal::kX, std::numeric_limits<double>::quiet_NaN());
    }
    if (turn % 53 == 6) {
      sent.Set(Signal::kX, 1e9);
    }
    if (turn % 59 == 7) {
      sent.quality[Index(Signal::kCv)] = SignalQuality::kBad;
    }
    Publish(sent, valve);
    if (turn % 31 == 8) {
      Publish(sent, valve);  // A repeat.
    }
    if (turn % 37 == 9 && k > 10) {
      Publish(Reading(v, k - 5), valve);  // A late one.
    }
  }

  // @returns the lines of the file behind run, stamp, source and seq, by these.
  std::map<Key, std::string> Rescored(const std::string& model_set,
                                      const std::string& runs) const {
    const std::filesystem::path file = directory_.path() / "vectors.csv";
    const Finished evaluate =
        RunProgram({FDI_STUDY_PROGRAM, "--data", data_.string(), "evaluate",
                    "--model-set", model_set, "--assume-normal", "--runs", runs,
                    "--vectors", file.string()});
    EXPECT_EQ(evaluate.code, 0) << evaluate.errors;
    std::map<Key, std::string> lines;
    std::ifstream in(file);
    std::string line;
    std::getline(in, line);
    while (std::getline(in, line)) {
      std::istringstream cells(line);
      std::string run;
      std::string stamp;
      std::string source;
      std::string seq;
      std::string rest;
      std::getline(cells, run, ',');
      std::getline(cells, stamp, ',');
      std::getline(cells, source, ',');
      std::getline(cells, seq, ',');
      std::getline(cells, rest);
      lines.emplace(Key{run.substr(0, 12), std::stoull(seq), std::stoll(stamp)},
                    rest);
    }
    return lines;
  }

  std::mt19937 random_{5};
};

TEST_F(RescoringTest, GivesTheVectorsThatWerePublishedBitForBit) {
  ModelSet first = LinearModels();
  StoreModels(data_, first);
  const auto monitor = StartMonitor({"--record=lossless"});
  ModelSet second = LinearModels();
  second.decision.isolation_samples = 7;
  for (std::uint64_t k = 0; k < kSamples; ++k) {
    if (k == kSwapAt) {
      StoreModels(data_, second);
      ASSERT_TRUE(monitor->AwaitLine("valves_swapped=20")) << monitor->errors();
    }
    for (int v = 0; v < kValves; ++v) {
      PublishInstant(v, k);
    }
    Await([taken = 0]() mutable { return taken++ > 0; });
  }
  const std::uint64_t sent = samples_->status().written;
  ASSERT_TRUE(Await([&] { return counters_["received"] >= sent; }));
  monitor->Signal(SIGTERM);
  ASSERT_EQ(monitor->AwaitExit(), 0) << monitor->errors();
  ASSERT_EQ(counters_["record_dropped"], 0U);

  std::map<std::string, std::string> run_of;
  std::string ids;
  for (const storage::RunInfo& info :
       storage::RunStore(data_ / "runs.db").List()) {
    run_of[info.run.valve_id] = info.id;
    ids += (ids.empty() ? "" : ",") + info.id;
  }
  ASSERT_EQ(run_of.size(), static_cast<std::size_t>(kValves));
  const auto before = Rescored("linear@1", ids);
  const auto after = Rescored("linear@2", ids);
  const std::uint64_t old_hash = vectors_.front().model_hash;
  std::size_t compared = 0;
  std::size_t differing = 0;
  std::size_t swapped = 0;
  for (const idl::DecisionMessage& m : vectors_) {
    const bool old = m.model_hash == old_hash;
    swapped += !old;
    const auto& lines = old ? before : after;
    const auto found =
        lines.find({run_of.at(m.valve_id), m.verdict.seq, m.verdict.stamp_ns});
    ASSERT_NE(found, lines.end()) << m.valve_id << ' ' << m.verdict.seq;
    ++compared;
    if (found->second != TextOf(m, first) && ++differing < 5) {
      ADD_FAILURE() << m.valve_id << ' ' << m.verdict.seq << "\nlive     "
                    << TextOf(m, first) << "\nrescored " << found->second;
    }
  }
  EXPECT_EQ(differing, 0U);
  EXPECT_EQ(compared, counters_["decisions"]);
  EXPECT_GT(swapped, 2000U);
  EXPECT_GT(counters_["not_finite"], 0U);
  EXPECT_GT(counters_["late"], 0U);
  EXPECT_GT(counters_["repeat"], 0U);
  std::printf("%zu vectors of %d valves equal, %zu of them after the swap\n",
              compared, kValves, swapped);
}

}  // namespace
}  // namespace fdi::monitor
