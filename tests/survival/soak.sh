#!/usr/bin/env bash
# 100 valves at 100 times real time with --record for FDI_SOAK_SECONDS (default
# 60, long form 1200): resident memory of the monitor flat once the page cache
# of runs.db (32 MB, filled at 6 MB a minute) is full, taken as six minutes; a
# shorter run may fill it. runs.db growing by what a sample takes, the WAL
# bounded, nothing lost. Prints the figures.
# Usage: soak.sh BIN_DIRECTORY
set -euo pipefail
bin=$1
seconds=${FDI_SOAK_SECONDS:-60}
valves=${FDI_SOAK_VALVES:-100}
speed=${FDI_SOAK_SPEED:-100}
episode=${FDI_SOAK_EPISODE:-600}
max_slope_kb_min=${FDI_SOAK_SLOPE:-$((seconds > 480 ? 1024 : 10240))}
max_wal_mb=80
max_bytes_per_sample=30
source "$(dirname "$0")/../domain.sh"
out=$(mktemp -d)
export FDI_DATA=$out/data
mkdir "$FDI_DATA"

finish() {
  kill "${monitor:-}" "${publisher:-}" 2>/dev/null || true
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "soak: $*" >&2
  tail -n 20 "$out/monitor.log" >&2
  exit 1
}

"$bin/fdi-trainer" train --campaign "$(dirname "$0")/quick.toml" --activate \
  >/dev/null 2>&1
rm "$FDI_DATA"/runs.db*
"$bin/fdi-monitor" --domain "$domain" run --record --model-set quick \
  --status-period 10 2>"$out/monitor.log" &
monitor=$!
for _ in $(seq 100); do
  grep -q monitor_ready "$out/monitor.log" && break
  sleep 0.1
done
faults=()
for ((start = episode; start < seconds * speed; start += episode)); do
  faults+=(--fault "f19:abrupt@$start:strength=0.5:until=$((start + episode / 4))")
done
"$bin/fdi-simulator" --domain "$domain" run --count "$valves" \
  --speed "$speed" --duration $((seconds * speed)) \
  --parameters paper-operating-point "${faults[@]}" \
  >"$out/publisher.out" 2>"$out/publisher.log" &
publisher=$!

size() { stat -c %s "$1" 2>/dev/null || echo 0; }
begin=$SECONDS
while kill -0 "$publisher" 2>/dev/null; do
  echo "$((SECONDS - begin)) $(awk '/VmRSS/ {print $2}' "/proc/$monitor/status")" \
    "$(size "$FDI_DATA/runs.db-wal") $(size "$FDI_DATA/history.db-wal")" \
    >>"$out/figures"
  sleep 1
done
wait "$publisher" || fail "the publisher ended with $?"
publisher=
kill -TERM "$monitor"
wait "$monitor" || fail "the monitor ended with $?"
monitor=

lasted=$((SECONDS - begin))
warm=$((seconds > 480 ? 360 : lasted * 2 / 3))
slope=$(awk -v warm=$warm '$1 >= warm {n++; x += $1; y += $2; xx += $1 * $1; xy += $1 * $2}
  END {printf "%.0f", (n > 1 ? 60 * (n * xy - x * y) / (n * xx - x * x) : 0)}' "$out/figures")
peak=$(awk '$2 > m {m = $2} END {print m}' "$out/figures")
wal=$(awk '{w = ($3 > $4 ? $3 : $4); if (w > m) m = w} END {printf "%.1f", m / 1048576}' "$out/figures")
samples=$(sqlite3 -readonly "$FDI_DATA/runs.db" 'select sum(samples) from run')
bytes=$(awk "BEGIN {printf \"%.1f\", $(size "$FDI_DATA/runs.db") / $samples}")
expected=$((seconds * speed * valves))
episodes=$(sqlite3 -readonly "$FDI_DATA/history.db" \
  'select count(*) from fault_history')
echo "soak: $lasted s, $samples of $expected samples recorded;" \
  "VmRSS at most $peak kB, slope $slope kB/min after $warm s;" \
  "runs.db $bytes bytes a sample, history.db" \
  "$(($(size "$FDI_DATA/history.db") / 1024)) kB, $episodes episodes, WAL at most $wal MB;" \
  "load $(cut -d' ' -f1 /proc/loadavg)"
"$bin/fdi-store" doctor >/dev/null || fail "doctor complains"
check() {  # VALUE LIMIT WHAT
  awk "BEGIN {exit !($1 <= $2)}" || fail "$3 is $1, limit $2"
}
check "$slope" "$max_slope_kb_min" "slope of VmRSS [kB/min]"
check "$bytes" "$max_bytes_per_sample" "bytes a sample"
check "$wal" "$max_wal_mb" "WAL [MB]"
check "$(((${#faults[@]} / 2 + 1) * valves / 2 - episodes))" 0 "episodes missing"
check "$((expected - samples))" "$((expected / 100))" "samples not recorded"
