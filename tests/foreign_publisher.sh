#!/usr/bin/env bash
# A publisher that shares nothing with us but the IDL: builds the example in
# docs/examples/cyclone_publisher, with Eclipse Cyclone DDS in C, and lets it
# feed a monitor, which has to take every sample and find the fault in them.
# Usage: foreign_publisher.sh BIN_DIRECTORY      77 without Cyclone DDS.
set -euo pipefail
bin=$1
example=$(cd "$(dirname "$0")/../docs/examples/cyclone_publisher" && pwd)
domain=${FDI_DOMAIN:-17}
command -v idlc >/dev/null && [ -e /usr/include/dds/dds.h ] || {
  echo "foreign_publisher: skipped, no cyclonedds-dev and cyclonedds-tools"
  exit 77
}
out=$(mktemp -d)
export FDI_DATA=$out/data
finish() {
  kill "${monitor:-}" 2>/dev/null || true
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "foreign_publisher: $*" >&2
  cat "$out"/*.log >&2
  exit 1
}

cmake -S "$example" -B "$out/build" -DCMAKE_BUILD_TYPE=Release \
  >"$out/cmake.log" 2>&1 || fail "does not configure"
cmake --build "$out/build" >"$out/build.log" 2>&1 || fail "does not build"
! grep warning: "$out/build.log" || fail "warnings"

"$bin/fdi-trainer" train --campaign "$(dirname "$0")/survival/quick.toml" \
  >/dev/null 2>"$out/train.log"
"$bin/fdi-simulator" run --no-publish --duration 600 --seed 7 \
  --parameters paper-operating-point --fault f19:abrupt@200:strength=0.5 \
  --set excitation.amplitude_pct=8 --set excitation.period_s=80 \
  --export "$out/valve.csv" --log-level error >/dev/null
"$bin/fdi-monitor" run --domain "$domain" --record --model-set quick \
  2>"$out/monitor.log" &
monitor=$!
await() {  # WORD
  for _ in $(seq 200); do
    ! grep -q "$1" "$out/monitor.log" || return 0
    kill -0 $monitor 2>/dev/null || fail "the monitor has ended"
    sleep 0.1
  done
  fail "no $1 within 20 s"
}
await monitor_ready

# Two ids: the end of a stream carries its key, which Fast DDS takes for a handle
# if the id has at most 7 characters.
valves="UNIT-12-FEEDWATER-FV-1201 FV-101"
for valve in $valves; do
  CYCLONEDDS_URI=file://$example/loopback.xml timeout 60 \
    "$out/build/cyclone_publisher" "$valve" "$domain" 1 0 <"$out/valve.csv" \
    >"$out/publisher.log" 2>&1 || fail "the publisher ended with $?"
  await "valve=$valve.*transition=CLOSED"
done
kill -TERM $monitor
wait $monitor || fail "the monitor ended with $?"
monitor=

query() { sqlite3 -readonly "$FDI_DATA/$1" "$2"; }
for valve in $valves; do
  recorded=$(query runs.db \
    "select ifnull(sum(samples), 0) from run where valve_id = '$valve'")
  [ "$recorded" -eq 600 ] || fail "$recorded of 600 samples of $valve arrived"
  found=$(query history.db "select ifnull(fault, 'unknown') || ' ' || end_reason
    from fault_history where valve_id = '$valve'")
  [ "$found" = "f19 stream_ended" ] || fail "episodes of $valve: $found"
  echo "foreign_publisher: $valve, 600 of 600 samples; $found"
done
