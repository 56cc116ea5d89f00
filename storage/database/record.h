#pragma once

#include <string>
#include <string_view>
#include <tuple>
#include <vector>

#include "diagnosis/model/sample.h"
#include "diagnosis/records/fields.h"
#include "storage/database/database.h"

// SQL and binding of flat records, driven by their single field list,
// kFieldsOf.
namespace fdi::storage {

template <>
struct EnumText<FlowUnit> {
  static constexpr auto name = FlowUnitName;
  static constexpr auto last = FlowUnit::kTPerHour;
};

/// "valve_id, from_ns, to_ns, reason"
template <typename Record>
std::string ColumnsOf() {
  std::string columns;
  std::apply(
      [&columns](const auto&... field) {
        ((columns.append(columns.empty() ? "" : ", ").append(field.name)), ...);
      },
      kFieldsOf<Record>);
  return columns;
}

/// "SELECT a, b " followed by `from`, which begins with FROM.
template <typename Record>
std::string SelectSql(std::string_view from) {
  return std::string("SELECT ")
      .append(ColumnsOf<Record>())
      .append(" ")
      .append(from);
}

/// "INSERT INTO table (a, b) VALUES (?, ?) " followed by `rest`, such as an ON
/// CONFLICT clause. `nullable` lists columns, each between blanks, for which an
/// empty text becomes NULL.
template <typename Record>
std::string InsertSql(std::string_view table, std::string_view rest = "",
                      std::string_view nullable = "") {
  std::string values;
  std::apply(
      [&](const auto&... field) {
        ((values.append(values.empty() ? "" : ", ")
              .append(nullable.find(" " + std::string(field.name) + " ") !=
                              std::string_view::npos
                          ? "nullif(?, '')"
                          : "?")),
         ...);
      },
      kFieldsOf<Record>);
  return std::string("INSERT INTO ")
      .append(table)
      .append(" (" + ColumnsOf<Record>() + ") VALUES (" + values + ") ")
      .append(rest);
}

/// Binds all fields, in order.
template <typename Record>
Statement& BindRecord(Statement& statement, const Record& record) {
  return std::apply(
      [&](const auto&... field) -> Statement& {
        return statement.Bind(field(record)...);
      },
      kFieldsOf<Record>);
}

/// Reads a record from the current row, whose columns from `first` on are
/// ColumnsOf<Record>().
template <typename Record>
Record ReadRecord(const Statement& row, int first = 0) {
  Record record;
  std::apply([&](const auto&... field) { row.Read(first, field(record)...); },
             kFieldsOf<Record>);
  return record;
}

/// The records of all remaining rows.
template <typename Record>
std::vector<Record> ReadRecords(Statement& rows) {
  std::vector<Record> records;
  while (rows.Step()) {
    records.push_back(ReadRecord<Record>(rows));
  }
  return records;
}

}  // namespace fdi::storage
