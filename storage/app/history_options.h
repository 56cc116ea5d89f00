#pragma once

#include <cstdint>
#include <string>

#include "storage/app/common.h"
#include "storage/history_editor.h"
#include "storage/history_types.h"

namespace CLI {
class App;
}

namespace fdi::storage {

/// The options that narrow a list of episodes.
struct HistoryOptions {
  std::string valve{"*"};
  std::string fault;
  std::string state{"any"};
  std::int64_t limit{0};
  TimeWindow window;

  void AddTo(CLI::App& verb);
  /// @throws ConfigError
  EpisodeFilter Filter(const cli::Context& context) const;
};

/// The options of what people do: --by, --comment.
struct NoteOptions {
  std::string who{UserName()};
  std::string comment;

  void AddTo(CLI::App& verb);
  /// From this program, now.
  OperatorNote Note() const;
};

/// The positional argument of verbs about one episode.
void AddEpisode(CLI::App& verb, std::string& id, bool required = true);

// Each adds a part of the group `history`, which must be there.
void AddHistoryLists(cli::Program& program, CLI::App& group);
void AddHistoryShow(cli::Program& program, CLI::App& group);
void AddHistoryStatistics(cli::Program& program, CLI::App& group);
void AddHistoryActions(cli::Program& program, CLI::App& group);
void AddHistoryShelf(cli::Program& program, CLI::App& group);

}  // namespace fdi::storage
