#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/sample.h"
#include "simulator/app/run_sink.h"
#include "simulator/app/sample_publisher.h"
#include "simulator/app/speed.h"
#include "storage/cli/program.h"

namespace fdi::simulator {

/// A sample and the index of its valve.
struct FedSample {
  std::size_t valve{0};
  LabelledSample labelled;
};

/// Yields samples in the order in which they shall leave.
class Feed {
 public:
  virtual ~Feed() = default;
  /// Nothing at the end, or if a stop was requested while it waited.
  virtual std::optional<FedSample> Next() = 0;
};

/// What was delivered for one valve.
struct SourceSummary {
  std::string valve_id;
  std::uint64_t source_id{0};
  std::uint64_t samples{0};
  std::int64_t first_stamp_ns{0};
  std::int64_t last_stamp_ns{0};
  std::optional<std::uint64_t> seed;
  std::string run_id;  ///< Of the recorded run; may be empty.
};

struct FeedSummary {
  std::vector<SourceSummary> sources;
  std::uint64_t samples{0};
  bool published{false};
  int readers{0};            ///< At the end.
  bool acknowledged{false};  ///< They have all of it.
  bool lossless{false};      ///< They ought to.
  bool interrupted{false};   ///< By a signal.
  double elapsed_s{0.0};
};

/// Where the samples of a feed go; what is null is left out.
struct FeedSinks {
  std::unique_ptr<SamplePublisher> publisher;
  std::unique_ptr<RunSink> runs;
  std::unique_ptr<CsvSink> csv;
};

/// Takes all samples of `feed` at their time to the sinks and closes these.
/// @param summary In: the valves. Out: what was delivered.
void Deliver(Feed& feed, const FeedSinks& sinks, Pacer pacer,
             cli::StopSignals& signals, FeedSummary& summary);

/// To stdout, as a table or, with --json, an object.
void PrintSummary(const FeedSummary& summary,
                  const cli::GlobalOptions& options);

/// kExitTransport if readers lack samples of a lossless delivery that was not
/// interrupted.
int ExitCodeOf(const FeedSummary& summary);

/// A random number that no other publisher has.
std::uint64_t NewSourceId();

}  // namespace fdi::simulator
