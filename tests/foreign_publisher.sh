#!/usr/bin/env bash
# A publisher that shares nothing with us but the IDL: the one in
# docs/examples/cyclone, Eclipse Cyclone DDS in C, feeds a monitor, which has to
# take every sample and find the fault in them.
# Usage: foreign_publisher.sh BIN_DIRECTORY      77 without Cyclone DDS.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
source "$tests/system/programs.sh" "$1"
source "$tests/cyclone.sh"

"$bin/fdi-simulator" run --no-publish --duration 600 --seed 7 \
  --parameters paper-operating-point --fault f19:abrupt@200:strength=0.5 \
  --set excitation.amplitude_pct=8 --set excitation.period_s=80 \
  -o valve.csv --log-level error >/dev/null
start --record --model-set quick
await() {  # WORD
  for _ in $(seq 200); do
    ! grep -q "$1" monitor.log || return 0
    kill -0 "$monitor" 2>/dev/null || fail "the monitor has ended"
    sleep 0.1
  done
  fail "no $1 within 20 s"
}

# The end of a stream carries its key, which Fast DDS takes for a handle if the id
# has at most 7 characters, and for that of the last message otherwise.
publish() {  # VALVE SPEED
  timeout 60 ./build/cyclone_publisher "$1" "$domain" 1 "$2" <valve.csv \
    >"$1.log" 2>&1 || fail "the publisher of $1 ended with $?"
}
publish FV-101 60 &
other=$!
await "valve=FV-101.*transition=ISOLATED"
publish UNIT-12-FEEDWATER-FV-1201 0
await "valve=UNIT-12-FEEDWATER-FV-1201.*transition=CLOSED"
! grep -q "valve=FV-101.*transition=CLOSED" monitor.log ||
  fail "the end of another stream has ended that of FV-101"
await "valve=FV-101.*transition=CLOSED"
wait "$other"
stop

for valve in UNIT-12-FEEDWATER-FV-1201 FV-101; do
  recorded=$(sqlite3 -readonly "$FDI_DATA/runs.db" \
    "select ifnull(sum(samples), 0) from run where valve_id = '$valve'")
  [ "$recorded" -eq 600 ] || fail "$recorded of 600 samples of $valve arrived"
  found=$(history "select ifnull(fault, 'unknown') || ' ' || end_reason
    from fault_history where valve_id = '$valve'")
  [ "$found" = "f19 stream_ended" ] || fail "episodes of $valve: $found"
  echo "foreign_publisher: $valve, 600 of 600 samples; $found"
done
