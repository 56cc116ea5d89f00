#!/usr/bin/env bash
# The main job, end to end: builds, trains the fuzzy observers of the paper's
# conditions, runs fdi-monitor and fdi-simulator as separate processes over DDS
# through the paper's ten fault scenarios and 24 fault-free hours, and asks
# SQLite what happened. Leaves pictures and databases in demo-out/.
set -euo pipefail
cd "$(dirname "$0")"
cmake/prepare.sh programs

export PATH=$PWD/build/release/bin:$PATH
out=demo-out
export FDI_DATA=$out/data
domain=${FDI_DOMAIN:-42}
model_set=${FDI_DEMO_SET:-paper-extended} # or paper
start=2026-01-01T00:00:00Z
monitor=

finish() {
  [ -z "$monitor" ] || kill "$monitor" 2>/dev/null || true
}
trap finish EXIT

say() { printf '\n== %s\n' "$*"; }
show() {
  echo "\$ $*"
  "$@"
}

rm -rf "$out"
mkdir -p "$out"

say "Training on simulated runs of the paper's eleven conditions"
begin=$SECONDS
show fdi-trainer train --campaign "campaigns/$model_set.toml" >"$out/training.txt"
echo "$((SECONDS - begin)) s; models and their figures: $out/training.txt"

say "Starting the monitor"
echo "\$ fdi-monitor run --model-set $model_set --domain $domain"
fdi-monitor run --model-set "$model_set" --domain "$domain" 2>"$out/monitor.log" &
monitor=$!
for _ in $(seq 300); do
  grep -q monitor_ready "$out/monitor.log" && break
  kill -0 "$monitor" 2>/dev/null || break
  sleep 0.1
done
grep monitor_ready "$out/monitor.log" || {
  cat "$out/monitor.log" >&2
  exit 1
}

simulate() {  # VALVE DURATION SEED [FAULT]
  local fault=()
  [ $# -lt 4 ] || fault=(--fault "$4")
  fdi-simulator run --valve "$1" --duration "$2" --seed "$3" "${fault[@]}" \
    --parameters paper-operating-point --excitation operating-point \
    --set excitation.amplitude_pct=12 --set excitation.period_s=60 \
    --start "$start" --speed max --domain "$domain" --log-level warning
}

say "Ten fault scenarios with seeds that training did not see"
seed=${FDI_DEMO_SEED:-90001}
while read -r valve fault; do
  simulate "$valve" 2000 "$seed" "$fault"
  seed=$((seed + 1))
done <<'SCENARIOS'
F1a f1:abrupt@50:strength=0.5
F2a f3:abrupt@50:strength=0.5
F3a f6:abrupt@50:strength=0.6
F4a f7:abrupt@50:strength=0.5
F5a f19:abrupt@50:strength=0.5
F1i f1:incipient@500+1200:from=0.26:strength=0.6
F2i f3:incipient@50+1650:strength=1
F3i f6:incipient@50+1650:strength=1
F4i f7:incipient@50+210:strength=1
F5i f19:incipient@50+850:strength=1
SCENARIOS

say "24 hours without fault"
simulate HEALTHY 86400 "$seed"

say "Stopping the monitor: it drains, closes and exits"
kill -TERM "$monitor"
wait "$monitor"
monitor=

say "The paper's tables with ours beside them"
sqlite3 -readonly "$FDI_DATA/history.db" <campaigns/paper_tables.sql

say "The fault history, straight from SQLite"
echo "\$ sqlite3 $FDI_DATA/history.db 'select * from fault_history'"
sqlite3 -readonly -box "$FDI_DATA/history.db" \
  "select episode_id, valve_id, detected_utc, isolated_utc, fault,
          round(peak_factor, 2) as peak_factor, model_set, end_reason
   from fault_history"

say "Pictures"
for valve in F1a F2a F3a F4a F5a F1i F2i F3i F4i F5i; do
  episode=$(sqlite3 -readonly "$FDI_DATA/history.db" \
    "select episode_id from fault_history where valve_id = '$valve' limit 1")
  [ -n "$episode" ] || continue
  fdi-store history plot "$episode" --output "$out/$valve.png" >/dev/null
  echo "$out/$valve.png"
done

say "Done: databases in $FDI_DATA, pictures in $out"
right=$(sqlite3 -readonly "$FDI_DATA/history.db" "
  select count(distinct valve_id) from (values ('F1a','f1'),('F2a','f3'),('F3a','f6'),
    ('F4a','f7'),('F5a','f19'),('F1i','f1'),('F2i','f3'),('F3i','f6'),
    ('F4i','f7'),('F5i','f19')) s
  join fault_history h on h.valve_id = s.column1 and h.fault = s.column2")
false_alarms=$(sqlite3 -readonly "$FDI_DATA/history.db" \
  "select count(*) from fault_history where valve_id = 'HEALTHY'")
if [ "$right" -lt 10 ] || [ "$false_alarms" -gt 0 ]; then
  echo "Not as expected: $right of 10 right, $false_alarms false alarms" >&2
  exit 1
fi
