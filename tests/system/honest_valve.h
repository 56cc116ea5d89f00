#pragma once

#include <algorithm>
#include <chrono>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "idl/endpoint.h"
#include "tests/monitor/linear_models.h"

namespace fdi::monitor {

/// A publisher of 20 samples/s and a reader of their decision vectors, in a
/// participant and a thread of its own: what others do may not cost it any, nor
/// make them late.
class HonestValve {
 public:
  using Clock = std::chrono::steady_clock;

  struct Delays {  // [ms]
    double median{0.0};
    double p99{0.0};
    double worst{0.0};
  };

  explicit HonestValve(int domain) : participant_(Options(domain)) {
    EXPECT_TRUE(samples_.WaitForReaders(1, kPatience));
    EXPECT_TRUE(decisions_.WaitForWriters(1, kPatience));
    // The writer may know of us later than we of it.
    for (const auto end = Clock::now() + kPatience;
         delays_ms_.empty() && Clock::now() < end;) {
      sent_.clear();
      Exchange();
    }
    sent_.clear();
    delays_ms_.clear();
    thread_ = std::jthread([this](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        Exchange();
      }
    });
  }

  /// Fails unless every sample since the start has had its vector.
  Delays Stop() {
    thread_.request_stop();
    thread_.join();
    for (const auto end = Clock::now() + kPatience;
         !sent_.empty() && Clock::now() < end;) {
      Take(std::chrono::milliseconds(10));
    }
    EXPECT_TRUE(sent_.empty()) << sent_.size() << " samples without a vector";
    std::ranges::sort(delays_ms_);
    const std::size_t count = delays_ms_.size();
    EXPECT_GT(count, 0U);
    return count == 0 ? Delays{}
                      : Delays{delays_ms_[count / 2],
                               delays_ms_[count * 99 / 100], delays_ms_.back()};
  }
  /// Number of samples published in all.
  std::uint64_t sent() const { return next_; }

  static constexpr const char* kId = "honest";

 private:
  static constexpr std::chrono::seconds kPatience{30};

  static idl::DdsOptions Options(int domain) {
    idl::DdsOptions options;
    options.domain = domain;
    return options;
  }

  void Exchange() {
    const auto next = Clock::now() + std::chrono::milliseconds(50);
    sent_[next_] = Clock::now();
    EXPECT_EQ(samples_.Write({kId, PlantSample(next_)}, {}, kPatience),
              idl::WriteResult::kSent);
    ++next_;
    while (Clock::now() < next) {
      Take(std::chrono::milliseconds(5));
    }
  }
  void Take(std::chrono::milliseconds patience) {
    decisions_.Take(
        idl::ForEachVector([this](const idl::DecisionMessage& m, const auto&) {
          const auto found = sent_.find(m.verdict.seq);
          if (m.valve_id == kId && found != sent_.end()) {
            const std::chrono::duration<double, std::milli> delay =
                Clock::now() - found->second;
            delays_ms_.push_back(delay.count());
            sent_.erase(found);
          }
        }),
        patience);
  }

  idl::Participant participant_;
  idl::Publisher<idl::ValveSampleMessage> samples_{
      participant_, {idl::Profile::kLossless, 0}};
  idl::Subscriber<idl::DecisionBatchMessage> decisions_{participant_};
  std::uint64_t next_{0};
  std::map<std::uint64_t, Clock::time_point> sent_;  // without a vector yet
  std::vector<double> delays_ms_;
  std::jthread thread_;
};

inline std::ostream& operator<<(std::ostream& out,
                                const HonestValve::Delays& delays) {
  return out << "honest valve p50 " << delays.median << " ms, p99 "
             << delays.p99 << " ms, worst " << delays.worst << " ms";
}

}  // namespace fdi::monitor
