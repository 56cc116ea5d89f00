#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iosfwd>
#include <limits>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/csv_cells.h"
#include "base/log.h"
#include "base/text_lines.h"
#include "base/time_text.h"
#include "diagnosis/model/sample_series.h"
#include "import/quality.h"
#include "import/time_unit.h"

namespace fdi::importer {

/// Signals that show whether a command is followed; a sample needs one.
inline constexpr SignalMask kAnswers =
    MaskOf(Signal::kX) | MaskOf(Signal::kF) | MaskOf(Signal::kPv);

/// SP beside a PV, in the unit of that.
inline constexpr std::string_view kSetPointOfPv = "SP";

/// A column of the CSV contract.
struct SignalColumn {
  std::string_view name;
  Signal signal;
  FlowUnit flow_unit;  ///< Used for kF only.
};

inline constexpr std::array<SignalColumn, kSignalCount + 2> kSignalColumns{{
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
    {"PV", Signal::kPv, FlowUnit::kM3PerHour},
    {kSetPointOfPv, Signal::kSp, FlowUnit::kM3PerHour},
}};

/// The columns of a table without PV have a unit, so that other tables with
/// names such as SP are not taken for it.
constexpr bool NeedsPv(const SignalColumn& column) {
  return column.name == kSetPointOfPv;
}

inline constexpr std::string_view kTimeColumn = "t_s";
inline constexpr std::string_view kModeColumn = "mode";
/// 1 where the loop is in automatic, else 0; instead of kModeColumn.
inline constexpr std::string_view kAutoColumn = "auto";
inline constexpr std::string_view kFaultColumn = "fault";
inline constexpr std::string_view kFaultNumberColumn = "fault_no";
inline constexpr std::string_view kStrengthColumn = "fault_strength";

/// Source of a signal in a foreign table:
/// value = offset + scale · cell, then 100 − value if it is % of opening.
struct ColumnMapping {
  std::string column;  ///< Name in the header, or the tag of a long table.
  Signal signal{Signal::kCv};
  double scale{1.0};
  double offset{0.0};
  Sense sense{Sense::kClosing};
  std::string unit{};  ///< Unit of the cells, as written in the map.
  /// Column of the quality of a wide table; empty: the one that is found.
  std::string quality{};
  /// Cells beyond, which are counts of a broken wire, are no readings.
  double lowest{-std::numeric_limits<double>::infinity()};
  double highest{std::numeric_limits<double>::infinity()};
  bool clamped{false};  ///< To 0..100 %: half of a split range.
  /// Range of a pressure difference in the cells, whose root is the flow.
  std::optional<std::pair<double, double>> root{};
};

/// Limit for a wide table; a long one may have as many tags.
inline constexpr std::size_t kMaxColumns = 20'000;
/// Bytes of lines in one pair of quotes; beyond, a quote is not closed.
inline constexpr std::size_t kLongestRecord = 2U << 20U;
/// Limit for a table in a gzip, so that a small file does not take much memory;
/// one that is not packed may have more, at some 170 bytes each.
inline constexpr std::size_t kMaxPackedRows = 1'000'000;

/// A table with one reading per row.
struct LongTable {
  std::string tag{"tag"};
  std::string value{"value"};
  std::string quality;  ///< Name of the column; empty: the one that is found.
};

/// Resampling of a signal to a fixed period.
struct Resampling {
  double period_s{1.0};
  bool linear{false};    ///< Otherwise the last reading is held.
  double limit_s{10.0};  ///< Limit for holding and interpolation.
};

/// F of a gas, stated at standard conditions and converted to t/h.
struct GasFlow {
  std::string unit;                ///< As written in the map: "Nm3/h".
  double molar_mass_kg_kmol{0.0};  ///< It was converted by.
};

/// Content of `--map tags.toml`, `--zone` and `--resample`. Signals that are
/// not mapped are still found by their names in the CSV contract.
struct ColumnMap {
  char separator{'\0'};  ///< NUL: detected.
  char decimal{'\0'};    ///< NUL: detected.
  /// Groups digits, beside blanks and '; NUL: detected.
  char thousands{'\0'};
  int skip{0};  ///< Lines in front of the names; 0: detected.
  /// Found by FindLayout(): cells of the rows, if the header has more.
  std::size_t width{0};
  int header_rows{0};  ///< Names, then units, ...; 0: detected.
  std::vector<std::string> no_reading;  ///< Words beside the usual ones.
  std::string time_column;   ///< Empty: t_s, time, timestamp or datetime.
  std::string clock_column;  ///< Time of day, if in a column of its own.
  std::string ms_column;     ///< Milliseconds, if in a column of their own.
  TimeUnit time_unit;
  DateOrder date_order{DateOrder::kNotSaid};
  std::string zone;  ///< For times without an offset; empty: the machine's.
  std::optional<LongTable> long_table;
  QualityWords quality;
  /// Found by FindLayout(): the column of the quality of a column, and the
  /// meaning of its numbers.
  std::map<std::string, std::string> quality_of;
  std::map<std::string, QualityCode> quality_codes;
  bool newest_first{false};  ///< Found by FindLayout().
  std::vector<ColumnMapping> columns;
  std::string mode_column;  ///< Empty: mode or auto, if there is one.
  /// Words of the mode beside the usual ones.
  std::map<std::string, ValveMode> mode_words;
  std::optional<FlowUnit> flow_unit;  ///< Needed if the flow is mapped.
  std::optional<GasFlow> gas_flow;
  std::optional<Resampling> resampling;
};

/// True if everything that `sample` has, three signals or more, is 0 in its
/// source, where that is a shut valve.
bool IsAllZero(const Sample& sample, const std::vector<ColumnMapping>& columns);
/// True if CV and X are open by a tenth, which no valve shuts between two
/// samples of a few seconds. Zeros beside it are no readings: some systems
/// write them where they have none.
bool IsOpen(const Sample& sample);

/// Settings of the CSV readers.
struct CsvOptions {
  /// For messages; ReadCsv() of lines has theirs.
  LinePlaces source{};
  ColumnMap map{};
  /// Required columns; with a map, those of the map instead. Time, CV and one
  /// of X, F are always required.
  SignalMask required{kBasicSignals};
  bool split_gaps{false};  ///< A gap starts another run instead of an error.
  bool scan{false};  ///< Rows have the cells() of any tag, and hold no signals.
  double period_s{0.0};  ///< 0: detected.
  /// Refuse values that are impossible for a valve; not for a loop, whose PV
  /// may be anything.
  bool check_values{true};
  /// Leave out, with a note, a row with the time of the row before it, which
  /// exports in pieces have where two pieces meet; otherwise an error.
  bool skip_repeats{false};
  std::int64_t start_ns{0};  ///< UTC of t_s = 0, unless times have a date.
  LogSink log{};             ///< Receives CsvTable::notes, each as `csv_note`.
  /// Takes the samples, in their order, in place of CsvTable::runs, which then
  /// have none: for who would otherwise have them in memory twice.
  std::function<void(const LabelledSample&)> take{};
  std::size_t max_packed_rows{kMaxPackedRows};  ///< If it is in a gzip.
};

/// Information from the header of a table.
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
  bool dated{false};         ///< The times in the file have a date.
  std::int64_t start_ns{0};  ///< UTC of t = 0; dated: the first sample.
  /// The part of CV's range that moves X from end to end, if it is half of it.
  std::optional<std::pair<double, double>> split_range;
  /// Properties detected, converted or filled in, one sentence each.
  std::vector<std::string> notes;
};

/// A row accepted by CsvReader; in a long table it has one signal.
/// Without its PV the unit of a set point is not known.
inline void DropLoneSetPoint(SignalMask signals, Sample& sample) {
  if ((signals & MaskOf(Signal::kPv)) != 0 && !sample.Has(Signal::kPv)) {
    sample.present =
        static_cast<SignalMask>(sample.present & ~MaskOf(Signal::kSp));
  }
}

struct CsvRow {
  LabelledSample labelled;  ///< seq counts from 0; source_id 0, epoch 0.
  double t_s{0.0};          ///< Dated: since the first row.
  std::int64_t line{0};
};

/// Reads a table line by line; checking the time steps is left to the caller.
///
/// Header: t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h (or F_t_h), in any
/// order and case; optional SP_pct,CVI,Ps_kPa,Pz_kPa; optional PV, and with it
/// SP, unless a map names the columns; optional truth: fault
/// (kFaultNames, normal) or fault_no (0..kLastFault) with fault_strength, where
/// only a non-zero strength marks a fault; optional mode (kValveModeNames, or
/// the words of controllers, CAS, MAN, ...; AUTO if the column is missing).
/// Further columns are ignored. docs/import.md has the rest: other names, forms
/// of time, separators, long tables.
///
/// A signal whose cell is empty or means "no reading" (Bad, I/O Timeout, #N/A,
/// ...) is missing from that sample, with quality BAD.
class CsvReader {
 public:
  /// @throws ConfigError if a map has a flow without its unit.
  explicit CsvReader(CsvOptions options);

  /// Processes the next line, without its line break; `number` is its number if
  /// lines are left out or in another order. @returns nothing for the header
  /// and its repetitions, for blank lines and comments (#), for marker and
  /// summary rows, for an unmapped tag, and while a quoted cell continues on
  /// the next line.
  /// @throws DataError naming source, line, column, value, what was expected
  ///   and what to try: missing or duplicate column, too few or too many cells,
  ///   not a number, not a time, an unknown fault.
  std::optional<CsvRow> TakeLine(std::string_view line,
                                 std::int64_t number = 0);

  /// Call after the last line. @throws DataError if there was no row.
  void Finish() const;

  /// Valid after the header line.
  const CsvHeader& header() const { return header_; }
  const CsvOptions& options() const { return options_; }
  bool dated() const {
    return time_unit_.form != TimeForm::kElapsed &&
           time_unit_.form != TimeForm::kClock &&
           time_unit_.form != TimeForm::kFindOut;
  }
  const std::vector<std::string>& notes() const { return notes_; }
  const std::vector<std::string>& names() const { return names_; }
  const std::vector<std::string>& cells() const { return record_.cells(); }
  const TimeUnit& time_unit() const { return time_unit_; }
  /// True if the header is over.
  bool in_rows() const { return !names_.empty() && header_left_ == 0; }
  std::size_t markers() const { return markers_; }
  /// Cells beyond ColumnMapping::lowest and highest.
  std::size_t beyond(Signal signal) const { return beyond_[Index(signal)]; }
  [[noreturn]] void Refuse(const std::string& reason) const;
  /// With CsvOptions::scan: a cell of the last row. Cells of bad quality, or
  /// with a known word, are missing.
  struct ScannedCell {
    std::optional<double> value{};
    std::string_view unit{};
    bool missing{false};
  };
  ScannedCell ScannedAt(std::size_t column) const;

 private:
  struct Conversion {
    std::size_t column;
    ColumnMapping mapping;  ///< By the contract: without a unit.
    std::optional<std::size_t> quality{};
  };

  bool EndsRow(std::string_view line);
  bool BeginsHeader(std::string_view line);
  void TakeHeader();
  void TakeLongHeader();
  void AddQualities();
  std::optional<std::size_t> Column(std::string_view name);
  void AddSignal(std::size_t column, const ColumnMapping& mapping);
  void AddMapped();
  bool AddByContract(std::size_t column, std::string_view name);
  void CheckHeader() const;
  void CheckLongHeader() const;
  const std::string& Cell(std::size_t column) const {
    return record_.cells()[column];
  }
  /// The value in the unit of the file; nothing if there is no reading.
  std::optional<double> Reading(const Conversion& conversion,
                                const std::string& cell);
  std::optional<double> WithOwnUnit(const Conversion& conversion,
                                    const std::string& cell) const;
  std::optional<double> Parsed(std::string_view cell) const;
  double Number(std::size_t column) const;
  void Convert(const Conversion& conversion, Sample& sample);
  bool TakeTagged(Sample& sample);
  std::optional<SignalQuality> KnownQualityAt(std::size_t column) const;
  SignalQuality QualityAt(std::size_t column) const;
  bool IsMarker();
  /// "plant.csv:12: "
  std::string Place() const {
    return options_.source.At(static_cast<std::size_t>(line_)) + ": ";
  }
  std::string NoTime(const std::string& cell) const;
  void FindTimeForm(const std::string& cell);
  bool TakeTime(CsvRow& row);
  std::optional<std::int64_t> UtcOf(const std::string& cell);
  double ClockOf(const std::string& cell);
  void EndPage(const CsvRow& row);
  FaultTruth Truth() const;
  ValveMode Mode() const;

  CsvOptions options_;
  LocalClock clock_;
  CsvHeader header_;
  std::vector<std::string> names_;
  std::vector<std::string> header_cells_;  // As in the file.
  std::vector<std::string> notes_;
  CsvCells record_;
  std::vector<Conversion> conversions_;
  std::vector<std::optional<std::size_t>> qualities_;  // By scanned column.
  std::vector<bool> used_;
  std::optional<std::size_t> time_column_;
  std::optional<std::size_t> clock_column_;
  std::optional<std::size_t> ms_column_;
  std::optional<std::size_t> tag_column_;
  std::size_t value_column_{0};
  std::optional<std::size_t> quality_column_;
  std::optional<std::size_t> fault_column_;
  std::optional<std::size_t> strength_column_;
  std::optional<std::size_t> mode_column_;
  bool fault_by_number_{false};
  TimeUnit time_unit_;
  std::optional<std::int64_t> first_ns_;
  std::int64_t latest_ns_{0};  // In the row before.
  // Per tag, because a table may be sorted by tag; a wide table uses "".
  std::map<std::string, std::int64_t, std::less<>> last_ns_;
  std::uint64_t rows_{0};
  std::int64_t line_{0};
  std::size_t record_bytes_{0};  // While a quote is open.
  int header_left_{0};
  bool header_again_{false};  // Behind the row of pending_.
  // Marker rows that were left out, and what is wrong with the last of them if
  // more rows follow.
  std::size_t markers_{0};
  std::array<std::size_t, kSignalCount> beyond_{};
  std::string pending_{};
};

/// Reads a whole table (UTF-8, see ReadTextFile()). The sample period is the
/// option's, or else the median step. Samples within half a period of
/// its grid are moved onto it; ColumnMap::resampling makes a grid from any
/// table, where instants without a nearby reading have quality UNCERTAIN.
/// @throws DataError as CsvReader, or naming the line of a step that is not the
///   sample period; if there are fewer than two rows and no period is given; if
///   the decimal sign is ambiguous; if most values of a mapped signal are
///   impossible; if a gzip has more than CsvOptions::max_packed_rows.
CsvTable ReadCsv(std::string_view text, const CsvOptions& options = {});
CsvTable ReadCsv(const TextLines& lines, const CsvOptions& options);

/// Reads `path`, or stdin for `-`.
/// @throws as above and as ReadTextFile().
CsvTable ReadCsvFile(const std::filesystem::path& path,
                     const CsvOptions& options = {});

/// The mode that a word of a controller means: AUT, CAS, IMAN, OOS, ...
std::optional<ValveMode> ModeOfWord(std::string_view word);

/// "12.3" of "12.3?" and "12.3*", which historians write for a reading that is
/// questionable or substituted; other cells as they are.
std::string_view WithoutFlag(std::string_view cell);

/// Feeds whole tables to `reader`, from the end if they are newest first, and
/// calls take(row) for each row.
void ForEachRow(const TextLines& lines, CsvReader& reader,
                const std::function<void(CsvRow&&)>& take);

/// Median of the steps of `times_s`, or the shorter of two middle ones.
double MedianStep(const std::vector<double>& times_s);

/// Writes the CSV contract's columns for the signals that occur; mode if it is
/// not AUTO throughout; fault and fault_strength if the truth is known. Numbers
/// round-trip bit for bit. t_s counts from `start_ns`. The cell of a missing
/// signal, or of a flow in another unit than the run's, is empty.
/// @param stamps also write stamp_ns and utc, which a reader ignores.
void WriteCsv(std::ostream& output, std::span<const LabelledSample> samples,
              FlowUnit flow_unit, std::int64_t start_ns, bool stamps = false);

}  // namespace fdi::importer
