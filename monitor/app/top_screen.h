#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "monitor/app/top_board.h"
#include "storage/cli/fault_texts.h"
#include "storage/cli/json_output.h"
#include "storage/cli/terminal.h"

namespace fdi::monitor {

/// What one picture of `top` is made of.
struct TopView {
  std::vector<TopRow> rows;  ///< In order.
  std::size_t valves{0};     ///< Also those the filter hides.
  std::string health;        ///< TopBoard::Health().
  TopSort sort{TopSort::kWorst};
  std::string filter;
  bool typing{false};    ///< The filter is being typed.
  std::size_t first{0};  ///< Row at the top.
  std::int64_t now_ns{0};
  bool utc{false};
};

/// The table as text, with its heading; all rows.
std::string TopTable(const TopView& view, const cli::FaultTexts& texts,
                     const cli::TextStyle& style);

/// A whole screen: at most `height` lines, none wider than style.width.
std::string TopScreen(const TopView& view, const cli::FaultTexts& texts,
                      const cli::TextStyle& style, std::size_t height);

/// {"monitor", "valves": [{"valve_id", "state", ...}]}
cli::Json TopJson(const TopView& view, const cli::FaultTexts& texts);

/// `line` without what is beyond `width` cells; escape codes take none.
std::string Clipped(const std::string& line, std::size_t width);

}  // namespace fdi::monitor
