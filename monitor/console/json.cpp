#include "monitor/console/json.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <string_view>

namespace fdi::console {
namespace {

constexpr int kReadingDecimals = 4;
constexpr int kFactorDecimals = 3;

std::string KeyOf(Signal signal) {
  std::string key(SignalName(signal));
  std::transform(key.begin(), key.end(), key.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return key;
}

std::string_view QualityOf(const ValveState& valve) {
  switch (valve.silence) {
    case monitor::Silence::kStale:
      return "STALE";
    case monitor::Silence::kEnded:
      return "ENDED";
    case monitor::Silence::kNone:
      break;
  }
  return QualityName(valve.quality);
}

Json FaultsOf(const ValveState& valve) {
  Json faults = Json::array();
  for (std::size_t f = 0; valve.models && f < valve.models->faults.size();
       ++f) {
    if ((valve.isolated >> f & 1U) != 0) {
      faults.push_back(valve.models->faults[f]);
    }
  }
  return faults;
}

Json FactorsJson(const std::vector<double>& factors) {
  Json list = Json::array();
  for (const double factor : factors) {
    list.push_back(Rounded(factor, kFactorDecimals));
  }
  return list;
}

Json ChannelsJson(const ModelFacts* models) {
  Json channels = Json::array();
  for (std::size_t c = 0; models != nullptr && c < models->channels.size();
       ++c) {
    const ModelFacts::Channel& channel = models->channels[c];
    channels.push_back({{"name", channel.name},
                        {"unit", channel.unit},
                        {"low", channel.low},
                        {"high", channel.high}});
  }
  return channels;
}

// A column for each signal that any of the points has.
void AddReadings(const std::vector<monitor::TracePoint>& points, Json& trend) {
  SignalMask present = 0;
  for (const monitor::TracePoint& point : points) {
    present = static_cast<SignalMask>(present | point.sample.present);
  }
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if ((present & MaskOf(signal)) == 0) {
      continue;
    }
    Json column = Json::array();
    for (const monitor::TracePoint& point : points) {
      column.push_back(point.sample.Has(signal)
                           ? Rounded(point.sample[signal], kReadingDecimals)
                           : Json());
    }
    trend[KeyOf(signal)] = std::move(column);
  }
}

// One column of numbers per index; null where a point has none.
template <typename Values>
Json Columns(const std::vector<monitor::TracePoint>& points, std::size_t count,
             int decimals, Values values) {
  Json columns = Json::array();
  for (std::size_t c = 0; c < count; ++c) {
    Json column = Json::array();
    for (const monitor::TracePoint& point : points) {
      const std::vector<double>& row = values(point);
      column.push_back(c < row.size() ? Rounded(row[c], decimals) : Json());
    }
    columns.push_back(std::move(column));
  }
  return columns;
}

template <typename Value>
Json Column(const std::vector<monitor::TracePoint>& points, Value value) {
  Json column = Json::array();
  for (const monitor::TracePoint& point : points) {
    column.push_back(value(point));
  }
  return column;
}

}  // namespace

std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Json Ms(std::int64_t stamp_ns) {
  return stamp_ns / 1'000'000;
}

Json Ms(const std::optional<std::int64_t>& stamp_ns) {
  return stamp_ns ? Ms(*stamp_ns) : Json();
}

Json Rounded(double value, int decimals) {
  if (!std::isfinite(value)) {
    return {};
  }
  const double scale = std::pow(10.0, decimals);
  const double rounded = std::round(value * scale) / scale;
  return rounded == 0.0 ? 0.0 : rounded;  // No "-0.0".
}

Json TextOrNull(const std::string& text) {
  return text.empty() ? Json() : Json(text);
}

Json TileJson(const ValveState& valve, const ValveAlarm& alarm,
              bool newest_only) {
  const bool named = valve.isolated != 0;
  Json tile = {
      {"id", valve.id},
      {"state", StateName(valve.state)},
      {"quality", QualityOf(valve)},
      {"reasons", CoverageReasonsName(valve.reasons)},
      {"faults", FaultsOf(valve)},
      {"factor", named ? Rounded(valve.factor, kFactorDecimals) : Json()},
      {"strength", named ? Rounded(valve.strength, kFactorDecimals) : Json()},
      {"d0", Rounded(valve.d0, kFactorDecimals)},
      {"stamp_ms", valve.stamp_ns == 0 ? Json() : Ms(valve.stamp_ns)},
      {"since_ms", Ms(alarm.since_ns)},
      {"episode", TextOrNull(alarm.episode)},
      {"model_set", valve.models ? Json(valve.models->model_set) : Json()},
      {"shelved_until_ms", Ms(alarm.shelved_until_ns)},
      {"unacked", alarm.unacked}};
  if (newest_only) {
    tile["v"] = valve.spark.empty()
                    ? Json()
                    : Rounded(valve.spark.back(), kFactorDecimals);
  } else {
    tile["spark"] = FactorsJson(valve.spark);
  }
  return tile;
}

Json ModelFactsJson(const ModelFacts& models) {
  char hash[17];
  std::snprintf(hash, sizeof hash, "%016llx",
                static_cast<unsigned long long>(models.hash));
  return {
      {"model_set", models.model_set},     {"hash", hash},
      {"channels", ChannelsJson(&models)}, {"faults", models.faults},
      {"T", models.isolation_threshold},   {"t_k", models.isolation_samples},
      {"n_d", models.detection_samples},   {"period_s", models.period_s}};
}

Json TrendJson(const ModelFacts* models, const std::string& valve_id,
               const std::vector<monitor::TracePoint>& points) {
  Json trend = {
      {"valve", valve_id},
      {"model_set", models != nullptr ? Json(models->model_set) : Json()},
      {"channels", ChannelsJson(models)},
      {"faults",
       models != nullptr ? models->faults : std::vector<std::string>{}},
      {"T", models != nullptr ? Json(models->isolation_threshold) : Json()}};
  trend["t_ms"] = Column(
      points, [](const auto& point) { return Ms(point.sample.stamp_ns); });
  AddReadings(points, trend);
  trend["residuals"] = Columns(
      points, models != nullptr ? models->channels.size() : 0, kReadingDecimals,
      [](const auto& point) -> const auto& { return point.residuals; });
  trend["d0"] = Column(points, [](const auto& point) {
    return Rounded(point.normal_factor, kFactorDecimals);
  });
  trend["d"] = Columns(
      points, models != nullptr ? models->faults.size() : 0, kFactorDecimals,
      [](const auto& point) -> const auto& { return point.factors; });
  trend["state"] =
      Column(points, [](const auto& point) { return StateName(point.state); });
  trend["quality"] = Column(
      points, [](const auto& point) { return QualityName(point.quality); });
  trend["flow_unit"] = FlowUnitName(
      points.empty() ? FlowUnit::kM3PerHour : points.back().sample.flow_unit);
  return trend;
}

Json MarksJson(const std::vector<Mark>& marks) {
  Json list = Json::array();
  for (const Mark& mark : marks) {
    list.push_back({{"t_ms", Ms(mark.stamp_ns)},
                    {"kind", TransitionName(mark.kind)},
                    {"text", mark.text}});
  }
  return list;
}

Json GapJson(const monitor::DataGap& gap) {
  return {{"valve", TextOrNull(gap.valve_id)},
          {"from_ms", Ms(gap.from_ns)},
          {"to_ms", Ms(gap.to_ns)},
          {"reason", gap.reason}};
}

Json SampleJson(const std::string& valve_id, const monitor::TracePoint& point) {
  Json sample = {{"valve", valve_id}, {"t_ms", Ms(point.sample.stamp_ns)}};
  for (std::size_t s = 0; s < kSignalCount; ++s) {
    const auto signal = static_cast<Signal>(s);
    if (point.sample.Has(signal)) {
      sample[KeyOf(signal)] = Rounded(point.sample[signal], kReadingDecimals);
    }
  }
  Json residuals = Json::array();
  for (const double residual : point.residuals) {
    residuals.push_back(Rounded(residual, kReadingDecimals));
  }
  sample["residuals"] = std::move(residuals);
  sample["d0"] = Rounded(point.normal_factor, kFactorDecimals);
  sample["d"] = FactorsJson(point.factors);
  sample["state"] = StateName(point.state);
  sample["quality"] = QualityName(point.quality);
  return sample;
}

}  // namespace fdi::console
