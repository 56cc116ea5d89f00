#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "cli/csv_cells.h"
#include "diagnosis/sample_series.h"

namespace fdi::cli {

/// A column of the CSV contract.
struct SignalColumn {
  std::string_view name;
  Signal signal;
  FlowUnit flow_unit;  ///< Of kF alone.
};

inline constexpr std::array<SignalColumn, kSignalCount + 1> kSignalColumns{{
    {"CV_pct", Signal::kCv, FlowUnit::kM3PerHour},
    {"P1_kPa", Signal::kP1, FlowUnit::kM3PerHour},
    {"P2_kPa", Signal::kP2, FlowUnit::kM3PerHour},
    {"T1_degC", Signal::kT1, FlowUnit::kM3PerHour},
    {"X_pct", Signal::kX, FlowUnit::kM3PerHour},
    {"F_m3_h", Signal::kF, FlowUnit::kM3PerHour},
    {"F_t_h", Signal::kF, FlowUnit::kTPerHour},
    {"SP_pct", Signal::kSp, FlowUnit::kM3PerHour},
    {"CVI", Signal::kCvi, FlowUnit::kM3PerHour},
    {"Ps_kPa", Signal::kPs, FlowUnit::kM3PerHour},
    {"Pz_kPa", Signal::kPz, FlowUnit::kM3PerHour},
}};

inline constexpr std::string_view kTimeColumn = "t_s";
inline constexpr std::string_view kModeColumn = "mode";
inline constexpr std::string_view kFaultColumn = "fault";
inline constexpr std::string_view kFaultNumberColumn = "fault_no";
inline constexpr std::string_view kStrengthColumn = "fault_strength";

/// Where a signal comes from in a foreign table:
/// value = offset + scale · cell, then 100 − value if it is % of opening.
struct ColumnMapping {
  std::string column;  ///< Name in the header of the file.
  Signal signal{Signal::kCv};
  double scale{1.0};
  double offset{0.0};
  Sense sense{Sense::kClosing};
};

/// The mapping of `--map tags.toml`. Signals that it does not name are still
/// found by the names of the CSV contract.
struct ColumnMap {
  std::string time_column{"t_s"};
  double time_scale{1.0};  ///< To seconds.
  std::vector<ColumnMapping> columns;
  std::optional<FlowUnit> flow_unit;  ///< Needed if the flow is mapped.
};

/// Settings of the CSV readers.
struct CsvOptions {
  std::string source{"input"};  ///< Name of the file, for messages.
  ColumnMap map;
  /// Columns that must be there; with a map, those of the map instead. Time,
  /// CV and one of X, F are always needed.
  SignalMask required{kBasicSignals};
  bool split_gaps{false};    ///< A gap starts another run, not an error.
  double period_s{0.0};      ///< 0: as the file has it.
  std::int64_t start_ns{0};  ///< UTC of t_s = 0.
};

/// What the header of a table says.
struct CsvHeader {
  SignalMask signals{0};
  FlowUnit flow_unit{FlowUnit::kM3PerHour};
  bool has_truth{false};
  std::vector<std::string> ignored_columns;  ///< Worth one notice.
};

/// A whole table: one run, or several with CsvOptions::split_gaps.
struct CsvTable {
  CsvHeader header;
  std::vector<SampleSeries> runs;
};

/// A row taken by CsvReader.
struct CsvRow {
  LabelledSample labelled;  ///< seq counts from 0; source_id 0, epoch 0.
  double t_s{0.0};
  bool after_gap{false};  ///< Starts another run (split_gaps).
};

/// Reads a table line by line, e.g. from a pipe. The sample period is the
/// option's, else the first step in time.
///
/// Header: t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h (or F_t_h), in any
/// order and case; optional SP_pct,CVI,Ps_kPa,Pz_kPa; optional truth: fault
/// (f1..f19, t1, p1, p2, normal) or fault_no (0..22) with fault_strength, where
/// only a non-zero strength marks a fault; optional mode (kValveModeNames; AUTO
/// if the column is not there). Further columns are ignored. A signal whose
/// cell is empty or `nan` is missing from that sample.
class CsvReader {
 public:
  /// @throws ConfigError if a map has a flow without its unit.
  explicit CsvReader(CsvOptions options);

  /// Takes the next line, without its end. @returns nothing for the header, for
  /// blank lines, and while a quoted cell goes on in the next line.
  /// @throws DataError naming source, line, column and reason: missing or
  ///   double column, cells too few or too many, not a finite number, an
  ///   unknown fault, a step in time that is not the sample period.
  std::optional<CsvRow> TakeLine(std::string_view line);

  /// After the last line. @throws DataError if there was no row.
  void Finish() const;

  /// After the first line.
  const CsvHeader& header() const { return header_; }
  /// 0 until it is known.
  double period_s() const { return period_s_; }
  std::int64_t line_number() const { return line_; }

 private:
  struct Conversion {
    std::size_t column;
    Signal signal;
    double scale;
    double offset;
    Sense sense;
  };

  void TakeHeader();
  void AddSignal(const Conversion& conversion);
  bool AddMapped(std::size_t column, std::string_view name);
  bool AddByContract(std::size_t column, std::string_view name);
  void CheckHeader() const;
  /// The value in the unit of the file; nothing if the reading is missing.
  std::optional<double> Reading(std::size_t column) const;
  double Number(std::size_t column) const;
  FaultTruth Truth() const;
  ValveMode Mode() const;
  bool CheckTime(double t_s);
  [[noreturn]] void Refuse(const std::string& reason) const;

  CsvOptions options_;
  CsvHeader header_;
  std::vector<std::string> names_;
  CsvCells record_;
  std::vector<Conversion> conversions_;
  std::optional<std::size_t> time_column_;
  std::optional<std::size_t> fault_column_;
  std::optional<std::size_t> strength_column_;
  std::optional<std::size_t> mode_column_;
  bool fault_by_number_{false};
  double period_s_{0.0};
  double last_t_s_{0.0};
  std::uint64_t rows_{0};
  std::int64_t line_{0};
};

/// Reads a whole table. The sample period is the option's, else the most usual
/// step, so that a jump is reported where it is.
/// @throws DataError as CsvReader, or if there are fewer than two rows and the
///   period is not given.
CsvTable ReadCsv(std::istream& input, const CsvOptions& options = {});

/// Opens `path`; CsvOptions::source becomes its name.
/// @throws DataError as above, or naming path and reason if it cannot be read.
CsvTable ReadCsvFile(const std::filesystem::path& path,
                     CsvOptions options = {});

/// Writes the columns of the contract for the signals that occur; mode if it is
/// not AUTO throughout; fault and fault_strength if truth is known. Numbers
/// read back as the same bits. t_s counts from `start_ns`. The cell of a signal
/// that a sample lacks, or of a flow in another unit than the run's, is empty.
void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns);

}  // namespace fdi::cli
