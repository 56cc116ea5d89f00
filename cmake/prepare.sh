#!/usr/bin/env bash
# Installs the Debian packages that are missing and builds Release.
# Usage: cmake/prepare.sh [CMAKE_OPTION ...]     Called by demo.sh and test.sh.
set -euo pipefail
cd "$(dirname "$0")/.."

packages=(
  g++ cmake ninja-build pkg-config git ca-certificates
  libfastrtps-dev libfastcdr-dev fastddsgen
  libeigen3-dev libsundials-dev
  libsqlite3-dev libsqlitecpp-dev sqlite3 zlib1g-dev libssl-dev
  libcpp-httplib-dev libsystemd-dev
  libcli11-dev libtomlplusplus-dev libspdlog-dev nlohmann-json3-dev
  libgtest-dev libgmock-dev libbenchmark-dev
  gnuplot-nox
  cyclonedds-dev cyclonedds-tools
)
# The plot library of the live page comes by npm, whose own package or not.
command -v npm >/dev/null || packages+=(nodejs npm)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null |
    grep -q 'ok installed' || missing+=("$package")
done
if [ "${#missing[@]}" -gt 0 ]; then
  echo "Installing: ${missing[*]}"
  as_root=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || {
      echo "prepare: run as root or install sudo: packages are missing" >&2
      exit 1
    }
    as_root=(sudo)
  fi
  "${as_root[@]}" apt-get update -qq
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

log=$(mktemp)
cmake --preset release "$@" >"$log" 2>&1 || {
  cat "$log" >&2
  exit 1
}
cmake --build --preset release
rm -f "$log"
