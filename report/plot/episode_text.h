#pragma once

#include <string>
#include <vector>

#include "report/fault_texts.h"
#include "report/report.h"
#include "storage/history/alarm.h"

/// An episode in words.
namespace fdi::plot {

/// "0.42 (0.38 to 0.46)", "9.6 days (7.2 to 14.5)"; an interval without a
/// width that can be seen is left out.
std::string IntervalText(double value, double lowest, double highest,
                         int decimals, const std::string& unit = "");

/// The facts of an episode, for Report::Fields(). `source_id`,
/// `trace_instants` and the columns of fault_history are members of the
/// document.
std::vector<report::Column> EpisodeFields(const storage::Alarm& alarm,
                                          const report::FaultTexts& texts,
                                          bool utc);

/// "Flow transmitter wrong", or what stands in the place of a name.
std::string PlainName(const storage::Episode& episode,
                      const report::FaultTexts& texts);

}  // namespace fdi::plot
