#include "storage/history/strength.h"

#include <cmath>
#include <string>

#include "base/error.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/certainty.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;

void StoreStrengthNow(Database& database, const std::string& episode_id,
                      const Estimate& now, std::optional<Severity> severity) {
  const auto end = [&now](double value) {
    return now.has_interval() ? std::optional(value) : std::nullopt;
  };
  // NaN would be bound as NULL, which the column refuses.
  database.Cached(sql::set_strength)
      .Bind(std::isfinite(now.strength) ? now.strength : 0.0, end(now.lowest),
            end(now.highest), PriorityOf(severity), episode_id)
      .Run();
}

void HistoryWriter::StoreStrength(const StrengthPoint& point) {
  const std::string id = EpisodeIdText(point.episode_id);
  CommitBatch([&] {
    RequireEpisode(id);
    database_.Cached(sql::insert_strength)
        .Bind(id, FaultName(point.fault), point.stamp_ns, point.strength,
              point.lowest, point.highest, LayerName(point.layer))
        .Run();
    if (point.severity) {
      StoreStrengthNow(database_, id,
                       {point.strength, point.lowest, point.highest},
                       point.severity);
      StoreCertainty(database_, id);
    }
  });
}

std::vector<StrengthPoint> HistoryReader::Strengths(std::uint64_t episode_id) {
  const std::string id = EpisodeIdText(episode_id);
  Statement rows = database_.Prepare(sql::strengths);
  rows.Bind(id);
  std::vector<StrengthPoint> points;
  while (rows.Step()) {
    const std::optional<int> fault = ParseFinding(rows.Text(0));
    if (!fault) {
      throw DataError("strengths of " + id + ": no fault is called " +
                      rows.Text(0));
    }
    StrengthPoint& p = points.emplace_back();
    p.episode_id = episode_id;
    p.fault = *fault;
    rows.Read(1, p.stamp_ns, p.strength, p.lowest, p.highest);
    p.layer = ParseLayer(rows.Text(5));
  }
  return points;
}

std::vector<Growth> GrowthOf(const Episode& episode,
                             const std::vector<StrengthPoint>& strengths) {
  std::vector<Growth> growths;
  for (const std::string& name : SplitNames(episode.fault.value_or(""))) {
    if (const std::optional<int> fault = ParseFinding(name)) {
      if (const auto growth = fdi::GrowthOf(strengths, *fault)) {
        growths.push_back(*growth);
      }
    }
  }
  return growths;
}

}  // namespace fdi::storage
