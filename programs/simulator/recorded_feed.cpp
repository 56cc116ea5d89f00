#include "programs/simulator/recorded_feed.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <system_error>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "base/error.h"
#include "base/log.h"
#include "base/time_text.h"

namespace fdi::simulator {
namespace {

constexpr const char* kStdin = "stdin";
// Bounds the memory that input without line ends can take.
constexpr std::size_t kMaxLine = 1U << 20U;

void ThrowUnless(bool passing, const char* operation) {
  if (!passing) {
    throw std::system_error(errno, std::generic_category(), operation);
  }
}

importer::CsvOptions CsvOptionsOf(const StreamOptions& options) {
  importer::CsvOptions csv;
  csv.source = kStdin;
  csv.map = options.map;
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

// Samples have to be one period apart, but lines arrive with jitter and in
// bursts. The stamp therefore advances by whole periods,
//
//   stamp += max(1, round((now + shift - stamp) / period)) period
//
// A line that is late by less than half a period leaves no gap. The lines of a
// burst get successive stamps, which may run ahead of the clock until it has
// caught up; no stamp ever repeats.
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

void ReportConversion(const LogSink& log, const std::string& run, FlowUnit from,
                      FlowUnit to) {
  if (from != to) {
    log(LogLevel::kInfo,
        EventLine("flow_converted", {{"run", run},
                                     {"from", std::string(FlowUnitName(from))},
                                     {"to", std::string(FlowUnitName(to))}}));
  }
}

std::optional<FedSample> StoredFeed::Next() {
  while (part_ < parts_.size() && next_ == parts_[part_].size()) {
    parts_[part_++] = {};
    next_ = 0;
  }
  if (part_ == parts_.size()) {
    return std::nullopt;
  }
  FedSample fed{0, parts_[part_][next_++]};
  restamper_.Apply(fed.labelled.sample);
  return fed;
}

// The stream on stdin. Its first line that is not blank decides for all:
//
//   stream = { blank } ( json | csv )
//   json   = { object | blank }     if it begins with '{'; JsonLineReader
//   csv    = header { row | blank } otherwise; CsvReader
//
// A line ends with LF, with or without CR; the last one may lack it.
StreamFeed::StreamFeed(int descriptor, report::StopSignals& signals,
                       const StreamOptions& options, Restamping restamping,
                       LogSink log)
    : descriptor_(descriptor),
      signals_(signals),
      options_(options),
      restamper_(std::move(restamping)),
      log_(std::move(log)),
      csv_(CsvOptionsOf(options)),
      steps_(options.split_gaps, options.period_s),
      json_(kStdin, options.split_gaps, options.period_s) {}

std::optional<FedSample> StreamFeed::Next() {
  while (const auto line = NextLine()) {
    if (auto sample = TakeLine(*line)) {
      ConvertFlow(*sample);
      return FedSample{0, {*sample, std::nullopt}};
    }
  }
  return std::nullopt;
}

std::optional<std::string> StreamFeed::NextLine() {
  // What was searched once is not searched again, and the unread rest moves to
  // the front only before a read: a long line that comes in pieces, and many
  // short ones in one piece, both take linear time.
  std::size_t searched = begin_;
  while (true) {
    const std::size_t end = buffer_.find('\n', searched);
    if (end != std::string::npos) {
      std::string line = buffer_.substr(begin_, end - begin_);
      begin_ = end + 1;
      return line;
    }
    if (buffer_.size() - begin_ > kMaxLine) {
      throw DataError("stdin: a line has more than 1 MiB");
    }
    buffer_.erase(0, begin_);
    begin_ = 0;
    searched = buffer_.size();
    if (ended_ || !Fill()) {
      break;
    }
  }
  if (buffer_.empty() || signals_.stop_requested()) {
    return std::nullopt;
  }
  return std::exchange(buffer_, {});  // The last line may lack its end.
}

// Waits for input. @returns false if a stop was requested.
//
// read() alone would not do: the handlers are installed with SA_RESTART, so a
// signal does not interrupt it, and one that came just before it would be
// missed. poll() also waits for the descriptor of the signals, which stays
// readable until the event has been taken.
bool StreamFeed::Fill() {
  std::array<pollfd, 2> entries{
      {{descriptor_, POLLIN, 0}, {signals_.descriptor(), POLLIN, 0}}};
  while (!signals_.stop_requested()) {
    if (poll(entries.data(), entries.size(), -1) < 0) {
      ThrowUnless(errno == EINTR, "poll of stdin");
      continue;
    }
    // Any event of the input, a hang-up or an error included, is left to
    // read(), which returns what is still in a closed pipe and then 0.
    if (entries[0].revents == 0) {
      signals_.WaitFor(std::chrono::milliseconds(0));  // Ignores a reload.
      continue;
    }
    std::array<char, 65536> bytes;
    const ssize_t count = read(descriptor_, bytes.data(), bytes.size());
    if (count < 0) {
      ThrowUnless(errno == EINTR || errno == EAGAIN, "read of stdin");
      continue;
    }
    ended_ = count == 0;
    buffer_.append(bytes.data(), static_cast<std::size_t>(count));
    return true;
  }
  return false;
}

std::optional<Sample> StreamFeed::TakeLine(const std::string& line) {
  if (!is_json_) {
    // Blanks, and the byte order mark that some shells write into a pipe.
    const std::size_t first = line.find_first_not_of(" \t\r\xEF\xBB\xBF");
    if (first != std::string::npos) {
      is_json_ = line[first] == '{';
    }
  }
  if (!is_json_.value_or(false)) {
    auto row = csv_.TakeLine(line);
    ReportIgnored(csv_.header().ignored_columns);
    if (!row) {
      return std::nullopt;
    }
    // CsvReader leaves this check to its caller; JsonLineReader has its own.
    if (const std::string wrong = steps_.Take(row->t_s); !wrong.empty()) {
      csv_.Refuse(wrong);
    }
    restamper_.Apply(row->labelled.sample);
    return row->labelled.sample;
  }
  auto row = json_.TakeLine(line);
  ReportIgnored(json_.ignored_keys());
  if (!row) {
    return std::nullopt;
  }
  if (row->t_s) {
    restamper_.Apply(row->sample);
  } else {
    const double period_s = options_.period_s > 0.0 ? options_.period_s : 1.0;
    restamper_.StampByClock(NowNs(), std::llround(period_s * 1e9), row->sample);
  }
  return row->sample;
}

void StreamFeed::ConvertFlow(Sample& sample) {
  if (!options_.flow) {
    return;
  }
  if (!conversion_) {
    conversion_.emplace(*options_.flow);
    if (sample.Has(Signal::kF)) {
      ReportConversion(log_, kStdin, sample.flow_unit, options_.flow->unit);
    }
  }
  conversion_->Apply(sample);
}

void StreamFeed::ReportIgnored(const std::vector<std::string>& names) {
  if (!reported_ && !names.empty()) {
    log_(LogLevel::kInfo,
         EventLine("csv_note", {{"source", kStdin},
                                {"note", "not used: " + Listed(names)}}));
    reported_ = true;
  }
}

}  // namespace fdi::simulator
