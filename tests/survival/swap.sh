#!/usr/bin/env bash
# Two publishers of one valve that swap for FDI_SWAP_SECONDS (default 60, long form
# 600): one has f19, the other is healthy. While both send, the valve is contested and
# the monitor DEGRADED; once the newer one ends, or was killed a minute ago, the older
# one is judged again, so that the fault is found in each round. Nothing is lost at the
# end. Usage: swap.sh BIN_DIRECTORY
set -euo pipefail
bin=$1
seconds=${FDI_SWAP_SECONDS:-60}
source "$(dirname "$0")/../domain.sh"
out=$(mktemp -d)
export FDI_DATA=$out/data
mkdir "$FDI_DATA"
declare -A pids=()

finish() {
  kill "${pids[@]}" 2>/dev/null || true
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "swap: round $round: $*" >&2
  tail -n 20 "$out/monitor.log" >&2
  exit 1
}
start() {  # NAME COMMAND...
  "${@:2}" >"$out/$1.out" 2>>"$out/$1.log" &
  pids[$1]=$!
}
publish() {  # NAME OPTIONS...
  start "$1" "$bin/fdi-simulator" --domain "$domain" run --valve FV-1 \
    --duration 100000 --speed 20 --parameters paper-operating-point "${@:2}"
}
end() {  # NAME SIGNAL
  kill "-$2" "${pids[$1]}"
  wait "${pids[$1]}" || true
  unset "pids[$1]"
}
await() {  # SECONDS WHAT CONDITION...
  local until=$((SECONDS + $1)) what=$2
  shift 2
  until "$@"; do
    [ $SECONDS -lt $until ] || fail "$what"
    sleep 0.5
  done
}
# The newest status of the monitor.
status() { grep '"MonitorStatus"' "$out/watch.out" | tail -1; }
degraded() { status | grep -q '"health":"DEGRADED".*FV-1'; }
ok() { status | grep -q '"health":"OK"'; }
open_fault() {
  "$bin/fdi-store" history list --state open --fault f19 --csv | grep -q FV-1
}
no_fault() { ! open_fault; }

round=0
"$bin/fdi-trainer" train --campaign "$(dirname "$0")/quick.toml" --activate \
  >/dev/null 2>&1
start monitor "$bin/fdi-monitor" --domain "$domain" run --model-set quick \
  --status-period 1
await 60 "the monitor is not ready" grep -q monitor_ready "$out/monitor.log"
start watch "$bin/fdi-monitor" --domain "$domain" watch --json
publish faulty --fault f19:abrupt@100:strength=0.5
await 60 "no fault" open_fault

begin=$SECONDS
while [ $((SECONDS - begin)) -lt "$seconds" ]; do
  round=$((round + 1))
  publish healthy --seed $((10 + round))
  await 30 "two publishers are not said" degraded
  await 60 "the fault of the publisher before stays open" no_fault
  # Alternately an end that is told, and one that is not.
  if [ $((round % 2)) = 1 ]; then
    end healthy TERM
  else
    end healthy KILL
  fi
  await 150 "the one that goes on is not judged" open_fault
  await 90 "the only publisher is called one of two" ok
done
end watch TERM
end monitor TERM
end faulty TERM
"$bin/fdi-store" doctor >/dev/null || fail "doctor complains"
found=$("$bin/fdi-store" history list --fault f19 --csv | grep -c FV-1)
[ "$found" -gt $round ] || fail "$found episodes with f19 in $round rounds"
echo "swap: $round rounds in $((SECONDS - begin)) s, $found episodes with f19"
