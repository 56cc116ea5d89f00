#!/usr/bin/env bash
# A subscriber that shares nothing with us but the IDL: the one in
# docs/examples/cyclone listens to the fault events of a monitor that is killed
# FDI_KILL_ROUNDS times (default 5), each time before a foreign participant finds
# the next one for certain. Every transition in the history has to reach it,
# sooner or later.
# Usage: foreign_subscriber.sh BIN_DIRECTORY     77 without Cyclone DDS.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
source "$tests/system/programs.sh" "$1"
source "$tests/cyclone.sh"
rounds=${FDI_KILL_ROUNDS:-5}
trap 'kill -9 ${monitor:-} ${publisher:-} ${subscriber:-} 2>/dev/null || true
  rm -rf "$work"' EXIT

./build/cyclone_subscriber "$domain" >events 2>subscriber.log &
subscriber=$!

# 20 valves, 50 times real time, faulty for 100 s of every 200.
faults=()
for ((begin = 200; begin < 100000; begin += 200)); do
  faults+=(--fault "f19:abrupt@$begin:strength=0.5:until=$((begin + 100))")
done
"$bin/fdi-simulator" run --domain "$domain" --count 20 --speed 50 \
  --duration 100000 --parameters paper-operating-point "${faults[@]}" \
  >/dev/null 2>publisher.log &
publisher=$!

transitions() {
  history "select episode_id || ' ' || kind || ' ' || stamp_ns
    from episode_event where kind in ('DETECTED', 'ISOLATED', 'REISOLATED',
    'CLEARED', 'CLOSED')" | sort
}
start --model-set quick
for _ in $(seq 300); do
  [ -z "$(transitions)" ] || break
  sleep 0.1
done
RANDOM=7
for _ in $(seq "$rounds"); do
  sleep "$((1 + RANDOM % 2)).$((RANDOM % 10))"
  kill -9 "$monitor"
  wait "$monitor" 2>/dev/null || true
  start --model-set quick
done
sleep 10
kill "$publisher"
wait "$publisher" || fail "the publisher ended with $?"
publisher=
outbox() { history 'select count(*) from event_outbox'; }
for _ in $(seq 300); do
  [ "$(outbox)" -gt 0 ] || break
  sleep 0.1
done
[ "$(outbox)" -eq 0 ] || fail "$(outbox) events are not delivered after 30 s"
stop
kill "$subscriber"
wait "$subscriber" || fail "the subscriber ended with $?"
subscriber=

transitions >stored
cut -d' ' -f1-3 events | sort >heard
missing=$(sort -u heard | comm -13 - stored | wc -l)
stored=$(wc -l <stored)
echo "foreign_subscriber: killed $rounds times, $stored transitions stored," \
  "$missing missed, $(uniq -d heard | wc -l) heard more than once"
[ "$stored" -ge 60 ] || fail "too few transitions"
[ "$missing" -eq 0 ] || fail "transitions were missed"
