#!/usr/bin/env bash
# Compares the service with bare DDS: a publisher of 1000 valves against a bare
# reader, against the monitor alone and with a subscriber of its vectors; round
# trips at 1 kHz against an echo. In turn, on loopback, about a minute.
#
#     cmake --preset release -DFDI_BENCH=ON && cmake --build --preset release
#     bench/service.sh [BIN]          # BIN: build/release/bin
#
# FDI_BENCH_VALVES, FDI_BENCH_SAMPLES, FDI_BENCH_ROUNDS, FDI_BENCH_DOMAIN;
# FDI_BENCH_SECURITY=1: with DDS Security, and without the round trips, whose
# program is gateway and reader at once.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(realpath "${1:-build/release/bin}")
domain=${FDI_BENCH_DOMAIN:-61}
rounds=${FDI_BENCH_ROUNDS:-3}
load=("$bin/fdi-bench-service" --domain "$domain"
  --valves "${FDI_BENCH_VALVES:-1000}" --samples "${FDI_BENCH_SAMPLES:-300}")
out=$(mktemp -d)
export FDI_DATA=$out/data
monitor=
trap '[ -z "$monitor" ] || kill -9 "$monitor" 2>/dev/null; rm -rf "$out"' EXIT

declare -A key=([publish]='' [read]='' [run]='')
if [ -n "${FDI_BENCH_SECURITY:-}" ]; then
  "$bin/fdi-keys" init "$out/keys" >/dev/null
  for role in gateway reader monitor; do
    "$bin/fdi-keys" add "$out/keys" "$role" --role "$role" >/dev/null
  done
  key=([publish]="--security=$out/keys/gateway"
    [read]="--security=$out/keys/reader" [run]="--security=$out/keys/monitor")
fi

field() {  # FILE WORD: the number after the word
  sed -n "s/.*\b$2 \([0-9.]*\).*/\1/p" "$1" | tail -1
}
cpu_of() {  # PID: processor seconds so far
  awk -v tick="$(getconf CLK_TCK)" '{print ($14 + $15) / tick}' "/proc/$1/stat"
}
start_monitor() {
  rm -f "$FDI_DATA"/history.db*
  "$bin/fdi-monitor" ${key[run]} run --model-set service --domain "$domain" \
    --log-level warning "$@" 2>"$out/monitor.log" &
  monitor=$!
  until grep -q monitor_ready "$out/monitor.log"; do
    kill -0 "$monitor" || { cat "$out/monitor.log" >&2; exit 1; }
    sleep 0.05
  done
}
stop_monitor() {
  kill -TERM "$monitor"
  wait "$monitor"
  monitor=
}
wait_for_diagnosis() {  # the last sample acknowledged is not yet diagnosed
  local before=-1 now=0
  while [ "$before" != "$now" ]; do
    before=$now
    sleep 0.2
    now=$(cpu_of "$monitor")
  done
}

"$bin/fdi-trainer" train --campaign bench/service.toml >/dev/null 2>&1

bare() {
  timeout 120 "${load[@]}" ${key[read]} read >"$out/read" &
  local reader=$!
  timeout 120 "${load[@]}" ${key[publish]} publish >"$out/publish"
  wait "$reader"
  rate=$(field "$out/read" rate)
  detail="publisher $(field "$out/publish" cpu) s, reader $(field "$out/read" cpu) s"
}
diagnosis() {
  start_monitor
  local cpu_before=$(cpu_of "$monitor")
  timeout 120 "${load[@]}" ${key[publish]} publish >"$out/publish"
  wait_for_diagnosis
  local cpu
  cpu=$(awk -v a="$(cpu_of "$monitor")" -v b="$cpu_before" 'BEGIN {print a - b}')
  stop_monitor
  rate=$(field "$out/publish" rate)
  detail="publisher $(field "$out/publish" cpu) s, monitor $cpu s"
}
service() {
  start_monitor --lossless-decisions
  local cpu_before=$(cpu_of "$monitor")
  timeout 120 "${load[@]}" ${key[read]} vectors >"$out/vectors" &
  local subscriber=$!
  sleep 1
  timeout 120 "${load[@]}" ${key[publish]} publish >"$out/publish"
  wait "$subscriber" || { cat "$out/vectors" >&2; exit 1; }
  local cpu
  cpu=$(awk -v a="$(cpu_of "$monitor")" -v b="$cpu_before" 'BEGIN {print a - b}')
  stop_monitor
  rate=$(field "$out/vectors" rate)
  detail="publisher $(field "$out/publish" cpu) s, monitor $cpu s, subscriber $(field "$out/vectors" cpu) s"
}

echo "$(nproc) x $(sed -n 's/^model name.*: //p' /proc/cpuinfo | head -1)"
echo
printf '%-34s %10s %6s  %s\n' "samples/s, ${FDI_BENCH_VALVES:-1000} valves" rate ratio 'CPU'
for ((round = 1; round <= rounds; ++round)); do
  reference=
  for case in bare diagnosis service; do
    "$case"
    reference=${reference:-$rate}
    printf '%-34s %10.0f %6.2f  %s\n' "$case" "$rate" \
      "$(awk -v a="$rate" -v b="$reference" 'BEGIN {print a / b}')" "$detail"
  done
done

[ -z "${FDI_BENCH_SECURITY:-}" ] || exit 0
echo
printf '%-34s %10s %10s\n' 'round trip at 1 kHz [us]' p50 p99
for ((round = 1; round <= rounds; ++round)); do
  timeout 60 "${load[@]}" echo &
  echo_pid=$!
  timeout 60 "${load[@]}" ping >"$out/bare"
  wait "$echo_pid" || true
  printf '%-34s %10.0f %10.0f\n' 'bare' "$(field "$out/bare" p50)" "$(field "$out/bare" p99)"
  start_monitor
  timeout 60 "${load[@]}" ping >"$out/ping"
  stop_monitor
  printf '%-34s %10.0f %10.0f\n' 'monitor' "$(field "$out/ping" p50)" "$(field "$out/ping" p99)"
  awk -v a="$(field "$out/ping" p50)" -v b="$(field "$out/bare" p50)" \
    -v c="$(field "$out/ping" p99)" -v d="$(field "$out/bare" p99)" \
    'BEGIN {printf "%-34s %10.2f %10.2f\n", "ratio", a / b, c / d}'
done
