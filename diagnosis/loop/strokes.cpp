#include "diagnosis/loop/strokes.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "diagnosis/loop/step_response.h"

namespace fdi::loop {
namespace {

constexpr double kLevelBand = 0.1;       // CV holds a level [%].
constexpr double kLevelS = 10.0;         // For so long at least,
constexpr double kLongestHoldS = 300.0;  // and in a test at most; moves, too.
constexpr double kResponseS = 60.0;      // What is looked at of an answer.
constexpr double kLeastMove = 5.0;       // [%]
constexpr double kBack = 1.0;            // CV is back at a level [%].
constexpr std::size_t kStepSamples = 2;
constexpr double kAnswered = 0.25;      // Of a move.
constexpr double kFirstMove = 0.5;      // Of X [%].
constexpr double kSignatureWay = 50.0;  // [%]
constexpr double kAlike = 5.0;          // [%]
constexpr double kLonger = 1.5;
constexpr double kStronger = 2.0;
constexpr double kShifted = 1.0;  // [%]

using Level = StrokeLevel;

std::size_t SamplesIn(double seconds, double period_s) {
  return static_cast<std::size_t>(std::ceil(seconds / period_s));
}

// Of a level: kLevelS, and two samples.
std::size_t ShortestLevel(double period_s) {
  return std::max<std::size_t>(2, SamplesIn(kLevelS, period_s));
}

bool StandsAt(double cv, double level) {
  return std::abs(cv - level) <= kLevelBand;
}

std::vector<Level> LevelsOf(const StrokeRecord& record) {
  const std::size_t shortest = ShortestLevel(record.period_s);
  std::vector<Level> levels;
  for (std::size_t begin = 0; begin < record.cv.size();) {
    std::size_t end = begin + 1;
    while (end < record.cv.size() &&
           StandsAt(record.cv[end], record.cv[begin])) {
      ++end;
    }
    if (end - begin >= shortest) {
      levels.push_back({begin, end, record.cv[begin]});
    }
    begin = end;
  }
  return levels;
}

bool IsOutsideAuto(const StrokeRecord& record, std::size_t from,
                   std::size_t to) {
  return !record.automatic.empty() &&
         std::none_of(
             record.automatic.begin() + static_cast<std::ptrdiff_t>(from),
             record.automatic.begin() + static_cast<std::ptrdiff_t>(to),
             [](bool automatic) { return automatic; });
}

// Whether a move of a test leads from `a` to `b`.
bool IsMove(const StrokeRecord& record, const Level& a, const Level& b,
            bool first) {
  const std::size_t longest = SamplesIn(kLongestHoldS, record.period_s);
  return std::abs(b.cv - a.cv) >= kLeastMove && b.begin - a.end <= longest &&
         (first || a.end - a.begin <= longest) &&
         (b.begin - a.end < kStepSamples ||
          IsOutsideAuto(record, a.end, b.begin));
}

// Means of what some of the moves have.
class MeanOf {
 public:
  void Add(double value) {
    sum_ += value;
    ++number_;
  }
  std::optional<double> mean() const {
    return number_ > 0 ? std::optional(sum_ / number_) : std::nullopt;
  }

 private:
  double sum_{0.0};
  int number_{0};
};

class Way {
 public:
  void Add(const StrokeRecord& record, const Level& from, const Level& to) {
    const double step = to.cv - from.cv;
    const double x_before = record.x[from.end - 1];
    const bool is_step = to.begin - from.end < kStepSamples;
    const std::size_t begin = is_step ? from.end : to.begin;
    const std::size_t end =
        std::min(to.end, begin + SamplesIn(kResponseS, record.period_s));
    const std::vector<float> x(
        record.x.begin() + static_cast<std::ptrdiff_t>(begin),
        record.x.begin() + static_cast<std::ptrdiff_t>(end));
    const StepResponse response = ResponseOf(x, x_before);
    ++moves_;
    if (response.realised / step < kAnswered) {
      ++unanswered_;
      return;
    }
    if (is_step) {
      delay_.Add(response.delay * record.period_s);
      t63_.Add(response.t63 * record.period_s);
      t86_.Add(response.t86 * record.period_s);
      overshoot_.Add(100.0 * response.overshoot);
    }
    AddBreakaway(record, from, to, is_step);
  }

  StrokeWay Get() const {
    return {moves_,      unanswered_,       delay_.mean(), t63_.mean(),
            t86_.mean(), overshoot_.mean(), by_cv_.mean(), by_ps_.mean()};
  }

 private:
  void AddBreakaway(const StrokeRecord& record, const Level& from,
                    const Level& to, bool is_step) {
    const std::size_t before = from.end - 1;
    const double sign = to.cv > from.cv ? 1.0 : -1.0;
    std::size_t k = from.end;
    while (k < to.end && sign * (record.x[k] - record.x[before]) < kFirstMove) {
      ++k;
    }
    if (k == to.end) {
      return;
    }
    if (!is_step) {
      by_cv_.Add(std::abs(record.cv[k] - from.cv));
    }
    if (!record.ps.empty()) {
      by_ps_.Add(std::abs(record.ps[k] - record.ps[before]));
    }
  }

  int moves_{0};
  int unanswered_{0};
  MeanOf delay_;
  MeanOf t63_;
  MeanOf t86_;
  MeanOf overshoot_;
  MeanOf by_cv_;
  MeanOf by_ps_;
};

// Mean Ps at which X passes `level` on its way up, and on its way down.
struct Passage {
  std::optional<double> rising;
  std::optional<double> falling;
};
Passage PassageOf(const StrokeRecord& record, const Stroke& stroke,
                  double level) {
  MeanOf up;
  MeanOf down;
  for (std::size_t k = stroke.begin + 1; k < stroke.end; ++k) {
    const double a = record.x[k - 1];
    const double b = record.x[k];
    if ((a < level) == (b < level)) {
      continue;
    }
    const double share = (level - a) / (b - a);
    (b > a ? up : down)
        .Add(record.ps[k - 1] + share * (record.ps[k] - record.ps[k - 1]));
  }
  return {up.mean(), down.mean()};
}

std::optional<Signature> SignatureOf(const StrokeRecord& record,
                                     const Stroke& stroke) {
  const double way = stroke.x_high - stroke.x_low;
  if (record.ps.empty() || way < kSignatureWay) {
    return std::nullopt;
  }
  constexpr int kLevels = 13;  // 20, 25, ... 80 % of the way.
  std::vector<double> halves;
  std::vector<double> positions;
  std::vector<double> means;
  for (int i = 0; i < kLevels; ++i) {
    const double level = stroke.x_low + (0.2 + 0.05 * i) * way;
    const Passage passage = PassageOf(record, stroke, level);
    if (passage.rising && passage.falling) {
      halves.push_back(0.5 * std::abs(*passage.rising - *passage.falling));
      positions.push_back(level);
      means.push_back(0.5 * (*passage.rising + *passage.falling));
    }
  }
  if (2 * halves.size() < kLevels) {
    return std::nullopt;
  }
  const auto n = static_cast<double>(means.size());
  const double x = std::accumulate(positions.begin(), positions.end(), 0.0) / n;
  const double p = std::accumulate(means.begin(), means.end(), 0.0) / n;
  double squares = 0.0;
  double products = 0.0;
  for (std::size_t i = 0; i < means.size(); ++i) {
    squares += (positions[i] - x) * (positions[i] - x);
    products += (positions[i] - x) * (means[i] - p);
  }
  std::ranges::nth_element(
      halves, halves.begin() + static_cast<std::ptrdiff_t>(halves.size() / 2));
  Signature signature;
  signature.friction_kpa = halves[halves.size() / 2];
  signature.spring_kpa_per_pct = products / squares;
  signature.at_0_kpa = p - signature.spring_kpa_per_pct * x;
  signature.at_100_kpa = p + signature.spring_kpa_per_pct * (100.0 - x);
  return signature;
}

// The test whose levels are these, each a move away from the one before.
Stroke Evaluated(const StrokeRecord& record, std::span<const Level> levels) {
  const auto [low, high] = std::ranges::minmax_element(levels, {}, &Level::cv);
  Stroke stroke;
  stroke.cv_low = low->cv;
  stroke.cv_high = high->cv;
  stroke.begin = levels.front().end - 1;
  stroke.end =
      std::min(levels.back().end,
               levels.back().begin + SamplesIn(kResponseS, record.period_s));
  const auto [x_low, x_high] = std::minmax_element(
      record.x.begin() + static_cast<std::ptrdiff_t>(stroke.begin),
      record.x.begin() + static_cast<std::ptrdiff_t>(stroke.end));
  stroke.x_low = *x_low;
  stroke.x_high = *x_high;
  Way rising;
  Way falling;
  for (std::size_t i = 1; i < levels.size(); ++i) {
    const bool rises = levels[i].cv > levels[i - 1].cv;
    (rises ? rising : falling).Add(record, levels[i - 1], levels[i]);
  }
  stroke.rising = rising.Get();
  stroke.falling = falling.Get();
  stroke.signature = SignatureOf(record, stroke);
  return stroke;
}

std::string Text(const char* format, double a, double b) {
  char text[96];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

void Compare(const StrokeWay& last, const StrokeWay& now, const char* way,
             double period_s, std::vector<std::string>& worse) {
  const auto say = [&](const std::string& what) {
    worse.push_back(std::string(way) + ": " + what);
  };
  if (now.unanswered > last.unanswered) {
    say("X does not follow " + std::to_string(now.unanswered) + " of " +
        std::to_string(now.moves) + " moves");
  }
  for (const auto& [name, time] : {std::pair("dead time", &StrokeWay::delay_s),
                                   std::pair("T63", &StrokeWay::t63_s),
                                   std::pair("T86", &StrokeWay::t86_s)}) {
    // What is below a sample is not known better.
    if (last.*time && now.*time &&
        std::max(*(now.*time), period_s) >=
            kLonger * std::max(*(last.*time), period_s)) {
      say(std::string(name) +
          Text(" %.1f s after %.1f s", *(now.*time), *(last.*time)));
    }
  }
  if (last.breakaway_pct && now.breakaway_pct &&
      std::max(*now.breakaway_pct, kFirstMove) >=
          kStronger * std::max(*last.breakaway_pct, kFirstMove)) {
    say(Text("breakaway at %.1f %% of CV after %.1f %%", *now.breakaway_pct,
             *last.breakaway_pct));
  }
  if (last.breakaway_kpa && now.breakaway_kpa &&
      *now.breakaway_kpa >= kStronger * *last.breakaway_kpa) {
    say(Text("breakaway at %.0f kPa after %.0f kPa", *now.breakaway_kpa,
             *last.breakaway_kpa));
  }
}

}  // namespace

std::vector<Stroke> FindStrokes(const StrokeRecord& record) {
  const std::size_t n = record.cv.size();
  if (!(record.period_s > 0.0) || record.x.size() != n ||
      (!record.ps.empty() && record.ps.size() != n) ||
      (!record.automatic.empty() && record.automatic.size() != n)) {
    throw std::invalid_argument("strokes: series or period");
  }
  const std::vector<Level> levels = LevelsOf(record);
  std::vector<Stroke> strokes;
  for (std::size_t first = 0; first < levels.size();) {
    std::size_t last = first;
    std::size_t back = first;  // The last level that is the first one again.
    while (last + 1 < levels.size() &&
           IsMove(record, levels[last], levels[last + 1], last == first)) {
      ++last;
      if (std::abs(levels[last].cv - levels[first].cv) <= kBack) {
        back = last;
      }
    }
    const bool outside =
        last > first &&
        IsOutsideAuto(record, levels[first].end, levels[last].begin + 1);
    const std::size_t end = outside ? last : back;
    if (end > first) {
      strokes.push_back(
          Evaluated(record, std::span(levels).subspan(first, end - first + 1)));
    }
    first = std::max(end, first + 1);
  }
  return strokes;
}

StrokeFinder::StrokeFinder(double period_s, std::size_t max_samples)
    : max_samples_(max_samples),
      shortest_(ShortestLevel(period_s)),
      longest_(SamplesIn(kLongestHoldS, period_s)) {
  record_.period_s = period_s;
}

void StrokeFinder::Push(const Reading& reading,
                        std::vector<TimedStroke>& found) {
  if (kept() >= max_samples_) {
    Finish(found);
  }
  const std::size_t now = kept();
  stamps_.push_back(reading.stamp_ns);
  record_.cv.push_back(reading.cv);
  record_.x.push_back(reading.x);
  record_.ps.push_back(reading.ps);
  record_.automatic.push_back(reading.automatic);
  if (!StandsAt(reading.cv, record_.cv[run_])) {
    if (in_level_) {
      level_->end = now;
      in_level_ = automatic_ = false;
    }
    run_ = now;
    before_run_ = automatic_;
  }
  automatic_ = automatic_ || reading.automatic;
  if (in_level_) {
    StayInLevel(found);
  } else if (now + 1 - run_ >= shortest_) {
    EnterLevel(found);
  } else if (!level_) {
    Drop(0, run_);
  } else if (const std::size_t moved = run_ - level_->end;
             moved > longest_ || (moved >= kStepSamples && before_run_)) {
    // What leads away from the level is no move, whatever comes: see IsMove().
    Evaluate(found);
    Drop(0, run_);
    level_.reset();
    moves_ = 0;
  }
}

void StrokeFinder::EnterLevel(std::vector<TimedStroke>& found) {
  const Level next{run_, kept(), record_.cv[run_]};
  if (level_ && IsMove(record_, *level_, next, moves_ == 0)) {
    ++moves_;
  } else {
    Evaluate(found);
    Drop(0, run_);
    moves_ = 0;
  }
  level_ = Level{run_, kept(), next.cv};
  in_level_ = true;
}

void StrokeFinder::StayInLevel(std::vector<TimedStroke>& found) {
  level_->end = kept();
  if (moves_ > 0 && level_->end - level_->begin > longest_) {
    Evaluate(found);
    Drop(0, run_);
    moves_ = 0;
  }
  // A level that nothing has led to counts with its value and its end.
  if (moves_ == 0 && kept() > 2 * shortest_ + 8) {
    Drop(1, kept() - shortest_);
  }
}

void StrokeFinder::Evaluate(std::vector<TimedStroke>& found) const {
  if (moves_ == 0) {
    return;
  }
  StrokeRecord record = record_;
  if (std::ranges::any_of(record.ps,
                          [](double ps) { return std::isnan(ps); })) {
    record.ps.clear();
  }
  for (Stroke& stroke : FindStrokes(record)) {
    const std::int64_t start_ns = stamps_[stroke.begin];
    stroke.end -= std::exchange(stroke.begin, 0);
    found.push_back({start_ns, std::move(stroke)});
  }
}

// The samples of [from, to); the run and its level, if it is one, move along.
void StrokeFinder::Drop(std::size_t from, std::size_t to) {
  const auto drop = [from, to](auto& series) {
    series.erase(series.begin() + static_cast<std::ptrdiff_t>(from),
                 series.begin() + static_cast<std::ptrdiff_t>(to));
    constexpr std::size_t kMuch = 256;
    if (series.capacity() > std::max(kMuch, 4 * series.size())) {
      series.shrink_to_fit();
    }
  };
  drop(stamps_);
  drop(record_.cv);
  drop(record_.x);
  drop(record_.ps);
  drop(record_.automatic);
  run_ = 0;
  if (in_level_) {
    level_->begin = 0;
    level_->end = kept();
  }
}

void StrokeFinder::Finish(std::vector<TimedStroke>& found) {
  Evaluate(found);
  *this = StrokeFinder(period_s(), max_samples_);
}

bool AreAlike(const Stroke& a, const Stroke& b) {
  return std::abs(a.cv_low - b.cv_low) <= kAlike &&
         std::abs(a.cv_high - b.cv_high) <= kAlike;
}

std::vector<std::string> Worse(const Stroke& last, const Stroke& now,
                               double period_s) {
  std::vector<std::string> worse;
  Compare(last.rising, now.rising, "CV rising", period_s, worse);
  Compare(last.falling, now.falling, "CV falling", period_s, worse);
  if (last.signature && now.signature &&
      now.signature->friction_kpa >= kStronger * last.signature->friction_kpa) {
    worse.push_back(Text("friction %.1f kPa after %.1f kPa",
                         now.signature->friction_kpa,
                         last.signature->friction_kpa));
  }
  if (now.full() && last.full()) {
    for (const auto& [name, end] : {std::pair("lower", &Stroke::x_low),
                                    std::pair("upper", &Stroke::x_high)}) {
      if (std::abs(now.*end - last.*end) >= kShifted) {
        worse.push_back(
            std::string(name) +
            Text(" end of X at %.1f %% after %.1f %%", now.*end, last.*end));
      }
    }
  }
  return worse;
}

}  // namespace fdi::loop
