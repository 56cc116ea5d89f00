#include "storage/cli/envelope.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/error.h"

namespace fdi::cli {
namespace {

// In halves of a pixel, to which a path is rounded.
struct Point {
  long x;
  long y;
};

// Appends, dropping the middle one of three points on a horizontal line.
void Append(std::vector<Point>& line, Point point) {
  const std::size_t n = line.size();
  if (n >= 2 && line[n - 1].y == point.y && line[n - 2].y == point.y) {
    line.back() = point;
  } else if (n == 0 || line.back().x != point.x || line.back().y != point.y) {
    line.push_back(point);
  }
}

// Numbers of a path need a separator only where they would run together.
void AppendNumber(std::string& data, long halves) {
  const std::string number = SvgNumber(0.5 * static_cast<double>(halves));
  if (number.front() != '-' && data.back() != 'M' && data.back() != 'l') {
    data += ' ';
  }
  data += number;
}

void AppendLine(std::string& data, const std::vector<Point>& line) {
  if (line.empty()) {
    return;
  }
  data += 'M';
  AppendNumber(data, line.front().x);
  AppendNumber(data, line.front().y);
  data += 'l';
  if (line.size() == 1) {
    data += "1 0";  // A dot.
  }
  for (std::size_t i = 1; i < line.size(); ++i) {
    AppendNumber(data, line[i].x - line[i - 1].x);
    AppendNumber(data, line[i].y - line[i - 1].y);
  }
}

}  // namespace

Envelope::Envelope(double from, double to, int columns)
    : from_(from),
      per_column_((to - from) / columns),
      minimum_(std::numeric_limits<double>::infinity()),
      maximum_(-std::numeric_limits<double>::infinity()),
      columns_(static_cast<std::size_t>(columns)) {
  Require(to > from && columns > 0, "Envelope: to > from and a column");
}

void Envelope::Column::Add(double value) {
  const double low = std::min(first, second);
  const double high = std::max(first, second);
  if (!filled) {
    first = value;
    second = value;
    filled = true;
  } else if (value < low) {
    first = high;
    second = value;
  } else if (value > high) {
    first = low;
    second = value;
  }
}

void Envelope::Column::Add(const Column& next) {
  broken = broken || next.broken;
  if (next.filled) {
    Add(next.first);
    Add(next.second);
  }
}

void Envelope::Add(double x, double y) {
  const double at = std::floor((x - from_) / per_column_);
  const double last = static_cast<double>(columns_.size() - 1);
  Column& column =
      columns_[static_cast<std::size_t>(std::clamp(at, 0.0, last))];
  if (!std::isfinite(y)) {
    column.broken = true;
    return;
  }
  minimum_ = std::min(minimum_, y);
  maximum_ = std::max(maximum_, y);
  column.Add(y);
}

std::string Envelope::PathData(const SvgArea& area, const SvgScale& y,
                               int merged) const {
  std::string data;
  std::vector<Point> line;
  const double width = area.width / static_cast<double>(columns_.size());
  const auto halves = [](double pixels) { return std::lround(2.0 * pixels); };
  const auto at = [&](double value) {
    return halves(std::clamp(y(value), area.top, area.bottom()));
  };
  const auto step = static_cast<std::size_t>(merged);
  for (std::size_t i = 0; i < columns_.size(); i += step) {
    const std::size_t end = std::min(i + step, columns_.size());
    Column column;
    for (std::size_t j = i; j < end; ++j) {
      column.Add(columns_[j]);
    }
    if (column.filled) {
      const long x =
          halves(area.left + 0.5 * static_cast<double>(i + end) * width);
      Append(line, {x, at(column.first)});
      Append(line, {x, at(column.second)});
    } else if (column.broken) {
      AppendLine(data, line);
      line.clear();
    }
  }
  AppendLine(data, line);
  return data;
}

}  // namespace fdi::cli
