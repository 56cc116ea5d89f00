#include "import/signal_guess.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "base/correlation.h"
#include "base/csv_cells.h"
#include "base/error.h"
#include "base/local_sense.h"
#include "base/text.h"
#include "import/column_role.h"
#include "import/tag_map.h"

// Each column is first judged by itself: its role by name and unit, and whether
// its values fit that role. Then the signals choose among the columns: each
// takes the one with the heaviest claim of the tables below, in their order.
namespace fdi::importer {
namespace {

/// The weight of a role for a signal of a valve, in the order in which the
/// signals choose.
struct Claim {
  Signal signal;
  Role role;
  double weight;
};
constexpr Claim kClaims[] = {
    {Signal::kCv, Role::kCommand, 40.0},
    {Signal::kCv, Role::kValve, 20.0},  // Without a command nothing is judged.
    {Signal::kCv, Role::kFlow, 10.0},   // A controller beside its flow.
    {Signal::kX, Role::kPosition, 40.0},
    {Signal::kX, Role::kValve, 20.0},
    {Signal::kF, Role::kFlow, 40.0},
    {Signal::kP1, Role::kUpstream, 40.0},
    {Signal::kP1, Role::kPressure, 20.0},
    {Signal::kP2, Role::kDownstream, 40.0},
    {Signal::kP2, Role::kPressure, 20.0},  // The lower of two.
    {Signal::kT1, Role::kTemperature, 40.0},
    {Signal::kPz, Role::kSupply, 40.0},
    {Signal::kSp, Role::kSetpoint, 40.0}};
// Added to these. At equal weights the first column counts.
constexpr double kKnown = 1000.0;     // By the contract or the caller's map.
constexpr double kByWord = 5.0;       // Rather than by letters of a tag.
constexpr double kController = -3.0;  // A flow that may be a set point.
constexpr double kSwitch = -8.0;      // Two values at most.
constexpr double kMovesFirst = 1.0;   // For the command of two valves.
constexpr double kHigher = 6.0;       // Higher of two pressures; above a word.

/// The weight of a column for a signal of a loop, by the last part of its name
/// and by its role. The first row of the signal that holds counts.
struct LoopClaim {
  Signal signal;
  std::optional<Role> attribute;  ///< Nothing: it has none.
  std::optional<Role> role;       ///< Nothing: any.
  int weight;
};
constexpr LoopClaim kLoopClaims[] = {
    {Signal::kCv, Role::kCommand, {}, 4},
    {Signal::kCv, {}, Role::kCommand, 2},
    {Signal::kF, Role::kMeasured, Role::kPosition, 0},
    {Signal::kF, Role::kMeasured, Role::kValve, 3},
    {Signal::kF, Role::kMeasured, {}, 4},
    {Signal::kF, {}, Role::kFlow, 2},
    {Signal::kF, {}, Role::kLevel, 1},
    {Signal::kF, {}, Role::kTemperature, 1},
    {Signal::kF, {}, Role::kPressure, 1},
    {Signal::kSp, Role::kSetpoint, {}, 4},
    {Signal::kSp, {}, Role::kSetpoint, 2},
    {Signal::kX, Role::kPosition, {}, 4},
    {Signal::kX, Role::kMeasured, Role::kPosition, 4},
    {Signal::kX, {}, Role::kPosition, 2}};
/// From which weight on two columns are refused and not left out.
constexpr int kClear = 4;

/// Units by the size of the median, where none is stated.
struct UnitOfSize {
  Signal signal;
  double above;
  std::string_view unit;
};
constexpr UnitOfSize kUnitsOfSize[] = {
    {Signal::kF, 2e3, "kg/h"},    {Signal::kF, 0.0, "m3/h"},
    {Signal::kT1, 450.0, "degC"}, {Signal::kT1, 250.0, "K"},
    {Signal::kT1, 0.0, "degC"},   {Signal::kP1, 2e4, "Pa"},
    {Signal::kP1, 100.0, "kPa"},  {Signal::kP1, 0.0, "bar"}};
/// Units of a transmitter whose counts or currents have no stated range.
constexpr std::pair<Signal, std::string_view> kUnitsOfSpan[] = {
    {Signal::kF, "t/h"}, {Signal::kT1, "degC"}, {Signal::kP1, "bar"}};

// Counts of cards and registers at 100 %: tenths and hundredths of a per cent,
// 12, 15 and 16 bits, and the 27648 of Siemens.
constexpr double kFullScales[] = {1000.0,  4095.0,  10000.0,
                                  27648.0, 32767.0, 65535.0};

/// Outliers that decide nothing, and readings that may be codes of a state.
constexpr double kMaxOutliers = 0.05;
constexpr double kMaxCoded = 0.2;
constexpr std::size_t kMaxCodes = 4;
constexpr std::size_t kMinRepeats = 3;

bool IsPercent(Signal signal) {
  return signal == Signal::kCv || signal == Signal::kX || signal == Signal::kSp;
}

Signal KindOf(Signal signal) {
  return signal == Signal::kP2 || signal == Signal::kPs || signal == Signal::kPz
             ? Signal::kP1
             : signal;
}

void Say(SniffedColumn& column, const std::string& what) {
  column.guessed += (column.guessed.empty() ? "" : "; ") + what;
}

// True if the readings lie in [low, high], except a few outliers and a few
// repeated numbers such as -9999 or 32767, which are codes of a state. If the
// readings vary less than those numbers, the numbers are no codes.
bool IsWithin(const SniffedColumn& column, double low, double high) {
  std::map<double, std::size_t> within;
  std::map<double, std::size_t> beyond;
  for (const double value : column.values) {
    ++(value >= low && value <= high ? within : beyond)[value];
  }
  std::size_t coded = 0;
  std::size_t outliers = 0;
  std::size_t codes = 0;
  for (const auto& [value, count] : beyond) {
    const bool code = count >= kMinRepeats;
    codes += code ? 1U : 0U;
    (code ? coded : outliers) += count;
  }
  const auto total = static_cast<double>(column.values.size());
  return within.size() > codes && codes <= kMaxCodes &&
         static_cast<double>(outliers) <= kMaxOutliers * total &&
         static_cast<double>(coded) <= kMaxCoded * total;
}

// The range of a percentage in the numbers of the file.
std::pair<double, double> PercentRange(const SniffedColumn& column) {
  if (SameName(column.unit, "mA")) {
    return {3.0, 21.0};
  }
  const auto conversion = FindUnit(Signal::kX, column.unit);
  const double scale = conversion ? conversion->scale : 1.0;
  return {-15.0 / scale, 115.0 / scale};
}

// True if most values fit a percentage in a unit, or without one; sets the unit
// where none is stated.
bool FitsPercent(SniffedColumn& column) {
  if (column.unit.empty()) {
    // Beside shares, a value that may be a percentage is no code.
    const auto count = [&](double low, double high) {
      return std::ranges::count_if(
          column.values, [&](double v) { return v >= low && v <= high; });
    };
    const bool share = IsWithin(column, -0.1, 1.1) &&
                       20 * count(-0.1, 1.1) >= 19 * count(-15.0, 115.0);
    column.unit = share ? "1" : "%";
    Say(column, share ? "0 to 1 by size" : "% by size");
  }
  const auto [low, high] = PercentRange(column);
  return IsWithin(column, low, high);
}

// The counts at 100 % of an analog card: the smallest usual ones that the
// readings fit; nothing if the numbers are no counts.
std::optional<double> FullScale(const SniffedColumn& column) {
  if (!std::ranges::all_of(column.values,
                           [](double v) { return v == std::floor(v); }) ||
      IsWithin(column, -15.0, 115.0)) {
    return std::nullopt;
  }
  for (const double full : kFullScales) {
    if (IsWithin(column, -0.1 * full, 1.1 * full)) {
      return full;
    }
  }
  return std::nullopt;
}

// True if most values fit a signal in a unit, or without one; sets unit, raw
// and span. Most, because a few states and outliers are in every export.
//
// @param full the counts at 100 %, if the table has counts; else 0.
bool FitsSignal(SniffedColumn& column, Signal signal, const std::string& unit,
                double full) {
  column.unit = unit;
  column.raw.clear();
  column.span.clear();
  const bool current = SameName(unit, "mA");
  if (!unit.empty() && !current && !FindUnit(signal, unit)) {
    return false;
  }
  const bool counts = full > 0.0 && unit.empty() && FullScale(column);
  if (IsPercent(signal) && !counts) {
    return FitsPercent(column);
  }
  if (current || counts) {
    column.raw = current ? std::vector{4.0, 20.0} : std::vector{0.0, full};
    if (IsPercent(signal)) {
      column.unit = "%";
      Say(column, "counts of an analog card; " + NumberText(full) +
                      " at 100 % is the smallest usual range that they fit");
      return true;
    }
    column.span = {0.0, 100.0};
    Say(column, "span is open: state the range of the transmitter");
    column.unit = std::ranges::find(kUnitsOfSpan, KindOf(signal),
                                    &std::pair<Signal, std::string_view>::first)
                      ->second;
  } else if (unit.empty()) {
    const double median = std::abs(column.Quantile(0.5));
    column.unit = std::ranges::find_if(kUnitsOfSize, [&](const UnitOfSize& u) {
                    return u.signal == KindOf(signal) && median >= u.above;
                  })->unit;
    Say(column, signal == Signal::kF ? "the unit is open: no size tells it"
                                     : "unit by size");
  }
  return true;
}

// The range beyond which readings are outliers or codes: for a percentage that
// of its unit; else three quartile distances from the quartiles, or, where that
// would leave out more than a few, the middle 90 % and as much on either side.
std::pair<double, double> UsualRange(const SniffedColumn& column) {
  if (column.signal && IsPercent(*column.signal) && !column.given) {
    if (column.raw.empty()) {
      return PercentRange(column);
    }
    const double margin = 0.15 * (column.raw[1] - column.raw[0]);
    return {column.raw[0] - margin, column.raw[1] + margin};
  }
  const double lower = column.Quantile(0.25);
  const double upper = column.Quantile(0.75);
  const double reach = 3.0 * (upper - lower);
  if (IsWithin(column, lower - reach, upper + reach)) {
    return {lower - reach, upper + reach};
  }
  const double low = column.Quantile(0.05);
  const double high = column.Quantile(0.95);
  return {2.0 * low - high, 2.0 * high - low};
}

// Readings within a range, by time.
std::map<double, double> ReadingsOf(const SniffedColumn& column, double low,
                                    double high) {
  std::map<double, double> at;
  for (std::size_t k = 0; k < column.values.size(); ++k) {
    if (column.values[k] >= low && column.values[k] <= high) {
      at[column.times_s[k]] = column.values[k];
    }
  }
  return at;
}

// Correlation of b with a delayed by 0, 1 or 2 periods, the strongest. The
// delays allow for the lag of the rod behind the command, and of the flow
// behind the rod. The sign is kept, because the sense follows from it.
double Correlation(const SniffedColumn& a, const SniffedColumn& b) {
  const auto [low_a, high_a] = UsualRange(a);
  const auto [low_b, high_b] = UsualRange(b);
  const std::map<double, double> at = ReadingsOf(a, low_a, high_a);
  double strongest = 0.0;
  for (std::size_t lag = 0; lag <= 2; ++lag) {
    LocalSense sums;
    for (std::size_t k = lag; k < b.values.size(); ++k) {
      // In a compressed table, the last reading remains valid.
      const auto after = at.upper_bound(b.times_s[k - lag]);
      if (after != at.begin() && b.values[k] >= low_b &&
          b.values[k] <= high_b) {
        sums.Add(std::prev(after)->second, b.values[k]);
      }
    }
    const double r = sums.Value();
    strongest = std::abs(r) > std::abs(strongest) ? r : strongest;
  }
  return strongest;
}

// Positive if b follows a, negative if a follows b, 0 if neither: the command
// moves first.
double Lead(const SniffedColumn& a, const SniffedColumn& b) {
  const auto follows = [](const SniffedColumn& first,
                          const SniffedColumn& second) {
    constexpr double kAny = std::numeric_limits<double>::infinity();
    const std::map<double, double> at = ReadingsOf(first, -kAny, kAny);
    CorrelationSums sums;
    for (std::size_t k = 1; k < second.values.size(); ++k) {
      const auto then = at.find(second.times_s[k - 1]);
      if (then != at.end() && then != at.begin()) {
        sums.Add(then->second - std::prev(then)->second,
                 second.values[k] - second.values[k - 1]);
      }
    }
    return std::abs(sums.Correlation());
  };
  return follows(a, b) - follows(b, a);
}

// True if the readings are those of a counter: a flow falls now and then.
bool IsTotal(const SniffedColumn& column) {
  constexpr std::size_t kEnough = 60;
  return column.values.size() >= kEnough &&
         std::ranges::is_sorted(column.values) &&
         column.values.front() < column.values.back();
}

bool IsSwitch(const SniffedColumn& column) {
  return std::set<double>(column.values.begin(), column.values.end()).size() <=
         2;
}

/// A column that may be a signal.
struct Candidate {
  SniffedColumn* column;
  Role role{};
  RoleGuess guess;
  std::optional<Signal> known{};  // By the contract or the caller's map.
  double bonus{0.0};
};

class SignalGuess {
 public:
  SignalGuess(std::vector<SniffedColumn>& columns,
              std::vector<std::string>& findings)
      : columns_(columns), findings_(findings) {}

  void Guess() {
    Judge();
    CompareAlike();
    Choose();
    GuessSenses();
    NoteMissing();
  }

 private:
  void Judge();
  bool TakeKnown(Candidate& candidate) const;
  bool IsCandidate(Candidate& candidate);
  void CompareAlike();
  double Weight(const Candidate& candidate, Signal signal) const;
  bool IsOutput(const Candidate& candidate) const;
  void Choose();
  void Take(Candidate& candidate, Signal signal);
  void GuessSenses();
  void NoteMissing();
  /// The candidates of these roles, and how many there are.
  std::vector<Candidate*> Of(std::initializer_list<Role> roles) {
    std::vector<Candidate*> found;
    for (Candidate& candidate : candidates_) {
      if (IsOneOf(candidate, roles)) {
        found.push_back(&candidate);
      }
    }
    return found;
  }
  std::ptrdiff_t Count(std::initializer_list<Role> roles) const {
    return std::ranges::count_if(candidates_, [&](const Candidate& each) {
      return IsOneOf(each, roles);
    });
  }
  static bool IsOneOf(const Candidate& candidate,
                      std::initializer_list<Role> roles) {
    return !candidate.known &&
           std::ranges::find(roles, candidate.role) != roles.end();
  }
  SniffedColumn* At(Signal signal) {
    const auto found =
        std::ranges::find(columns_, signal, &SniffedColumn::signal);
    return found == columns_.end() ? nullptr : &*found;
  }

  std::vector<SniffedColumn>& columns_;
  std::vector<std::string>& findings_;
  std::vector<Candidate> candidates_;
  double full_{0.0};  // Counts at 100 %; 0: no counts.
};

void SignalGuess::Judge() {
  std::vector<SniffedColumn*> numbers;
  std::vector<std::string> names;
  std::vector<std::string> abouts;
  for (SniffedColumn& column : columns_) {
    if (column.HasReadings()) {
      numbers.push_back(&column);
      names.push_back(column.name);
      abouts.push_back(column.about);
    }
  }
  const std::vector<std::string> parts = DistinctParts(names, abouts);
  std::vector<Candidate> all;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    all.push_back({numbers[i], {}, RoleOf(names[i], abouts[i], parts[i])});
    // Command and position come over one kind of card: a flow of whole numbers
    // beside percentages is no count.
    const RoleGuess& guess = all.back().guess;
    const auto signal = guess.role ? SignalOf(*guess.role) : std::nullopt;
    if ((signal == Signal::kCv || signal == Signal::kX) && guess.unit.empty()) {
      full_ = std::max(full_, FullScale(*numbers[i]).value_or(0.0));
    }
  }
  for (Candidate& candidate : all) {
    if (TakeKnown(candidate) || IsCandidate(candidate)) {
      candidates_.push_back(std::move(candidate));
    }
  }
}

// A name of the contract, or a column of the caller's map.
bool SignalGuess::TakeKnown(Candidate& candidate) const {
  SniffedColumn& column = *candidate.column;
  // PV and SP are names of the contract in a table that has others of it.
  const bool is_contract = std::ranges::any_of(
      columns_,
      [](const SniffedColumn& each) { return SameName(each.name, "CV_pct"); });
  for (const SignalColumn& known : kSignalColumns) {
    if (SameName(known.name, column.name) &&
        (is_contract || (known.signal != Signal::kPv && !NeedsPv(known)))) {
      const std::string& unit = candidate.guess.unit;
      const bool by_name = !unit.empty() && FindUnit(known.signal, unit);
      candidate.known = known.signal;
      column.unit = by_name ? unit
                    : known.signal == Signal::kCvi
                        ? "1"
                        : std::string(SignalUnit(known.signal));
      return true;
    }
  }
  if (column.given) {
    candidate.known = column.given->signal;
    column.unit = column.given->unit;
    column.opening = column.given->sense == Sense::kOpening;
    Say(column, "given");
  }
  return candidate.known.has_value();
}

// True if the values fit the role; else notes why not.
bool SignalGuess::IsCandidate(Candidate& candidate) {
  SniffedColumn& column = *candidate.column;
  const RoleGuess& guess = candidate.guess;
  if (IsGasUnit(guess.unit)) {
    Say(column, "a flow of gas at standard conditions, which needs molar_mass");
    column.unit = guess.unit;
    findings_.push_back(
        column.name +
        " is a flow of gas at standard conditions, which becomes t/h by the "
        "molar mass: state [signal.F] with column, unit and molar_mass = 28.96 "
        "(air; kg/kmol; the map that sniff writes has these lines, to be "
        "uncommented), and onboard with a --type of that gas. Without it F "
        "is left out; CV and X still show what the rod does");
    return false;
  }
  if (!guess.role) {
    return false;
  }
  candidate.role = *guess.role;
  const auto signal = SignalOf(candidate.role);
  if (!signal) {
    Say(column, candidate.role == Role::kLevel  ? "a level"
                : candidate.role == Role::kMode ? "a mode"
                                                : "no signal of a valve");
    return false;
  }
  if (candidate.role == Role::kFlow && IsTotal(column)) {
    Say(column, "a total: it only rises");
    return false;
  }
  if (candidate.role == Role::kSetpoint && guess.unit.empty() &&
      guess.of_measurement) {
    Say(column, "a set point in the unit of its loop");
    return false;
  }
  if (!FitsSignal(column, *signal, guess.unit, full_)) {
    column.unit.clear();
    column.raw.clear();
    column.guessed = std::string(SignalName(*signal)) +
                     "? Its unit or its range does not fit";
    return false;
  }
  candidate.bonus =
      (guess.by_word ? kByWord : 0.0) + (IsSwitch(column) ? kSwitch : 0.0) +
      (*signal == Signal::kF && guess.of_controller ? kController : 0.0);
  return true;
}

// Compares columns that have like names. Among two tags of valves, the
// command moves first; among two pressures, that in front is the higher one.
void SignalGuess::CompareAlike() {
  constexpr double kSeen = 0.1;
  const auto valves = Of({Role::kValve});
  if (valves.size() == 2 && Of({Role::kCommand, Role::kPosition}).empty() &&
      std::ranges::none_of(candidates_, [](const Candidate& each) {
        return each.known == Signal::kCv || each.known == Signal::kX;
      })) {
    const double lead = Lead(*valves[0]->column, *valves[1]->column);
    Candidate& first = *valves[lead < 0.0 ? 1 : 0];
    first.bonus += kMovesFirst;
    Say(*first.column,
        std::abs(lead) > kSeen
            ? "moves before " + valves[lead < 0.0 ? 0 : 1]->column->name
            : "neither of the two moves first: check which is the command");
  }
  if (const auto two = Of({Role::kPressure}); two.size() == 2) {
    const bool first_is_lower =
        two[0]->column->Quantile(0.5) < two[1]->column->Quantile(0.5);
    two[first_is_lower ? 1 : 0]->bonus += kHigher;
  }
}

double SignalGuess::Weight(const Candidate& candidate, Signal signal) const {
  if (candidate.known) {
    return candidate.known == signal ? kKnown : 0.0;
  }
  const auto claim = std::ranges::find_if(kClaims, [&](const Claim& each) {
    return each.signal == signal && each.role == candidate.role;
  });
  if (claim == std::end(kClaims)) {
    return 0.0;
  }
  // "FC7" beside "FI7" is the output of the controller, where there is no
  // other, and of three pressures nothing says which is which.
  if ((signal == Signal::kCv && candidate.role == Role::kFlow &&
       !IsOutput(candidate)) ||
      (signal == Signal::kP2 && candidate.role == Role::kPressure &&
       Count({Role::kPressure, Role::kUpstream}) != 2)) {
    return 0.0;
  }
  return claim->weight + candidate.bonus;
}

bool SignalGuess::IsOutput(const Candidate& candidate) const {
  if (!candidate.guess.of_controller || !candidate.guess.unit.empty() ||
      candidate.guess.attribute == Role::kMeasured ||
      Count({Role::kFlow}) != 2) {
    return false;
  }
  SniffedColumn output = *candidate.column;
  return FitsSignal(output, Signal::kCv, "", full_);
}

void SignalGuess::Choose() {
  std::vector<Signal> signals;
  for (const Claim& claim : kClaims) {
    if (std::ranges::find(signals, claim.signal) == signals.end()) {
      signals.push_back(claim.signal);
    }
  }
  signals.insert(signals.end(), {Signal::kCvi, Signal::kPs, Signal::kPv});
  for (const Signal signal : signals) {
    Candidate* best = nullptr;
    double most = 0.0;
    for (Candidate& candidate : candidates_) {
      const double weight =
          candidate.column->signal ? 0.0 : Weight(candidate, signal);
      if (weight > most) {
        best = &candidate;
        most = weight;
      }
    }
    if (best != nullptr) {
      Take(*best, signal);
    }
  }
  for (const Candidate& candidate : candidates_) {
    if (!candidate.column->signal) {
      candidate.column->guessed =
          "another " +
          std::string(SignalName(candidate.known ? *candidate.known
                                                 : *SignalOf(candidate.role))) +
          "?";
    }
  }
}

void SignalGuess::Take(Candidate& candidate, Signal signal) {
  SniffedColumn& column = *candidate.column;
  column.signal = signal;
  if (candidate.known) {
    return;
  }
  if (candidate.role == Role::kValve) {
    Say(column, "a valve: command or position");
  } else if (candidate.role == Role::kFlow && signal == Signal::kCv) {
    column.guessed.clear();
    FitsSignal(column, signal, "", full_);
    column.guessed = "a controller beside its flow: likely its output";
  } else if (candidate.role == Role::kPressure && signal == Signal::kP2) {
    const bool alike = Of({Role::kPressure}).size() == 2;
    for (SniffedColumn* side : {At(Signal::kP1), &column}) {
      Say(*side, alike ? "P1 is the higher pressure"
                       : "P1 is in front of the valve by its name");
    }
  } else if (candidate.role == Role::kPressure &&
             Of({Role::kPressure, Role::kDownstream}).size() == 1) {
    Say(column, "P1 or P2: no name says on which side of the valve");
  }
}

// The flow rises with the opening, and follows the rod more closely than it
// follows the command: X, if there is one, is compared with the flow, and CV
// with X, with which it correlates more strongly. 0.3 is the limit of
// onboarding, too (docs/onboarding.md). Without a flow, plants count opening,
// and the columns of the contract closing.
void SignalGuess::GuessSenses() {
  constexpr double kSeen = 0.3;
  const SniffedColumn* flow = At(Signal::kF);
  const SniffedColumn* rod = nullptr;
  for (SniffedColumn* column : {At(Signal::kX), At(Signal::kCv)}) {
    if (column == nullptr) {
      continue;
    }
    const SniffedColumn* led_by = std::exchange(rod, rod ? rod : column);
    if (column->given) {
      continue;
    }
    const SniffedColumn* other = led_by != nullptr ? led_by : flow;
    const double r = other != nullptr ? Correlation(*column, *other) : 0.0;
    const bool seen = std::abs(r) > kSeen;
    if (led_by != nullptr) {
      column->opening = seen ? (r >= 0.0) == led_by->opening : led_by->opening;
      if (seen) {
        Say(*column, r >= 0.0 ? "moves with the rod" : "moves against the rod");
      }
    } else {
      const bool contract =
          SameName(column->name, "CV_pct") || SameName(column->name, "X_pct");
      column->opening = seen ? r > 0.0 : !contract;
      Say(*column, !seen     ? "the sense is open: no flow tells it"
                   : r > 0.0 ? "opening: the flow rises with it"
                             : "closing: the flow falls with it");
    }
  }
  if (SniffedColumn* setpoint = At(Signal::kSp)) {
    setpoint->opening = rod != nullptr && rod->opening;
  }
}

void SignalGuess::NoteMissing() {
  if (At(Signal::kCv) == nullptr) {
    findings_.push_back(
        "no command (CV) found: nothing can be judged without it. State its "
        "column under [signal.CV]");
  }
  if (At(Signal::kX) != nullptr || At(Signal::kF) != nullptr ||
      At(Signal::kPv) != nullptr) {
    return;
  }
  const auto level =
      std::ranges::find(columns_, "a level", &SniffedColumn::guessed);
  findings_.push_back(
      (level == columns_.end()
           ? std::string()
           : level->name + " is a level, which is neither the position nor "
                           "the flow of the valve. ") +
      "No position (X) and no flow (F) found: the command alone shows "
      "nothing about the valve. Export the position transmitter or the flow "
      "behind the valve, and state it under [signal.X] or [signal.F]");
}

int LoopWeight(const RoleGuess& guess, Signal signal) {
  const auto claim = std::ranges::find_if(kLoopClaims, [&](const auto& each) {
    return each.signal == signal && each.attribute == guess.attribute &&
           (!each.role || each.role == guess.role);
  });
  return claim == std::end(kLoopClaims) ? 0 : claim->weight;
}

/// A column and what its name says.
struct NamedColumn {
  const SniffedColumn* column;
  RoleGuess guess;
};

// The column with the heaviest claim. Among several, those with the tag of OP,
// or else those that measure the variable that the tag of OP controls.
const NamedColumn* LoopColumn(const std::vector<NamedColumn>& columns,
                              Signal signal, const std::string& option,
                              const RoleGuess& op, const std::string& source) {
  int most = 1;
  std::vector<const NamedColumn*> found;
  for (const NamedColumn& each : columns) {
    const int weight =
        each.column->HasReadings() ? LoopWeight(each.guess, signal) : 0;
    if (weight > most) {
      found.clear();
      most = weight;
    }
    if (weight == most) {
      found.push_back(&each);
    }
  }
  const auto keep = [&](const auto& is) {
    if (found.size() > 1 && std::ranges::any_of(found, is)) {
      std::erase_if(found, [&](const NamedColumn* each) { return !is(each); });
    }
  };
  keep([&](const NamedColumn* each) {
    return !op.tag.empty() && each->guess.tag == op.tag;
  });
  keep([&](const NamedColumn* each) {
    return op.of_tag && each->guess.role == op.of_tag;
  });
  if (found.size() > 1 && most >= kClear) {
    throw DataError(
        source + ": columns " +
        Quoted(JoinText(found, ",",
                        [](const auto* each) { return each->column->name; })) +
        " all look like --" + option + "; name one of them with it");
  }
  return found.size() == 1 ? found.front() : nullptr;
}

// OP and X in % of their range: a share of one and counts are told by their
// sizes, and what is neither stays as it is.
ColumnMapping LoopMapping(const NamedColumn& named, Signal signal) {
  ColumnMapping mapping{named.column->name, signal};
  const RoleGuess& guess = named.guess;
  SniffedColumn fitted = *named.column;
  const bool percent = signal == Signal::kCv || signal == Signal::kX;
  if (!percent || !fitted.HasReadings() ||
      !FitsSignal(fitted, signal, guess.unit,
                  FullScale(fitted).value_or(0.0))) {
    return mapping;
  }
  const auto unit = FindUnit(signal, fitted.unit);
  if (SameName(guess.unit, "mA")) {
    fitted.raw = {4.0, 20.0};
  }
  if (!fitted.raw.empty()) {
    mapping.scale = 100.0 / (fitted.raw[1] - fitted.raw[0]);
    mapping.offset = -mapping.scale * fitted.raw[0];
  } else if (unit) {
    mapping.scale = unit->scale;
  }
  mapping.unit = mapping.scale != 1.0 ? fitted.unit : "";
  return mapping;
}

}  // namespace

double SniffedColumn::Quantile(double share) const {
  std::vector<double> sorted = values;
  const auto at =
      sorted.begin() + static_cast<std::ptrdiff_t>(
                           share * static_cast<double>(sorted.size() - 1));
  std::nth_element(sorted.begin(), at, sorted.end());
  return *at;
}

void GuessSignals(std::vector<SniffedColumn>& columns,
                  std::vector<std::string>& findings) {
  SignalGuess(columns, findings).Guess();
}

void GuessLoop(const std::vector<SniffedColumn>& columns,
               const LoopNames& asked, const std::string& source,
               ColumnMap& map) {
  std::vector<std::string> names;
  std::vector<std::string> abouts;
  for (const SniffedColumn& column : columns) {
    names.push_back(column.name);
    abouts.push_back(column.about);
  }
  const std::vector<std::string> parts = DistinctParts(names, abouts);
  std::vector<NamedColumn> named;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    named.push_back({&columns[i], RoleOf(names[i], abouts[i], parts[i])});
  }
  RoleGuess op;
  FlowUnit flow_unit = FlowUnit::kM3PerHour;
  const auto add = [&](Signal signal, const std::string& option,
                       const std::string& name) {
    const auto stated = std::ranges::find_if(named, [&](const auto& each) {
      return SameName(each.column->name, name);
    });
    const NamedColumn* found =
        stated != named.end() ? &*stated
        : name.empty()        ? LoopColumn(named, signal, option, op, source)
                              : nullptr;
    op = signal == Signal::kCv && found != nullptr ? found->guess : op;
    if (found != nullptr) {
      const auto unit = FindUnit(Signal::kF, found->guess.unit);
      flow_unit = signal == Signal::kF && unit ? unit->flow_unit : flow_unit;
      map.columns.push_back(LoopMapping(*found, signal));
    } else if (!name.empty()) {
      map.columns.push_back({name, signal});  // The reader refuses it.
    }
    return found != nullptr || !name.empty();
  };
  const auto require = [&](bool found, const std::string& option) {
    if (!found) {
      throw DataError(source + ": no column for " + option +
                      "; the header is " + Quoted(Listed(names)) + "; try --" +
                      option + " COLUMN");
    }
  };
  require(add(Signal::kCv, "op", asked.op), "op");
  const bool has_pv = add(Signal::kF, "pv", asked.pv);
  add(Signal::kSp, "sp", asked.sp);
  const bool has_x = !asked.ignore_x && add(Signal::kX, "x", asked.x);
  require(has_pv || has_x, "pv");
  map.mode_column = asked.mode.empty() ? map.mode_column : asked.mode;
  for (const NamedColumn& each : named) {
    if (map.mode_column.empty() && each.guess.attribute == Role::kMode &&
        each.guess.tag == op.tag) {
      map.mode_column = each.column->name;
    }
  }
  // PV keeps its own unit, which nothing depends on, unless its cells state
  // one.
  map.flow_unit = flow_unit;
}

}  // namespace fdi::importer
