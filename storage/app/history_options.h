#pragma once

#include <cstdint>
#include <string>

#include "storage/app/common.h"
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

}  // namespace fdi::storage
