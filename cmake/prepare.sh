#!/usr/bin/env bash
# Installs the Debian packages that are missing and builds Release.
# Usage: cmake/prepare.sh [programs|tests|package [DEBIAN_PACKAGE...]]
#   programs   the five programs and the live page (default)
#   tests      these, the tests, the benchmarks and the studies
#   package    the programs, and the Debian package in build/package/
# Installs further packages of Debian, too, if they are named.
set -euo pipefail
cd "$(dirname "$0")/.."
purpose=${1:-programs}

# The names of Debian 12; in 13 libfastrtps-dev is an empty package that brings
# libfastdds-dev.
packages=(
  g++ cmake ninja-build pkg-config git ca-certificates
  libfastrtps-dev libfastcdr-dev fastddsgen
  libeigen3-dev libsundials-dev
  libsqlite3-dev libsqlitecpp-dev sqlite3 zlib1g-dev libssl-dev openssl libpq-dev
  libcpp-httplib-dev libsystemd-dev libmosquitto-dev
  libprotobuf-dev protobuf-compiler
  libcli11-dev libtomlplusplus-dev libspdlog-dev nlohmann-json3-dev libhowardhinnant-date-dev
  gnuplot-nox
)
for_package=(dpkg-dev file gzip help2man)
for_tests=(libgtest-dev libgmock-dev libbenchmark-dev cyclonedds-dev cyclonedds-tools chromium
  libmodbus-dev mosquitto mosquitto-clients postgresql nginx make procps iproute2)
testing=OFF
packaging=OFF
case $purpose in
  programs) ;;
  package)
    packages+=("${for_package[@]}")
    packaging=ON
    ;;
  tests)
    packages+=("${for_package[@]}" "${for_tests[@]}")
    # The browser's driver and OPC UA come by npm, Debian's or another one.
    command -v npm >/dev/null || packages+=(nodejs npm)
    testing=ON
    packaging=ON
    ;;
  *)
    echo "usage: $0 [programs|tests|package]" >&2
    exit 2
    ;;
esac

packages+=("${@:2}")
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
trap 'rm -f "$log"' EXIT
cmake --preset release -DBUILD_TESTING=$testing -DFDI_BENCH=$testing \
  -DFDI_PACKAGE=$packaging \
  >"$log" 2>&1 || {
  cat "$log" >&2
  exit 1
}
cmake --build --preset release
[ "$purpose" != package ] ||
  cpack --config build/release/CPackConfig.cmake -B build/package
