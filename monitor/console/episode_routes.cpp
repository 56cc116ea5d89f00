// One episode: what happened, with its evidence.
#include <algorithm>
#include <array>

#include <httplib.h>

#include "monitor/console/api.h"
#include "storage/cli/time_text.h"
#include "storage/csv_columns.h"
#include "storage/history_shelf.h"

namespace fdi::console {
namespace {

using monitor::TracePoint;
using storage::HistoryReader;

TracePoint PointOf(const storage::TraceInstant& instant) {
  TracePoint point;
  point.sample = instant.received.sample;
  point.intake = instant.received.intake;
  point.initialised = instant.received.initialised;
  point.quality = instant.quality;
  point.state = instant.state;
  point.isolated = instant.isolated;
  point.residuals = instant.residuals;
  point.normal_factor = instant.normal_factor;
  point.factors = instant.fault_factors;
  return point;
}

std::vector<TracePoint> PointsOf(HistoryReader& reader, std::uint64_t id) {
  std::vector<TracePoint> points;
  for (const storage::TraceInstant& instant : reader.Trace(id)) {
    points.push_back(PointOf(instant));
  }
  return points;
}

// Of what people did, a value and who; of transitions, what was decided.
Json EventJson(const storage::EpisodeEvent& event) {
  const bool by_hand = !event.who.empty();
  return {{"kind", event.kind},
          {"at_ms", Ms(event.stamp_ns)},
          {"recorded_ms", Ms(event.recorded_ns)},
          {"faults", TextOrNull(event.faults)},
          {"factor", by_hand ? Json() : Rounded(event.factor, 3)},
          {"strength", by_hand ? Json() : Rounded(event.strength, 3)},
          {"reason", TextOrNull(event.reason)},
          {"value", TextOrNull(event.value)},
          {"who", TextOrNull(event.who)},
          {"comment", TextOrNull(event.comment)},
          {"origin", TextOrNull(event.origin)}};
}

Json MarksOf(const std::vector<storage::EpisodeEvent>& events) {
  Json marks = Json::array();
  for (const storage::EpisodeEvent& event : events) {
    if (event.who.empty()) {
      marks.push_back(
          {{"t_ms", Ms(event.stamp_ns)},
           {"kind", event.kind},
           {"text", event.faults.empty() ? event.reason : event.faults}});
    }
  }
  return marks;
}

Json GapsOf(HistoryReader& reader, const storage::Episode& episode,
            const std::vector<TracePoint>& points) {
  Json gaps = Json::array();
  if (points.empty()) {
    return gaps;
  }
  storage::EpisodeFilter filter;
  filter.since_ns = points.front().sample.stamp_ns;
  filter.until_ns = points.back().sample.stamp_ns;
  for (const storage::DataGap& gap : reader.Gaps(filter)) {
    if (gap.valve_id.empty() || gap.valve_id == episode.valve_id) {
      gaps.push_back(
          GapJson({gap.valve_id, gap.from_ns, gap.to_ns, gap.reason}));
    }
  }
  return gaps;
}

// Where the episode is best understood: at its isolation, else the last
// instant that was abnormal.
const TracePoint* Telling(const storage::Episode& episode,
                          const std::vector<TracePoint>& points) {
  const TracePoint* telling = nullptr;
  for (const TracePoint& point : points) {
    const bool before_isolation =
        !episode.isolated_ns || point.sample.stamp_ns <= *episode.isolated_ns;
    if (point.state != State::kNormal && before_isolation) {
      telling = &point;
    }
  }
  return telling;
}

storage::Alarm AlarmFor(HistoryReader& reader, const std::string& id,
                        std::int64_t now_ns) {
  return storage::AsAlarms({reader.Show(id)},
                           storage::ReadShelves(reader.database(), now_ns),
                           now_ns)
      .front();
}

Json Episode(const Api& api, const std::string& id) {
  HistoryReader reader(api.sources.history);
  const storage::Alarm alarm = AlarmFor(reader, id, api.sources.utc_now_ns());
  const storage::Episode& episode = alarm.episode;
  const auto events = reader.Events(episode.id);
  const std::vector<TracePoint> points = PointsOf(reader, episode.id);
  const auto models = api.models.For(episode);

  Json trace = TrendJson(models.get(), episode.valve_id, points);
  trace["gaps"] = GapsOf(reader, episode, points);
  trace["marks"] = MarksOf(events);
  const TracePoint* telling = Telling(episode, points);
  trace["words"] = telling != nullptr
                       ? Json(Explain(*models, *telling,
                                      [&api](std::string_view f) {
                                        return api.PlainName(f);
                                      }))
                       : Json();
  Json list = Json::array();
  for (const storage::EpisodeEvent& event : events) {
    list.push_back(EventJson(event));
  }
  return {{"episode", AlarmJson(alarm, api.texts)},
          {"events", std::move(list)},
          {"trace", std::move(trace)},
          {"model_hash", ModelFactsJson(*models)["hash"]}};
}

std::string Cell(double value) {
  return Dump(Rounded(value, 6)) == "null" ? "" : Dump(Rounded(value, 6));
}

std::string_view ColumnName(Signal signal, FlowUnit unit) {
  for (const storage::SignalColumn& column : storage::kSignalColumns) {
    if (column.signal == signal &&
        (signal != Signal::kF || column.flow_unit == unit)) {
      return column.name;
    }
  }
  return SignalName(signal);
}

std::string Header(const ModelFacts& models, SignalMask signals) {
  std::string line = "utc";
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if ((signals & MaskOf(signal)) != 0) {
      line.append(",").append(ColumnName(signal, models.flow_unit));
    }
  }
  for (const ModelFacts::Channel& channel : models.channels) {
    line.append(",r_").append(channel.name);
  }
  line.append(",d0");
  for (const std::string& fault : models.faults) {
    line.append(",d_").append(fault);
  }
  return line.append(",state,quality\n");
}

std::string Row(const TracePoint& point, SignalMask signals) {
  std::string line = cli::FormatTime(point.sample.stamp_ns, true);
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if ((signals & MaskOf(signal)) != 0) {
      line.append(",").append(
          point.sample.Has(signal) ? Cell(point.sample[signal]) : "");
    }
  }
  for (const double residual : point.residuals) {
    line.append(",").append(Cell(residual));
  }
  line.append(",").append(Cell(point.normal_factor));
  for (const double factor : point.factors) {
    line.append(",").append(Cell(factor));
  }
  line.append(",").append(StateName(point.state));
  return line.append(",").append(QualityName(point.quality)).append("\n");
}

std::string EpisodeCsv(const Api& api, const std::string& id) {
  HistoryReader reader(api.sources.history);
  const storage::Episode episode = reader.Show(id);
  const std::vector<TracePoint> points = PointsOf(reader, episode.id);
  SignalMask signals = 0;
  for (const TracePoint& point : points) {
    signals = static_cast<SignalMask>(signals | point.sample.present);
  }
  std::string text = Header(*api.models.For(episode), signals);
  for (const TracePoint& point : points) {
    text += Row(point, signals);
  }
  return text;
}

}  // namespace

void AddEpisodeRoutes(httplib::Server& server, const Api& api) {
  server.Get(
      "/api/v1/episodes/([0-9a-fA-F]{1,16}|last)",
      Answering([&api](const httplib::Request& request, httplib::Response&) {
        return Episode(api, request.matches[1]);
      }));
  server.Get("/api/v1/episodes/([0-9a-f]{1,16}|last)\\.csv",
             AnsweringFile([&api](const httplib::Request& request) {
               const std::string id = request.matches[1];
               return FileAnswer{"text/csv; charset=utf-8",
                                 "episode-" + id + ".csv", EpisodeCsv(api, id)};
             }));
}

}  // namespace fdi::console
