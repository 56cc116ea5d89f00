#pragma once

#include <string>

#include "storage/database.h"
#include "storage/history_types.h"

namespace fdi::storage {

/// SQL for kEpisodeColumns of the newest `limit` episodes of `filter`, oldest
/// first. Each filter walks an index of its own, newest first, so that a limit
/// ends it early; the one that narrows most leads: valve id, fault, open,
/// unacknowledged, time.
std::string ListQuery(const EpisodeFilter& filter);

/// SQL for the columns of EpisodeStatistics, by valve and fault, from an index
/// that covers them.
std::string StatisticsQuery(const EpisodeFilter& filter);

/// SQL for the columns of AlarmSpan, by detection, from the same index: the
/// episodes that touch the filter's time.
std::string AlarmSpanQuery(const EpisodeFilter& filter);

/// SQL for kEpisodeColumns of open episodes and ended ones that nobody has
/// acknowledged, newest first; the newest ?1, open ones before others.
std::string AlarmListQuery();

/// Binds the parameters of all: ?1 valve, ?2 since, ?3 until, ?4 fault, ?5 now,
/// and of ListQuery() ?6 limit; AlarmSpanQuery() takes no ?5.
/// @throws ConfigError for a fault that is none.
void BindListQuery(Statement& statement, const EpisodeFilter& filter);
void BindStatisticsQuery(Statement& statement, const EpisodeFilter& filter);

}  // namespace fdi::storage
