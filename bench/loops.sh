#!/usr/bin/env bash
# The whole monitor with LOOPS data-only loops (CV, F and SP) at 1 Hz over
# loopback: its share of a core, and its memory. First FILL samples of each
# loop 10 s apart, as fast as they go, so that the windows of the audit are full
# (720) and an audit of each is due in 20 minutes; then SECONDS at 1 Hz.
#
#     cmake --preset release -DFDI_BENCH=ON && cmake --build --preset release
#     bench/loops.sh [BIN [LOOPS [FILL [SECONDS]]]]   # build/release/bin 10000 735 60
#
# FDI_BENCH_DOMAIN. The fill takes two to three minutes on two idle cores; with
# FILL 1 nothing is audited, and the memory of the windows is not yet used.
set -euo pipefail
cd "$(dirname "$0")/.."
bin=$(realpath "${1:-build/release/bin}")
loops=${2:-10000}
domain=${FDI_BENCH_DOMAIN:-61}
out=$(mktemp -d)
export FDI_DATA=$out/data
monitor=
trap '[ -z "$monitor" ] || kill -9 "$monitor" 2>/dev/null; rm -rf "$out"' EXIT

usage() {  # seconds since the start, processor seconds of the monitor
  awk -v tick="$(getconf CLK_TCK)" -v now="$(date +%s.%N)" \
    '{ print now, ($14 + $15) / tick }' "/proc/$monitor/stat"
}

"$bin/fdi-monitor" run --domain "$domain" --max-valves "$loops" \
  --log-level warning 2>"$out/monitor.log" &
monitor=$!
"$bin/fdi-bench-service" --domain "$domain" --valves "$loops" --loops \
  --fill "${3:-735}" --samples "${4:-60}" --hz 1 publish >"$out/publish" &
publisher=$!
until grep -qs filled "$out/publish"; do
  kill -0 "$publisher"
  sleep 0.2
done
sleep 2  # Acknowledged samples may not be judged yet.
begin=$(usage)
wait "$publisher"
end=$(usage)
sed -n 's/^\(filled .*\|published .*\)$/\1/p' "$out/publish"
echo "$begin $end" | awk '{ printf "monitor %.3f of a core over %.0f s, ",
  ($4 - $2) / ($3 - $1), $3 - $1 }'
awk '/VmHWM/ { printf "%.0f MB\n", $2 / 1024 }' "/proc/$monitor/status"
kill -TERM "$monitor"
wait "$monitor"
monitor=
