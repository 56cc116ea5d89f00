#include "storage/column_codec.h"

#include <algorithm>
#include <array>
#include <bit>

namespace fdi::storage {
namespace {

constexpr std::uint8_t kConstant = 0;  // else order + 1
constexpr std::uint8_t kBits = 0;      // else ValuePredictor::kind

/// Residuals of one order; the first `order` values (for order 0 the median)
/// stand apart as seeds.
struct Residuals {
  int order{0};
  std::vector<std::int64_t> seeds;
  std::vector<std::uint64_t> codes;
  std::uint64_t bits{0};

  void Push(std::int64_t residual) {
    codes.push_back(Zigzag(residual));
    bits += static_cast<std::uint64_t>(std::bit_width(codes.back()));
  }
};

Residuals ResidualsOf(std::span<const std::int64_t> x, int order) {
  Residuals result;
  result.order = order;
  result.codes.reserve(x.size());
  if (order == 0) {
    std::vector<std::int64_t> sorted(x.begin(), x.end());
    const auto middle =
        sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    result.seeds = {*middle};
    for (const std::int64_t value : x) {
      result.Push(WrapSubtract(value, *middle));
    }
    return result;
  }
  const auto seeds = static_cast<std::size_t>(order);
  result.seeds.assign(x.begin(), x.begin() + order);
  for (std::size_t i = seeds; i < x.size(); ++i) {
    const std::int64_t first = WrapSubtract(x[i], x[i - 1]);
    result.Push(order == 1
                    ? first
                    : WrapSubtract(first, WrapSubtract(x[i - 1], x[i - 2])));
  }
  return result;
}

Residuals BestResiduals(std::span<const std::int64_t> x) {
  Residuals best = ResidualsOf(x, 0);
  for (int order = 1; order <= 2; ++order) {
    if (x.size() > static_cast<std::size_t>(order)) {
      Residuals other = ResidualsOf(x, order);
      if (other.bits < best.bits) {
        best = std::move(other);
      }
    }
  }
  return best;
}

bool AllEqual(std::span<const double> values) {
  return std::all_of(values.begin(), values.end(), [&](double value) {
    return std::bit_cast<std::int64_t>(value) ==
           std::bit_cast<std::int64_t>(values[0]);
  });
}

ValuePredictor ReadPredictor(ByteReader& reader, std::uint8_t kind) {
  if (!ValuePredictor::IsKind(kind)) {
    reader.Refuse("no column of doubles is of kind " + std::to_string(kind));
  }
  ValuePredictor predictor{kind, 0.0, 1.0};
  if (kind == ValuePredictor::kGrid) {
    predictor.origin = reader.GetDouble();
    predictor.step = reader.GetDouble();
  }
  return predictor;
}

}  // namespace

void WriteIntegers(ByteWriter& writer, std::span<const std::int64_t> values) {
  if (std::all_of(values.begin(), values.end(),
                  [&](std::int64_t value) { return value == values[0]; })) {
    writer.Put(kConstant);
    writer.Put(values.empty() ? std::int64_t{0} : values[0]);
    return;
  }
  const Residuals residuals = BestResiduals(values);
  const std::uint64_t largest =
      *std::max_element(residuals.codes.begin(), residuals.codes.end());
  const auto width = static_cast<int>((std::bit_width(largest) + 7) / 8);
  writer.Put(static_cast<std::uint8_t>(residuals.order + 1));
  for (const std::int64_t seed : residuals.seeds) {
    writer.Put(seed);
  }
  writer.Put(static_cast<std::uint8_t>(width));
  for (int plane = 0; plane < width; ++plane) {
    for (const std::uint64_t code : residuals.codes) {
      writer.Put(static_cast<std::uint8_t>(code >> (8 * plane)));
    }
  }
}

std::vector<std::int64_t> ReadIntegers(ByteReader& reader, std::size_t count) {
  const auto form = reader.Get<std::uint8_t>();
  if (form == kConstant) {
    return std::vector<std::int64_t>(count, reader.Get<std::int64_t>());
  }
  const std::size_t order = form - 1U;
  if (order > 2 || count <= order) {
    reader.Refuse("no column of integers is of form " + std::to_string(form));
  }
  std::array<std::int64_t, 2> seeds{};
  for (std::size_t i = 0; i < std::max<std::size_t>(order, 1); ++i) {
    seeds[i] = reader.Get<std::int64_t>();
  }
  const auto width = reader.Get<std::uint8_t>();
  if (width > 8) {
    reader.Refuse("integers of " + std::to_string(width) + " bytes");
  }
  std::vector<std::uint64_t> codes(count - order, 0);
  for (unsigned plane = 0; plane < width; ++plane) {
    const auto bytes = reader.TakeBytes(codes.size());
    for (std::size_t i = 0; i < codes.size(); ++i) {
      codes[i] |= std::to_integer<std::uint64_t>(bytes[i]) << (8U * plane);
    }
  }
  std::vector<std::int64_t> values(count);
  std::copy_n(seeds.begin(), order, values.begin());
  for (std::size_t i = order; i < count; ++i) {
    std::int64_t expected = seeds[0];
    if (order == 1) {
      expected = values[i - 1];
    } else if (order == 2) {
      expected =
          WrapAdd(values[i - 1], WrapSubtract(values[i - 1], values[i - 2]));
    }
    values[i] = WrapAdd(expected, Unzigzag(codes[i - order]));
  }
  return values;
}

void WriteDoubles(ByteWriter& writer, std::span<const double> values,
                  std::optional<ValuePredictor>* hint) {
  std::vector<std::int64_t> numbers(values.size());
  std::optional<ValuePredictor> predictor;
  if (!AllEqual(values)) {
    predictor = FindPredictor(values, hint != nullptr ? *hint : std::nullopt);
    if (hint != nullptr) {
      *hint = predictor;
    }
  }
  if (!predictor) {
    std::transform(values.begin(), values.end(), numbers.begin(), Ordered);
    writer.Put(kBits);
    WriteIntegers(writer, numbers);
    return;
  }
  std::vector<std::int64_t> corrections(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    numbers[i] = predictor->Nearest(values[i]);
    corrections[i] = predictor->Correction(values[i], numbers[i]);
  }
  writer.Put(predictor->kind);
  if (predictor->kind == ValuePredictor::kGrid) {
    writer.Put(predictor->origin);
    writer.Put(predictor->step);
  }
  WriteIntegers(writer, numbers);
  WriteIntegers(writer, corrections);
}

std::vector<double> ReadDoubles(ByteReader& reader, std::size_t count) {
  const auto kind = reader.Get<std::uint8_t>();
  std::vector<double> values(count);
  if (kind == kBits) {
    const auto ordered = ReadIntegers(reader, count);
    std::transform(ordered.begin(), ordered.end(), values.begin(), Unordered);
    return values;
  }
  const ValuePredictor predictor = ReadPredictor(reader, kind);
  const auto numbers = ReadIntegers(reader, count);
  const auto corrections = ReadIntegers(reader, count);
  for (std::size_t i = 0; i < count; ++i) {
    values[i] =
        Unordered(WrapAdd(Ordered(predictor(numbers[i])), corrections[i]));
  }
  return values;
}

}  // namespace fdi::storage
