// The processes that bench/service.sh sets beside the monitor: a publisher of
// prepared samples, a bare reader of the same type and QoS, a subscriber of
// decision vectors, and the two ends of a bare round trip.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <iostream>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/error.h"
#include "base/time_text.h"
#include "bench/cpu_seconds.h"
#include "idl/endpoint.h"
#include "simulator/valve_simulation.h"

namespace {

using namespace fdi;
using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

struct Options {
  int domain{61};
  int valves{1000};
  int samples{300};   // per valve
  bool loops{false};  // CV, F and SP in AUTO, as of a valve without a model.
  int fill{0};        // Samples 10 s apart, before all others.
  double publish_hz{0.0};  // Samples a second of each valve; 0: at once.
  double idle_s{5.0};
  int rounds{5000};
  double rate_hz{1000.0};
  std::string security;  // Folder of a key, or empty.
};

// Healthy samples as the model set of service.toml knows them.
std::vector<Sample> Healthy(int count) {
  simulator::ValveSimulationConfig config;
  config.parameters = simulator::ParameterSet("paper-operating-point");
  simulator::OperatingPointExcitation excitation;
  excitation.amplitude_pct = 12.0;
  excitation.period_s = 60.0;
  config.excitation = excitation;
  config.duration_s = count;
  config.seed = 7;
  config.source_id = 1;
  simulator::ValveSimulation simulation(config);
  std::vector<Sample> samples;
  while (!simulation.finished()) {
    samples.push_back(simulation.Step().sample);
  }
  return samples;
}

std::string ValveName(int valve) {
  return "V" + std::to_string(100000 + valve);
}

idl::DdsOptions DdsOf(const Options& options) {
  idl::DdsOptions dds;
  dds.domain = options.domain;
  dds.max_valves = options.valves;
  dds.security = options.security;
  return dds;
}

double SecondsBetween(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

// Leaves only the signals of a data-only loop in `samples`.
void KeepLoop(std::vector<Sample>& samples) {
  for (Sample& sample : samples) {
    sample.present = static_cast<SignalMask>(
        sample.present &
        (MaskOf(Signal::kCv) | MaskOf(Signal::kF) | MaskOf(Signal::kSp)));
    sample.mode = ValveMode::kAuto;
  }
}

// Has the first sample after `fill` be of now, and those before it 10 s apart.
void SetStamps(std::vector<Sample>& samples, std::size_t fill) {
  constexpr std::int64_t kApart_ns = 10'000'000'000;
  const std::int64_t now_ns = NowNs();
  const std::int64_t later_ns = now_ns - samples[fill].stamp_ns;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    samples[k].stamp_ns =
        k < fill ? now_ns - static_cast<std::int64_t>(fill - k) * kApart_ns
                 : samples[k].stamp_ns + later_ns;
  }
}

// Publishes a sample of each valve, evenly over a period; at once without one.
void PublishRound(const Options& options, double hz, const Sample& sample,
                  std::vector<idl::ValveSampleMessage>& messages,
                  idl::Publisher<idl::ValveSampleMessage>& publisher) {
  constexpr std::size_t kParts = 100;
  const auto begin = Clock::now();
  const std::size_t part = std::max<std::size_t>(1, messages.size() / kParts);
  for (std::size_t v = 0; v < messages.size(); ++v) {
    messages[v].sample = sample;
    publisher.Write(messages[v]);
    if (hz > 0.0 && (v + 1) % part == 0) {
      std::this_thread::sleep_until(
          begin + std::chrono::duration_cast<Clock::duration>(
                      std::chrono::duration<double>(
                          static_cast<double>(v + 1) /
                          (hz * static_cast<double>(options.valves)))));
    }
  }
}

int Publish(const Options& options) {
  std::vector<Sample> samples = Healthy(options.fill + options.samples);
  if (options.loops) {
    KeepLoop(samples);
  }
  const auto fill = static_cast<std::size_t>(options.fill);
  SetStamps(samples, fill);
  idl::Participant participant(DdsOf(options), {}, "fdi-bench-publish");
  idl::Publisher<idl::ValveSampleMessage> publisher(
      participant, {idl::Profile::kLossless, options.valves});
  if (!publisher.WaitForReaders(1, milliseconds(20000))) {
    std::cerr << "publish: no reader came within 20 s\n";
    return 1;
  }
  const double cpu_before = CpuSeconds();
  const auto start = Clock::now();
  std::vector<idl::ValveSampleMessage> messages;
  for (int v = 0; v < options.valves; ++v) {
    messages.push_back({ValveName(v), {}});
  }
  const std::span all_samples(samples);
  for (const Sample& sample : all_samples.first(fill)) {
    PublishRound(options, 0.0, sample, messages, publisher);
  }
  if (fill > 0) {
    publisher.WaitForAcknowledged(milliseconds(60000));
    std::printf("filled %.1f s\n", SecondsBetween(start, Clock::now()));
    std::fflush(stdout);
  }
  for (const Sample& sample : all_samples.subspan(fill)) {
    PublishRound(options, options.publish_hz, sample, messages, publisher);
  }
  const bool all = publisher.WaitForAcknowledged(milliseconds(60000));
  const double seconds = SecondsBetween(start, Clock::now());
  const auto count = publisher.status().written;
  std::printf(
      "published %llu seconds %.3f rate %.0f cpu %.2f acknowledged %s\n",
      static_cast<unsigned long long>(count), seconds,
      static_cast<double>(count) / seconds, CpuSeconds() - cpu_before,
      all ? "all" : "not all");
  return all ? 0 : 1;
}

// Counts what comes until all is there or nothing came for a while.
template <typename Message>
int Count(const Options& options, const char* word) {
  idl::Participant participant(DdsOf(options), {}, "fdi-bench-read");
  idl::Subscriber<Message> subscriber(participant);
  const auto expected = static_cast<std::uint64_t>(options.valves) *
                        static_cast<std::uint64_t>(options.samples);
  std::uint64_t count = 0;
  Clock::time_point first;
  Clock::time_point last = Clock::now();
  const idl::Handlers<Message> handlers{
      [&](const Message& message, const idl::Reception&) {
        if constexpr (requires { message.vectors; }) {
          count += message.vectors.size();
        } else {
          ++count;
        }
      },
      {}};
  double cpu_before = 0.0;
  while (count < expected &&
         (count == 0 || SecondsBetween(last, Clock::now()) < options.idle_s)) {
    const std::uint64_t before = count;
    subscriber.Take(handlers, milliseconds(100));
    if (before == 0 && count > 0) {
      first = Clock::now();
      cpu_before = CpuSeconds();
    }
    if (count > before) {
      last = Clock::now();
    }
  }
  const double seconds = SecondsBetween(first, last);
  std::printf("%s %llu of %llu seconds %.3f rate %.0f cpu %.2f\n", word,
              static_cast<unsigned long long>(count),
              static_cast<unsigned long long>(expected), seconds,
              static_cast<double>(count) / seconds, CpuSeconds() - cpu_before);
  return count == expected ? 0 : 1;
}

// Answers every sample with an empty decision vector, and does nothing else.
int Echo(const Options& options) {
  idl::Participant participant(DdsOf(options), {}, "fdi-bench-echo");
  idl::Publisher<idl::DecisionMessage> publisher(
      participant, {idl::Profile::kLive, options.valves});
  idl::Subscriber<idl::ValveSampleMessage> subscriber(participant,
                                                      idl::Profile::kLive);
  idl::DecisionMessage answer;
  answer.channel_count = 2;
  answer.fault_count = 5;
  answer.observer_count = 11;
  int count = 0;
  const idl::Handlers<idl::ValveSampleMessage> handlers{
      [&](const idl::ValveSampleMessage& message, const idl::Reception&) {
        answer.valve_id = message.valve_id;
        answer.verdict.seq = message.sample.seq;
        publisher.Write(answer);
        ++count;
      },
      {}};
  while (count < options.rounds) {
    if (subscriber.Take(handlers, milliseconds(20000)) == 0) {
      return 1;
    }
  }
  publisher.WaitForAcknowledged(milliseconds(2000));
  return 0;
}

// Publishes at a fixed rate and takes the answers, by their number.
int Ping(const Options& options) {
  const std::vector<Sample> samples = Healthy(options.rounds);
  idl::Participant participant(DdsOf(options), {}, "fdi-bench-ping");
  idl::Publisher<idl::ValveSampleMessage> publisher(
      participant, {idl::Profile::kLive, options.valves});
  idl::Subscriber<idl::DecisionMessage> subscriber(participant,
                                                   idl::Profile::kLive);
  if (!publisher.WaitForReaders(1, milliseconds(20000)) ||
      !subscriber.WaitForWriters(1, milliseconds(20000))) {
    std::cerr << "ping: nobody answers\n";
    return 1;
  }
  std::vector<std::atomic<std::int64_t>> sent(samples.size());
  std::vector<double> round_trips;
  std::jthread sender([&](const std::stop_token& stop) {
    auto next = Clock::now();
    for (const Sample& sample : samples) {
      if (stop.stop_requested()) {
        break;
      }
      std::this_thread::sleep_until(next);
      next += std::chrono::microseconds(
          static_cast<std::int64_t>(1e6 / options.rate_hz));
      sent[sample.seq] = Clock::now().time_since_epoch().count();
      publisher.Write({ValveName(0), sample});
    }
  });
  const idl::Handlers<idl::DecisionMessage> handlers{
      [&](const idl::DecisionMessage& message, const idl::Reception&) {
        const std::int64_t now = Clock::now().time_since_epoch().count();
        round_trips.push_back(
            1e-3 * static_cast<double>(now - sent[message.verdict.seq]));
      },
      {}};
  while (round_trips.size() < samples.size() &&
         subscriber.Take(handlers, milliseconds(3000)) > 0) {
  }
  std::sort(round_trips.begin(), round_trips.end());
  const auto quantile = [&](double q) {
    return round_trips.empty()
               ? 0.0
               : round_trips[static_cast<std::size_t>(
                     q * static_cast<double>(round_trips.size() - 1))];
  };
  std::printf("answers %zu of %zu p50 %.0f p99 %.0f\n", round_trips.size(),
              samples.size(), quantile(0.5), quantile(0.99));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("Load and bare baselines for bench/service.sh");
  app.require_subcommand(1);
  app.add_option("--domain", options.domain, "DDS domain");
  app.add_option("--valves", options.valves, "Valves of the publisher");
  app.add_option("--security", options.security, "Folder of a key");
  app.add_option("--samples", options.samples, "Samples of each valve");
  app.add_option("--rounds", options.rounds, "Round trips");
  app.add_flag("--loops", options.loops, "Publish CV, F and SP only");
  app.add_option("--fill", options.fill,
                 "Samples of each valve 10 s apart, before the others");
  app.add_option("--hz", options.publish_hz,
                 "Samples a second of each valve; 0: as fast as it goes");
  int code = 0;
  const auto add = [&](const char* name, const std::function<int()>& role) {
    app.add_subcommand(name)->callback([&code, role] { code = role(); });
  };
  add("publish", [&] { return Publish(options); });
  add("read", [&] { return Count<idl::ValveSampleMessage>(options, "read"); });
  add("vectors",
      [&] { return Count<idl::DecisionBatchMessage>(options, "vectors"); });
  add("echo", [&] { return Echo(options); });
  add("ping", [&] { return Ping(options); });
  CLI11_PARSE(app, argc, argv);
  return code;
}
