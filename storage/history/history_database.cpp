#include "storage/history/history_database.h"

#include <algorithm>
#include <vector>

#include "base/error.h"
#include "storage/history/episode.h"
#include "storage/history/sql.h"

namespace fdi::storage {
namespace sql = history_sql;

const Schema& HistorySchema() {
  static const Schema schema{
      "history",
      kHistoryApplicationId,
      Synchronous::kFull,
      {sql::kMigrations.begin(), sql::kMigrations.end()},
      sql::kBaseline,
      "start without its episodes; the program that wrote it still lists them",
      {sql::damaged_episode_ids, sql::damaged_event_ids}};
  return schema;
}

std::uint64_t ResolveEpisode(Database& database, std::string_view id) {
  std::vector<std::string> found;
  if (id == "last") {
    Statement newest = database.Prepare(sql::newest_episode);
    if (!newest.Step()) {
      throw NotFoundError("no episode is recorded");
    }
    found.push_back(newest.Text(0));
  } else {
    std::string prefix(id);
    std::transform(prefix.begin(), prefix.end(), prefix.begin(), [](char c) {
      return static_cast<char>(c >= 'A' && c <= 'F' ? c + ('a' - 'A') : c);
    });
    const bool is_hex =
        !prefix.empty() &&
        prefix.find_first_not_of("0123456789abcdef") == std::string::npos;
    Statement matching = database.Prepare(sql::episodes_by_prefix);
    matching.Bind(prefix);
    while (is_hex && matching.Step()) {
      found.push_back(matching.Text(0));
    }
  }
  if (found.size() != 1) {
    throw NotFoundError(found.empty()
                            ? "no episode '" + std::string(id) + "'"
                            : "episode '" + std::string(id) +
                                  "' is not unique: more than one begins so");
  }
  const auto episode_id = ParseEpisodeId(found[0]);
  if (!episode_id) {
    throw DataError("episode id '" + found[0] + "' in " +
                    database.path().string() +
                    " is damaged: it is not 16 hex digits");
  }
  return *episode_id;
}

}  // namespace fdi::storage
