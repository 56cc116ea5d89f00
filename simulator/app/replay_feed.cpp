#include "simulator/app/replay_feed.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "storage/cli/logging.h"
#include "storage/cli/time_text.h"

namespace fdi::simulator {
namespace {

constexpr const char* kStdin = "stdin";

storage::CsvOptions CsvOptionsOf(const StreamOptions& options) {
  storage::CsvOptions csv;
  csv.source = kStdin;
  csv.required = MaskOf(Signal::kCv);
  csv.split_gaps = options.split_gaps;
  return csv;
}

}  // namespace

void Restamper::Apply(Sample& sample) {
  sample.source_id = restamping_.source_id;
  if (restamping_.keep) {
    return;
  }
  if (!shift_ns_) {
    shift_ns_ = restamping_.start() - sample.stamp_ns;
  }
  sample.stamp_ns += *shift_ns_;
}

void Restamper::StampByClock(std::int64_t now_ns, std::int64_t period_ns,
                             Sample& sample) {
  sample.source_id = restamping_.source_id;
  if (!last_stamp_ns_) {
    shift_ns_ = restamping_.keep ? 0 : restamping_.start() - now_ns;
    last_stamp_ns_ = now_ns + *shift_ns_;
  } else {
    const double since =
        static_cast<double>(now_ns + *shift_ns_ - *last_stamp_ns_);
    const auto periods = std::llround(since / static_cast<double>(period_ns));
    *last_stamp_ns_ += std::max<std::int64_t>(1, periods) * period_ns;
  }
  sample.stamp_ns = *last_stamp_ns_;
}

std::optional<FedSample> StoredFeed::Next() {
  if (next_ == samples_.size()) {
    return std::nullopt;
  }
  FedSample fed{0, samples_[next_++]};
  restamper_.Apply(fed.labelled.sample);
  return fed;
}

StreamFeed::StreamFeed(LineInput input, const StreamOptions& options,
                       Restamping restamping, LogSink log)
    : input_(std::move(input)),
      options_(options),
      restamper_(std::move(restamping)),
      log_(std::move(log)),
      csv_(CsvOptionsOf(options)),
      json_({kStdin, options.split_gaps}) {}

std::optional<FedSample> StreamFeed::Next() {
  while (const auto line = input_.Next()) {
    if (const auto sample = TakeLine(*line)) {
      return FedSample{0, {*sample, std::nullopt}};
    }
  }
  return std::nullopt;
}

std::optional<Sample> StreamFeed::TakeLine(const std::string& line) {
  if (!is_json_) {
    const std::size_t first = line.find_first_not_of(" \t\r");
    if (first != std::string::npos) {
      is_json_ = line[first] == '{';
    }
  }
  if (!is_json_.value_or(false)) {
    auto row = csv_.TakeLine(line);
    Notice(csv_.header().ignored_columns);
    if (!row) {
      return std::nullopt;
    }
    restamper_.Apply(row->labelled.sample);
    return row->labelled.sample;
  }
  auto row = json_.TakeLine(line);
  Notice(json_.ignored_keys());
  if (!row) {
    return std::nullopt;
  }
  if (row->t_s) {
    restamper_.Apply(row->sample);
  } else {
    restamper_.StampByClock(cli::NowNs(), std::llround(options_.period_s * 1e9),
                            row->sample);
  }
  return row->sample;
}

void StreamFeed::Notice(const std::vector<std::string>& ignored) {
  if (!noticed_ && !ignored.empty()) {
    LogIgnored(log_, kStdin, ignored);
    noticed_ = true;
  }
}

void LogIgnored(const LogSink& log, const std::string& source,
                const std::vector<std::string>& names) {
  if (names.empty()) {
    return;
  }
  std::string list;
  for (const std::string& name : names) {
    list += (list.empty() ? "" : ",") + name;
  }
  log(LogLevel::kInfo,
      cli::EventLine("columns_ignored", {{"source", source}, {"names", list}}));
}

}  // namespace fdi::simulator
