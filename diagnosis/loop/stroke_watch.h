#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/loop/strokes.h"
#include "diagnosis/model/sample.h"

namespace fdi {

/// A stroke test of a valve, and the last one before it with about the same
/// levels (loop::AreAlike), if there was one.
struct StrokeTest {
  std::int64_t start_ns{0};
  double period_s{1.0};  ///< Of its samples.
  loop::Stroke stroke;
  std::optional<loop::Stroke> last;
  std::int64_t last_ns{0};  ///< Start of that one.

  /// What is worse than in the last one, in words; empty: nothing.
  std::vector<std::string> Worse() const;

  bool operator==(const StrokeTest&) const = default;
};

/// Finds stroke tests among the samples of one valve; `last` is left open. A
/// gap of 1.5 periods and more, another source, and a sample without a good CV
/// or X end the record in which a test is looked for.
///
/// Keeps at most `max_samples` of 33 bytes, and usually some tens.
class StrokeWatch {
 public:
  static constexpr std::size_t kMaxSamples = 3600;

  explicit StrokeWatch(std::size_t max_samples = kMaxSamples)
      : max_samples_(max_samples) {}

  /// Takes the next sample that was accepted, and appends the tests that are
  /// over.
  void Push(const Sample& sample, double period_s,
            std::vector<StrokeTest>& found);
  /// The record ends here.
  void Finish(std::vector<StrokeTest>& found);

 private:
  std::size_t max_samples_;
  std::optional<loop::StrokeFinder> finder_;  // Null at the start of a record.
  std::int64_t stamp_ns_{0};
  std::uint64_t source_id_{0};
};

}  // namespace fdi
