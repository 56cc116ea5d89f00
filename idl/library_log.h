#pragma once

#include <cstdint>

namespace fdi::idl {

/// Number of participants, writers and readers, as seen by all participants of
/// this process, that have a key of our authority without the right to be on
/// this domain or to use their topic or partition. They are refused and logged
/// (permission_refused). Also our own participants whose key permits no PV
/// (security_key_without_pv).
std::uint64_t RefusedPermissions();

/// Adds one.
void CountRefusedPermission();

}  // namespace fdi::idl
