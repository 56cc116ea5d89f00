#include "storage/app/valve_baselines.h"

#include <algorithm>
#include <cmath>
#include <ostream>

#include "storage/cli/text_table.h"

namespace fdi::storage {
namespace {

using cli::Align;
using cli::Json;

// A row of the comparison: one figure in every epoch, NaN where it is not.
struct FigureRow {
  std::string name;
  std::vector<double> values;
};

class Comparison {
 public:
  explicit Comparison(std::size_t epochs) : epochs_(epochs) {}

  void Add(const std::string& name, std::size_t epoch, double value) {
    auto row = std::ranges::find(rows_, name, &FigureRow::name);
    if (row == rows_.end()) {
      rows_.push_back({name, std::vector<double>(epochs_, std::nan(""))});
      row = rows_.end() - 1;
    }
    row->values[epoch] = value;
  }
  const std::vector<FigureRow>& rows() const { return rows_; }

 private:
  std::size_t epochs_;
  std::vector<FigureRow> rows_;
};

std::vector<BaselineRecord> NewestOfEachEpoch(
    const std::vector<BaselineRecord>& records) {
  std::vector<BaselineRecord> newest;
  for (const BaselineRecord& record : records) {
    if (!newest.empty() && newest.back().epoch == record.epoch) {
      newest.back() = record;
    } else {
      newest.push_back(record);
    }
  }
  return newest;
}

Comparison Compare(const std::vector<BaselineRecord>& records) {
  Comparison comparison(records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    const BaselineRecord& record = records[i];
    comparison.Add("hours", i, record.hours);
    for (const auto& [name, value] : record.parameters) {
      comparison.Add(name, i, value);
    }
    for (const ChannelFigures& channel : record.channels) {
      comparison.Add(channel.name + " rmse", i, channel.rmse);
      comparison.Add(channel.name + " bias", i, channel.bias);
      comparison.Add(channel.name + " VAF [%]", i, channel.vaf);
    }
  }
  return comparison;
}

void PrintEvents(std::ostream& out, const std::vector<ValveEvent>& events,
                 const cli::Context& context) {
  cli::TextTable table(
      {{"epoch", Align::kRight}, {"event"}, {"at"}, {"by"}, {"note"}});
  for (const ValveEvent& event : events) {
    table.AddRow({std::to_string(event.epoch),
                  std::string(ValveEventKindName(event.kind)),
                  TimeText(event.at_ns, context), event.who, event.note});
  }
  table.Print(out);
}

void PrintComparison(std::ostream& out,
                     const std::vector<BaselineRecord>& records) {
  std::vector<cli::TextTable::Column> columns = {{"baseline"}};
  for (const BaselineRecord& record : records) {
    columns.push_back({"epoch " + std::to_string(record.epoch) + ": " +
                           record.model_set + '@' +
                           std::to_string(record.version),
                       Align::kRight});
  }
  cli::TextTable table(columns);
  const Comparison comparison = Compare(records);
  for (const FigureRow& row : comparison.rows()) {
    std::vector<std::string> cells = {row.name};
    for (const double value : row.values) {
      cells.push_back(std::isnan(value) ? "-" : cli::FormatNumber(value, 4));
    }
    table.AddRow(cells);
  }
  table.Print(out);
}

}  // namespace

void AddEpochs(ModelStore& store, const std::string& pattern, Json& object) {
  object["events"] = Json::array();
  for (const ValveEvent& event : store.ValveEvents(pattern)) {
    object["events"].push_back(
        {{"epoch", event.epoch},
         {"kind", std::string(ValveEventKindName(event.kind))},
         {"at_utc", TimeJson(event.at_ns)},
         {"who", event.who},
         {"note", event.note}});
  }
  object["baselines"] = Json::array();
  for (const BaselineRecord& record : store.Baselines(pattern)) {
    Json parameters = Json::object();
    for (const auto& [name, value] : record.parameters) {
      parameters[name] = value;
    }
    Json channels = Json::array();
    for (const ChannelFigures& channel : record.channels) {
      channels.push_back({{"name", channel.name},
                          {"rmse", channel.rmse},
                          {"bias", channel.bias},
                          {"vaf", channel.vaf}});
    }
    object["baselines"].push_back(
        {{"epoch", record.epoch},
         {"model_set", record.model_set + '@' + std::to_string(record.version)},
         {"created_utc", TimeJson(record.created_ns)},
         {"hours", record.hours},
         {"parameters", parameters},
         {"channels", channels}});
  }
}

void PrintEpochs(std::ostream& out, ModelStore& store,
                 const std::string& pattern, const cli::Context& context) {
  const auto events = store.ValveEvents(pattern);
  if (!events.empty()) {
    out << '\n';
    PrintEvents(out, events, context);
  }
  const auto records = NewestOfEachEpoch(store.Baselines(pattern));
  if (!records.empty()) {
    out << '\n';
    PrintComparison(out, records);
  }
}

}  // namespace fdi::storage
