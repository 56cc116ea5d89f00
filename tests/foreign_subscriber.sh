#!/usr/bin/env bash
# A subscriber that shares nothing with us but the IDL: the example in
# docs/examples/cyclone_subscriber listens to the fault events of a monitor that
# is killed FDI_KILL_ROUNDS times (default 5), each time before a foreign
# participant finds the next one for certain. Every transition in the history
# has to reach it, sooner or later.
# Usage: foreign_subscriber.sh BIN_DIRECTORY     77 without Cyclone DDS.
set -euo pipefail
bin=$1
example=$(cd "$(dirname "$0")/../docs/examples/cyclone_subscriber" && pwd)
domain=${FDI_DOMAIN:-19}
rounds=${FDI_KILL_ROUNDS:-5}
command -v idlc >/dev/null && [ -e /usr/include/dds/dds.h ] || {
  echo "foreign_subscriber: skipped, no cyclonedds-dev and cyclonedds-tools"
  exit 77
}
out=$(mktemp -d)
export FDI_DATA=$out/data
finish() {
  kill -9 "${monitor:-}" "${publisher:-}" "${subscriber:-}" 2>/dev/null || true
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "foreign_subscriber: $*" >&2
  tail -n 20 "$out"/*.log >&2
  exit 1
}

cmake -S "$example" -B "$out/build" -DCMAKE_BUILD_TYPE=Release \
  >"$out/cmake.log" 2>&1 || fail "does not configure"
cmake --build "$out/build" >"$out/build.log" 2>&1 || fail "does not build"
! grep warning: "$out/build.log" || fail "warnings"

"$bin/fdi-trainer" train --campaign "$(dirname "$0")/survival/quick.toml" \
  >/dev/null 2>"$out/train.log"
start_monitor() {
  "$bin/fdi-monitor" run --domain "$domain" --model-set quick \
    2>>"$out/monitor.log" &
  monitor=$!
}
CYCLONEDDS_URI=file://$example/loopback.xml \
  "$out/build/cyclone_subscriber" "$domain" >"$out/events" 2>"$out/events.log" &
subscriber=$!

# 20 valves, 50 times real time, faulty for 100 s of every 200.
faults=()
for ((start = 200; start < 100000; start += 200)); do
  faults+=(--fault "f19:abrupt@$start:strength=0.5:until=$((start + 100))")
done
"$bin/fdi-simulator" run --domain "$domain" --valves 20 --speed 50 \
  --duration 100000 --parameters paper-operating-point "${faults[@]}" \
  >"$out/publisher.out" 2>"$out/publisher.log" &
publisher=$!

transitions() {
  sqlite3 -readonly "$FDI_DATA/history.db" "select episode_id, kind, stamp_ns
    from episode_event where kind in ('DETECTED', 'ISOLATED', 'REISOLATED',
    'CLEARED', 'CLOSED') order by 1, 2, 3" -separator ' '
}
start_monitor
for _ in $(seq 300); do
  [ -e "$FDI_DATA/history.db" ] && transitions 2>/dev/null | grep -q . && break
  sleep 0.1
done
RANDOM=7
for _ in $(seq "$rounds"); do
  sleep "$((1 + RANDOM % 2)).$((RANDOM % 10))"
  kill -9 "$monitor"
  wait "$monitor" 2>/dev/null || true
  start_monitor
done
sleep 10
kill "$publisher"
wait "$publisher" || fail "the publisher ended with $?"
publisher=
outbox() { sqlite3 -readonly "$FDI_DATA/history.db" 'select count(*) from event_outbox'; }
for _ in $(seq 300); do
  [ "$(outbox)" -gt 0 ] || break
  sleep 0.1
done
[ "$(outbox)" -eq 0 ] || fail "$(outbox) events are not delivered after 30 s"
kill -TERM "$monitor"
wait "$monitor" || fail "the monitor ended with $?"
kill "$subscriber"
wait "$subscriber" || fail "the subscriber ended with $?"

transitions >"$out/stored"
cut -d' ' -f1-3 "$out/events" | sort >"$out/heard"
missing=$(sort -u "$out/heard" | comm -13 - <(sort "$out/stored") | wc -l)
stored=$(wc -l <"$out/stored")
echo "foreign_subscriber: killed $rounds times, $stored transitions stored," \
  "$missing missed, $(uniq -d "$out/heard" | wc -l) heard more than once"
[ "$stored" -ge 60 ] || fail "too few transitions"
[ "$missing" -eq 0 ] || fail "transitions were missed"
