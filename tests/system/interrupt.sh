#!/usr/bin/env bash
# Ctrl-C ends sniffing, importing and onboarding within a second, and nothing is
# stored.
# Usage: interrupt.sh FOLDER-OF-PROGRAMS
set -euo pipefail
source "$(cd "$(dirname "$0")" && pwd)/programs.sh" "$1"

"$bin/fdi-simulator" run --no-publish --duration 1500 -o valve.csv \
  >simulator.log 2>&1
awk 'BEGIN {print "t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_t_h"
  for (i = 0; i < 600000; ++i) print i ",40.5,3500,2600,100,41.25,22.125"}' >long.csv

interrupt() {  # PROGRAM WORDS
  # Children that a script starts in the background ignore the signal.
  env --default-signal=INT "$bin/$1" "${@:2}" >"$2.log" 2>&1 &
  local child=$! code=0
  sleep 0.2
  kill -INT $child 2>/dev/null || fail "$* ended by itself"
  local begin=${EPOCHREALTIME/./}
  wait $child || code=$?
  local took=$((${EPOCHREALTIME/./} - begin))
  [ $code -ne 0 ] || fail "$* took no notice"
  [ $took -lt 1200000 ] || fail "$* took $took us to end"
  printf '%s ' "$1 $2: $((took / 1000)) ms"
}
interrupt fdi-store runs sniff long.csv -o tags.toml
interrupt fdi-store runs import long.csv --valve FV-1
interrupt fdi-trainer onboard --valve FV-1 --file valve.csv --no-coverage
[ ! -e tags.toml ] || fail "a map was written"
runs=$("$bin/fdi-store" runs list --json 2>/dev/null | grep -c run_id || :)
[ "$runs" -eq 0 ] || fail "a run was stored"
sets=$("$bin/fdi-store" models list --json 2>/dev/null | grep -c '"name"' || :)
[ "$sets" -eq 0 ] || fail "a model set was stored"
echo
