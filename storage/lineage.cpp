#include "storage/lineage.h"

#include "diagnosis/fault_catalogue.h"
#include "storage/model_codec.h"

namespace fdi::storage {
void InsertLineage(Database& database, std::int64_t model_set_id,
                   const Lineage& lineage) {
  const std::optional<ParentSet>& parent = lineage.parent;
  Statement row =
      database.Prepare("INSERT INTO lineage VALUES (?, ?, ?, ?, ?)");
  if (parent) {
    row.Bind(model_set_id, lineage.settings, parent->name, parent->version,
             HashHex(parent->content_hash))
        .Run();
  } else {
    row.Bind(model_set_id, lineage.settings, std::nullopt, std::nullopt,
             std::nullopt)
        .Run();
  }
  Statement episode = database.Prepare(
      "INSERT INTO training_episode VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  for (const TrainingEpisode& e : lineage.episodes) {
    episode
        .Bind(model_set_id, e.episode_id, e.valve_id, e.label, e.labelled_by,
              e.labelled_ns, FaultName(e.fault), e.strength, e.run, e.samples)
        .Run();
  }
}

Lineage ReadLineage(Database& database, std::int64_t model_set_id) {
  Lineage lineage;
  Statement row = database.Prepare(
      "SELECT settings, parent_set, parent_version, parent_hash FROM lineage"
      " WHERE model_set_id = ?");
  if (row.Bind(model_set_id).Step()) {
    lineage.settings = row.Text(0);
    if (const auto name = row.OptionalText(1)) {
      lineage.parent = ParentSet{*name, row.Int(2), HashOfHex(row.Text(3))};
    }
  }
  Statement rows = database.Prepare(
      "SELECT episode_id, valve_id, label, labelled_by, labelled_ns, fault,"
      " strength, run, samples FROM training_episode WHERE model_set_id = ?"
      " ORDER BY episode_id");
  rows.Bind(model_set_id);
  while (rows.Step()) {
    const auto fault = ParseFault(rows.Text(5));
    lineage.episodes.push_back({rows.Text(0), rows.Text(1), rows.Text(2),
                                rows.Text(3), rows.Int64(4), fault.value_or(0),
                                rows.Double(6), rows.Text(7), rows.Int64(8)});
  }
  return lineage;
}

}  // namespace fdi::storage
