#pragma once

#include <string>
#include <vector>

#include "report/fault_texts.h"
#include "report/plot/episode_figure.h"
#include "report/report.h"
#include "storage/history/alarm.h"

/// An episode in words.
namespace fdi::plot {

/// "0.42 (0.38 to 0.46)", "9.6 days (7.2 to 14.5)"; an interval without a
/// width that can be seen is left out.
std::string IntervalText(double value, double lowest, double highest,
                         int decimals, const std::string& unit = "");

/// What there is to say about an episode, for Report::Fields(). `source_id`,
/// `trace_instants` and the columns of fault_history are members of the
/// document.
std::vector<report::Column> EpisodeFields(const storage::Alarm& alarm,
                                          const report::FaultTexts& texts,
                                          bool utc);

/// What happened, in one sentence: "Named Flow transmitter wrong (f19),
/// strength 0.42."
std::string EventSentence(const storage::HistoryEntry& event,
                          const report::FaultTexts& texts);

/// The page of an episode to take along: its facts, what happened, what to
/// check for each fault of its name, lines for what was found, and a picture of
/// signals, residuals and decision factors.
/// @param alarm that of `evidence.episode`.
/// @param limits of drawing the picture. Where gnuplot is missing or nothing
///   was recorded, the page says so instead.
report::Report EpisodePage(const EpisodeEvidence& evidence,
                           const storage::Alarm& alarm,
                           const report::FaultTexts& texts, bool utc,
                           const GnuplotLimits& limits = {});

/// "Flow transmitter wrong", or what stands in the place of a name.
std::string PlainName(const storage::Episode& episode,
                      const report::FaultTexts& texts);

/// Its title: "FV-101: Flow transmitter wrong".
std::string EpisodeTitle(const storage::Episode& episode,
                         const report::FaultTexts& texts);

}  // namespace fdi::plot
