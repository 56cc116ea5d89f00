#include "storage/runs/column_codec.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <zlib.h>

#include "base/error.h"
#include "base/median.h"

namespace fdi::storage {

// A column is a list of 64-bit numbers, the values of one field over many
// instants. As bytes, little endian:
//
//   integers = 0 value:int64                        all are equal
//            | order+1 seed:int64* width plane*     order 0, 1 or 2
//   plane    = one byte of every residual, the lowest first; `width` planes
//   doubles  = 0 integers                           the ordered bits
//            | kind [origin step] integers integers
//
// Residuals of order 0 are distances from the single seed, the median; of order
// 1 and 2, first and second differences after as many seeds. They are zigzag
// coded: 0, -1, 1, -2 are 0, 1, 2, 3. `kind` is that of a ValuePredictor, with
// origin and step (doubles) for a grid; the two columns of integers are its n
// and the corrections in units in the last place. p(n) must never change by a
// single bit, because existing files are decoded with it.
namespace {

// Differences wrap around modulo 2⁶⁴, as the file format requires.
std::int64_t WrapSubtract(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) -
                                   static_cast<std::uint64_t>(b));
}
std::int64_t WrapAdd(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) +
                                   static_cast<std::uint64_t>(b));
}

/// 0, −1, 1, −2, ... as 0, 1, 2, 3, ...
std::uint64_t Zigzag(std::int64_t value) {
  return (static_cast<std::uint64_t>(value) << 1U) ^
         static_cast<std::uint64_t>(value >> 63);
}
std::int64_t Unzigzag(std::uint64_t value) {
  return static_cast<std::int64_t>((value >> 1U) ^ (~(value & 1U) + 1U));
}

/// Maps doubles to integers in the same order; −0 is one below +0.
std::int64_t Ordered(double value) {
  // A double is a sign and a magnitude m. Read as an integer, its bits are m if
  // it is positive and min + m if it is negative; these become m and
  //
  //     −1 − m = min − ((min + m) + 1)   (modulo 2⁶⁴),
  //
  // so that neighbouring doubles have neighbouring integers and a difference
  // counts units in the last place. Infinities and NaN need no exception.
  const auto bits = std::bit_cast<std::int64_t>(value);
  return bits < 0 ? WrapSubtract(std::numeric_limits<std::int64_t>::min(),
                                 WrapAdd(bits, 1))
                  : bits;
}

double Unordered(std::int64_t ordered) {
  return std::bit_cast<double>(
      ordered < 0
          ? WrapSubtract(
                WrapSubtract(std::numeric_limits<std::int64_t>::min(), ordered),
                1)
          : ordered);
}

constexpr double kMaxExact = 9007199254740992.0;  // 2⁵³

constexpr std::array<double, ValuePredictor::kMaxDecimals + 1> kPowers{
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9};

/// Tolerates up to 1/16 misfits, so that a few bad readings do not spoil a
/// column.
bool Fits(const ValuePredictor& predictor, std::span<const double> values,
          std::int64_t tolerance) {
  std::size_t misfits = 0;
  for (const double value : values) {
    const std::int64_t off = predictor.Correction(value);
    if (off > tolerance || off < -tolerance) {
      if (++misfits * 16 > values.size()) {
        return false;
      }
    }
  }
  return true;
}

std::uint64_t CorrectionBits(const ValuePredictor& predictor,
                             std::span<const double> values) {
  std::uint64_t bits = 0;
  for (const double value : values) {
    bits += static_cast<std::uint64_t>(
        std::bit_width(Zigzag(predictor.Correction(value))));
  }
  return bits;
}

/// True if `hint` is as good as the result of a search: fewer decimals would
/// not do; a grid is met within a bit per value.
bool StillFits(const ValuePredictor& hint, std::span<const double> values) {
  if (hint.kind == ValuePredictor::kGrid) {
    return Fits(hint, values, 64) &&
           CorrectionBits(hint, values) <= values.size();
  }
  ValuePredictor coarser = hint;
  --coarser.kind;
  return Fits(hint, values, 0) &&
         (hint.kind == ValuePredictor::kDecimal || !Fits(coarser, values, 0));
}

/// Greatest common divisor of two lengths with the given `tolerance`.
double CommonStep(double a, double b, double tolerance) {
  // Euclid's algorithm. Rounding can leave almost b, instead of 0, as the rest
  // of a multiple of b.
  while (b > tolerance) {
    double rest = std::fmod(a, b);
    if (b - rest < tolerance) {
      rest = 0.0;
    }
    a = b;
    b = rest;
  }
  return a;
}

/// The step of the grid that the sorted values lie on; 0 if there is none.
double GridStep(const std::vector<double>& sorted) {
  const double largest =
      std::max(std::abs(sorted.front()), std::abs(sorted.back()));
  // Rounding moves a reading by some 1e-16 of its magnitude, far less than the
  // tolerance; smaller gaps are between equal readings.
  const double tolerance = largest * 1e-12;
  std::vector<double> gaps;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    if (sorted[i] - sorted[i - 1] > tolerance) {
      gaps.push_back(sorted[i] - sorted[i - 1]);
    }
  }
  if (gaps.empty()) {
    return 0.0;
  }
  std::sort(gaps.begin(), gaps.end());
  double step = gaps.front();
  for (std::size_t i = 1; i < std::min<std::size_t>(gaps.size(), 16); ++i) {
    step = CommonStep(gaps[i], step, tolerance);
  }
  // For readings that are not on a grid, the common divisor shrinks until it is
  // of the order of the tolerance.
  return step > 16.0 * tolerance ? step : 0.0;
}

/// The grid through `origin` whose step fits `far` best.
std::optional<ValuePredictor> BestGrid(std::span<const double> values,
                                       double origin, double far, double step) {
  const double count = std::round((far - origin) / step);
  if (count == 0.0 || !(std::abs(count) < kMaxExact)) {
    return std::nullopt;
  }
  // `step` has the rounding error of a difference of two readings. Measured
  // over `count` steps, that error is divided by `count`. There remains the
  // rounding of q, which grows with n in a + q·n: so the two neighbours of q on
  // either side are tried, too.
  double q = (far - origin) / count;
  q = std::nextafter(std::nextafter(q, 0.0), 0.0);
  std::optional<ValuePredictor> best;
  std::uint64_t least = std::numeric_limits<std::uint64_t>::max();
  for (int i = 0; i < 5; ++i) {
    const ValuePredictor candidate{ValuePredictor::kGrid, origin, q};
    if (Fits(candidate, values, 64)) {
      const std::uint64_t bits = CorrectionBits(candidate, values);
      if (bits < least) {
        least = bits;
        best = candidate;
      }
    }
    q = std::nextafter(q, std::numeric_limits<double>::infinity());
  }
  return best;
}

std::optional<ValuePredictor> FindGrid(std::span<const double> values) {
  std::vector<double> sorted;
  sorted.reserve(values.size());
  for (const double value : values) {
    if (std::isfinite(value) && std::abs(value) < 1e150) {
      sorted.push_back(value);
    }
  }
  // Fits() tolerates 1/16 of misfits: where more than that is left out, there
  // is nothing to search for.
  if (sorted.size() < 8 || sorted.size() * 16 < values.size() * 15) {
    return std::nullopt;
  }
  std::sort(sorted.begin(), sorted.end());
  const double step = GridStep(sorted);
  if (step == 0.0) {
    return std::nullopt;
  }
  const double low = sorted.front();
  const double high = sorted.back();
  const double far = std::abs(low) > std::abs(high) ? low : high;
  // The grid may pass through zero, or only through the lowest reading, as that
  // of a converter whose span begins elsewhere.
  const auto from_zero = BestGrid(values, 0.0, far, step);
  const auto from_low = BestGrid(values, low, high, step);
  if (from_zero && from_low) {
    return CorrectionBits(*from_zero, values) <=
                   CorrectionBits(*from_low, values)
               ? from_zero
               : from_low;
  }
  return from_zero ? from_zero : from_low;
}

constexpr std::uint8_t kConstant = 0;  // else order + 1
constexpr std::uint8_t kBits = 0;      // else ValuePredictor::kind

/// Residuals of one order; the first `order` values (the median for order 0)
/// are kept as seeds.
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
    // The median has the smallest sum of distances and, unlike the mean, is not
    // moved by a bad reading.
    const std::int64_t middle =
        Median(std::vector<std::int64_t>(x.begin(), x.end()));
    result.seeds = {middle};
    for (const std::int64_t value : x) {
      result.Push(WrapSubtract(value, middle));
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
  // The bit widths stand for the size after deflate, which is not known here
  // because all columns of a chunk are deflated together. Order k needs more
  // than k values; ReadIntegers() refuses anything else.
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

double ValuePredictor::operator()(std::int64_t n) const {
  const auto x = static_cast<double>(n);
  // n and 10^d are exact doubles, so the quotient is rounded once: it is the
  // double nearest to the decimal number, the same that a parser makes of its
  // text, and needs no correction. A product with 10^-d would be rounded twice.
  // The grid needs -ffp-contract=off (cmake/FdiTargets.cmake): a fused
  // multiply-add rounds once instead of twice and would change bits.
  return kind == kGrid ? origin + step * x
                       : x / kPowers[std::size_t{kind} - kDecimal];
}

std::int64_t ValuePredictor::Nearest(double value) const {
  const double x = kind == kGrid
                       ? (value - origin) / step
                       : value * kPowers[std::size_t{kind} - kDecimal];
  return std::abs(x) < kMaxExact  // NaN: 0
             ? static_cast<std::int64_t>(x < 0.0 ? x - 0.5 : x + 0.5)
             : 0;
}

std::int64_t ValuePredictor::Correction(double value, std::int64_t n) const {
  const double predicted = (*this)(n);
  return std::bit_cast<std::int64_t>(predicted) ==
                 std::bit_cast<std::int64_t>(value)
             ? 0
             : WrapSubtract(Ordered(value), Ordered(predicted));
}

std::optional<ValuePredictor> FindPredictor(
    std::span<const double> values, const std::optional<ValuePredictor>& hint) {
  if (hint && StillFits(*hint, values)) {
    return hint;
  }
  // The fewest decimals that fit give the smallest n.
  for (int d = 0; d <= ValuePredictor::kMaxDecimals; ++d) {
    const ValuePredictor decimal{
        static_cast<std::uint8_t>(ValuePredictor::kDecimal + d), 0.0, 1.0};
    if (Fits(decimal, values, 0)) {
      return decimal;
    }
  }
  return FindGrid(values);
}

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
  // A straight line, such as a sequence number without losses, has second
  // differences of 0: its width is 0 and it has no plane.
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
  // Order 0 has a seed, too: the median.
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
  // Equal bits become a constant, whatever they are, and tell nothing about the
  // next column: the hint stays.
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

std::uint32_t Crc32(std::span<const std::byte> bytes) {
  // The length of crc32() has 32 bits only; that of crc32_z() is a size_t.
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::vector<std::byte> Deflate(std::span<const std::byte> raw) {
  uLongf size = compressBound(static_cast<uLong>(raw.size()));
  std::vector<std::byte> packed(size);
  const int code =
      compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                reinterpret_cast<const Bytef*>(raw.data()),
                static_cast<uLong>(raw.size()), Z_DEFAULT_COMPRESSION);
  if (code != Z_OK) {
    throw std::runtime_error("zlib: compress2 fails with " +
                             std::to_string(code));
  }
  packed.resize(size);
  return packed;
}

std::vector<std::byte> Inflate(std::span<const std::byte> packed,
                               std::size_t size, std::string_view where) {
  std::vector<std::byte> raw(size);
  auto inflated = static_cast<uLongf>(size);
  const int code = uncompress(reinterpret_cast<Bytef*>(raw.data()), &inflated,
                              reinterpret_cast<const Bytef*>(packed.data()),
                              static_cast<uLong>(packed.size()));
  if (code != Z_OK || inflated != size) {
    throw DataError(std::string(where) + " is damaged: zlib cannot inflate it");
  }
  return raw;
}

}  // namespace fdi::storage
