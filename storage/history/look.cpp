// Second looks, as HistoryWriter stores and HistoryReader returns them.
#include <string>

#include "base/error.h"
#include "base/text.h"
#include "diagnosis/model/fault_catalogue.h"
#include "storage/history/episode.h"
#include "storage/history/history_reader.h"
#include "storage/history/history_writer.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;

void HistoryWriter::StoreLook(const EpisodeLook& look) {
  const std::string id = EpisodeIdText(look.episode_id);
  CommitBatch([&] {
    RequireEpisode(id);
    database_.Cached(sql::delete_look).Bind(id).Run();
    database_.Cached(sql::insert_look)
        .Bind(id, look.first_ns, look.period_ns, look.misfit,
              look.rival ? std::optional(FaultName(look.rival->fault))
                         : std::nullopt,
              look.rival ? std::optional(look.rival->times) : std::nullopt,
              JoinText(look.observers, "|", FaultName))
        .Run();
    int rank = 0;
    for (const LookFault& f : look.faults) {
      database_.Cached(sql::insert_look_fault)
          .Bind(id, ++rank, FaultName(f.fault), f.strength, f.lowest, f.highest,
                f.begins_ns, f.growing)
          .Run();
    }
    for (std::size_t row = 0; row < look.x_pct.size(); ++row) {
      database_.Cached(sql::insert_look_row)
          .Bind(id, row, look.x_pct[row], look.flow[row])
          .Run();
    }
  });
}

std::optional<EpisodeLook> HistoryReader::Look(std::uint64_t episode_id) {
  const std::string id = EpisodeIdText(episode_id);
  Statement header = database_.Prepare(sql::look);
  if (!header.Bind(id).Step()) {
    return std::nullopt;
  }
  EpisodeLook look;
  look.episode_id = episode_id;
  std::optional<std::string> rival;
  std::optional<double> times;
  std::optional<std::string> observers;
  header.Read(0, look.first_ns, look.period_ns, look.misfit, rival, times,
              observers);
  if (rival && times) {
    look.rival = LookRival{RequireFinding(*rival), *times};
  }
  for (const std::string& name : SplitNames(observers.value_or(""))) {
    look.observers.push_back(RequireFinding(name));
  }
  Statement faults = database_.Prepare(sql::look_faults);
  faults.Bind(id);
  while (faults.Step()) {
    LookFault& f = look.faults.emplace_back();
    const std::optional<int> fault = ParseFinding(faults.Text(0));
    if (!fault) {
      throw DataError("second look at " + id + ": no fault is called " +
                      faults.Text(0));
    }
    f.fault = *fault;
    faults.Read(1, f.strength, f.lowest, f.highest, f.begins_ns, f.growing);
  }
  Statement rows = database_.Prepare(sql::look_rows);
  rows.Bind(id);
  while (rows.Step()) {
    look.x_pct.push_back(rows.Double(0));
    look.flow.push_back(rows.Double(1));
  }
  return look;
}

}  // namespace fdi::storage
