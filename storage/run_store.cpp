#include <cmath>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "storage/run_reader.h"
#include "storage/run_rows.h"
#include "storage/runs.h"

namespace fdi::storage {
namespace {

constexpr std::size_t kImportChunk = 600;

std::optional<double> BoundOf(double t_s) {
  return std::isfinite(t_s) ? std::optional(t_s) : std::nullopt;
}

void CheckLabel(int fault, double strength) {
  if (fault < 0 || fault > kLastFault) {
    throw ConfigError("label: fault " + std::to_string(fault) +
                      " is not in 0..22");
  }
  const bool fits = fault == 0 ? strength == 0.0
                               : strength != 0.0 && std::abs(strength) <= 1.0;
  if (!fits) {
    throw ConfigError("label: strength " + std::to_string(strength) + " of " +
                      FaultName(fault) + " is not " +
                      (fault == 0 ? "0" : "in [-1, 1] without 0"));
  }
}

std::string ImportPart(RunRows& rows, const CsvRun& part, const NewRun& run) {
  std::vector<StoredSample> samples;
  samples.reserve(part.samples.size());
  RunCounters counters;
  for (const LabelledSample& labelled : part.samples) {
    StoredSample stored;
    stored.sample = labelled.sample;
    stored.sample.source_id = run.source_id;
    stored.truth = labelled.truth;
    counters.Count(stored);
    samples.push_back(stored);
  }
  const std::string id = NewRunId();
  const std::int64_t run_id = rows.InsertRun(id, run, std::nullopt);
  rows.InsertChunks(run_id, 0, samples, kImportChunk);
  rows.AddCounters(run_id, counters);
  return id;
}

}  // namespace

class RunStore::Impl {
 public:
  Impl(const std::filesystem::path& path, Access access)
      : database_(path, RunsSchema(), access), reader_(database_) {}

  Database& database() { return database_; }
  RunReader& reader() { return reader_; }

  std::vector<std::string> Import(const CsvTable& table, const NewRun& base) {
    RunRows rows(database_);
    std::vector<std::string> ids;
    Transaction transaction(database_);
    for (const CsvRun& part : table.runs) {
      NewRun run = base;
      run.origin = RunOrigin::kImported;
      run.period_s = part.period_s;
      run.flow_unit = part.flow_unit;
      if (table.runs.size() > 1) {
        run.start_ns = part.samples.front().sample.stamp_ns;
      }
      ids.push_back(ImportPart(rows, part, run));
    }
    transaction.Commit();
    return ids;
  }

  void Label(std::string_view text, int fault, double strength) {
    CheckLabel(fault, strength);
    const RunSelector selector = ParseRunSelector(text);
    Transaction transaction(database_);
    const FoundRun found = reader_.Find(selector);
    const RunInfo& info = found.info;
    if (info.samples == 0 ||
        StampAt(info, selector.from_s) > info.last_stamp_ns ||
        StampAt(info, selector.to_s) <= info.first_stamp_ns) {
      throw NotFoundError("run " + std::string(text) + " holds no sample");
    }
    database_.Run(
        "INSERT INTO run_label (run_id, from_s, to_s, fault, strength,"
        " created_ns) VALUES (?, ?, ?, ?, ?, ?)",
        found.run_id, BoundOf(selector.from_s), BoundOf(selector.to_s), fault,
        strength, UtcNow());
    transaction.Commit();
  }

  int RemoveLabels(std::string_view text) {
    Transaction transaction(database_);
    database_.Run("DELETE FROM run_label WHERE run_id = ?",
                  reader_.Find(ParseRunSelector(text)).run_id);
    const int removed = database_.Changes();
    transaction.Commit();
    return removed;
  }

  void Delete(std::string_view text) {
    const RunSelector selector = ParseRunSelector(text);
    if (selector.IsStretch()) {
      throw ConfigError("run " + std::string(text) +
                        ": a stretch cannot be deleted, only the whole run");
    }
    Transaction transaction(database_);
    const FoundRun found = reader_.Find(selector);
    if (found.info.state == RunState::kRecording) {
      throw DataError("run " + found.info.id +
                      " is being recorded: end its recorder first");
    }
    database_.Run("DELETE FROM run WHERE run_id = ?", found.run_id);
    transaction.Commit();
  }

 private:
  Database database_;
  RunReader reader_;
};

RunStore::RunStore(const std::filesystem::path& path, Access access)
    : impl_(std::make_unique<Impl>(path, access)) {}

RunStore::~RunStore() = default;
RunStore::RunStore(RunStore&&) noexcept = default;
RunStore& RunStore::operator=(RunStore&&) noexcept = default;

std::vector<RunInfo> RunStore::List(const RunFilter& filter) {
  return impl_->reader().List(filter);
}

RunInfo RunStore::Info(std::string_view selector) {
  return impl_->reader().Find(ParseRunSelector(selector)).info;
}

StoredRun RunStore::Load(std::string_view selector) {
  return impl_->reader().Load(selector);
}

std::vector<std::string> RunStore::Import(const CsvTable& table,
                                          const NewRun& run) {
  return impl_->Import(table, run);
}

void RunStore::Label(std::string_view selector, int fault, double strength) {
  impl_->Label(selector, fault, strength);
}

int RunStore::RemoveLabels(std::string_view selector) {
  return impl_->RemoveLabels(selector);
}

void RunStore::Delete(std::string_view selector) {
  impl_->Delete(selector);
}

Database& RunStore::database() {
  return impl_->database();
}

}  // namespace fdi::storage
