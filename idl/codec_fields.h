#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <fastrtps/utils/fixed_size_string.hpp>

#include "diagnosis/error.h"
#include "diagnosis/fault_catalogue.h"
#include "idl/wire.h"

/// Inside idl/ only: single fields to the wire, refusing what does not fit with
/// a DataError that names `field`, and back, answering false.
namespace fdi::idl {

template <typename Wire, typename Ours>
Wire ToWire(Ours value, Wire last, const char* field) {
  if (static_cast<unsigned>(value) > static_cast<unsigned>(last)) {
    throw DataError(std::string(field) + " is " +
                    std::to_string(static_cast<unsigned>(value)) +
                    ", accepted are 0 to " +
                    std::to_string(static_cast<unsigned>(last)));
  }
  return static_cast<Wire>(value);
}

// A foreign enumerator arrives as any 32-bit pattern.
template <typename Wire, typename Ours>
bool FromWire(const Wire& wire, Wire last, Ours& value) {
  using Raw = std::underlying_type_t<Wire>;
  const auto raw = static_cast<std::uint64_t>(static_cast<Raw>(wire));
  if (raw > static_cast<std::uint64_t>(static_cast<Raw>(last))) {
    return false;
  }
  value = static_cast<Ours>(raw);
  return true;
}

template <std::size_t N>
void SetText(const std::string& text, eprosima::fastrtps::fixed_string<N>& wire,
             const char* field) {
  if (text.size() > N || text.find('\0') != std::string::npos) {
    throw DataError(std::string(field) + " '" + text + "' has " +
                    std::to_string(text.size()) + " bytes, accepted are 0 to " +
                    std::to_string(N) + " without NUL");
  }
  wire = text;
}

template <std::size_t N>
void SetId(const std::string& id, eprosima::fastrtps::fixed_string<N>& wire) {
  static_assert(N == kMaxIdLength);
  ValidateId(id);
  wire = id;
}

inline void RequireCount(std::size_t count, std::size_t maximum,
                         const char* field) {
  if (count > maximum) {
    throw DataError(std::string(field) + " has " + std::to_string(count) +
                    " entries, accepted are 0 to " + std::to_string(maximum));
  }
}

template <typename Array>
void SetArray(const Array& values, int count, std::vector<double>& wire,
              const char* field) {
  RequireCount(static_cast<std::size_t>(count), values.size(), field);
  wire.assign(values.begin(), values.begin() + count);
}

template <typename Array>
bool GetArray(const std::vector<double>& wire, Array& values) {
  if (wire.size() > values.size()) {
    return false;
  }
  std::ranges::fill(std::ranges::copy(wire, values.begin()).out, values.end(),
                    0.0);
  return true;
}

inline bool IsFault(int fault) {
  return fault >= 1 && fault <= kLastFault;
}

inline std::uint8_t ToWireFault(int fault, const char* field) {
  if (!IsFault(fault) && fault != 0) {
    throw DataError(std::string(field) + " is fault " + std::to_string(fault) +
                    ", accepted are 0 to " + std::to_string(kLastFault));
  }
  return static_cast<std::uint8_t>(fault);
}

inline void SetFaults(const std::vector<int>& faults,
                      std::vector<std::uint8_t>& wire, const char* field) {
  RequireCount(faults.size(), kMaxFaults, field);
  wire.clear();
  for (const int fault : faults) {
    wire.push_back(ToWireFault(fault, field));
  }
}

inline bool GetFaults(const std::vector<std::uint8_t>& wire,
                      std::vector<int>& faults) {
  if (wire.size() > kMaxFaults || !std::ranges::all_of(wire, IsFault)) {
    return false;
  }
  faults.assign(wire.begin(), wire.end());
  return true;
}

inline std::uint32_t ToWireCount(int count, const char* field) {
  if (count < 0) {
    throw DataError(std::string(field) + " is " + std::to_string(count) +
                    ", accepted are 0 and above");
  }
  return static_cast<std::uint32_t>(count);
}

inline bool FromWireCount(std::uint32_t wire, int& count) {
  count = static_cast<int>(wire);
  return wire <= static_cast<std::uint32_t>(std::numeric_limits<int>::max());
}

}  // namespace fdi::idl
