#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <string>
#include <string_view>

#include "diagnosis/sample.h"

namespace fdi::storage {

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

/// The names that `signal` may have in a header: "F_m3_h or F_t_h".
inline std::string ColumnNames(Signal signal) {
  std::string names;
  for (const SignalColumn& column : kSignalColumns) {
    if (column.signal == signal) {
      names += (names.empty() ? "" : " or ") + std::string(column.name);
    }
  }
  return names;
}

inline bool SameName(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
  });
}

}  // namespace fdi::storage
