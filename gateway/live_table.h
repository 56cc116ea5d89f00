#pragma once

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "import/assembler.h"

namespace fdi::gateway {

/// Where a tag comes from a broker.
struct LiveTopic {
  std::string topic;
  std::string tag;
  std::string value_key;  ///< In the JSON of a payload; empty: "value" or "v".
  std::string time_key;   ///< The same; empty: "time", "ts" or "t".

  friend bool operator==(const LiveTopic&, const LiveTopic&) = default;
};

struct RefusedRow {
  std::string name;
  std::string place;  ///< "plant.toml [[loop]] 3"
  std::string why;
};

/// The live part of a plant table: its valves, tags and topics.
struct LiveTable {
  std::int64_t period_ns{1'000'000'000};  ///< By the key `resample`.
  std::vector<importer::LiveValve> valves;
  std::vector<LiveTopic> topics;  ///< From rows with the key `topic`.
  std::vector<RefusedRow> refused;
};

/// Reads the table that files are onboarded by. An error in a row
/// refuses that row. Signals are OP as CV, X, the flow as F where its unit is
/// known, P1, P2, T1; PV with SP where the PV is not the flow, or has a set
/// point.
/// @param by_topics rows need a topic, and are periodic unless they say
///   otherwise: that a broker is alive says nothing of its devices.
/// @throws as importer::ReadPlantTable(); ConfigError for `resample`.
LiveTable ReadLiveTable(const std::filesystem::path& path, bool by_topics);

/// The tags that a client has to subscribe to.
std::set<std::string, std::less<>> TagsOf(const LiveTable& table);

}  // namespace fdi::gateway
