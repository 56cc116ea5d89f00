#!/usr/bin/env bash
# Faults that grow over days, and days without fault, at a sample a second in
# our own simulator, whose air mass is conserved. Scored by the benchmark's set
# under its sine (needs FDI_REFERENCE_DATA), or, with `onboarded`, by that of a
# valve in its level loop, onboarded on two healthy hours of its own.
# A line for each ramp from 0 to 1: the strength at the detection, at the first
# name that holds the fault and from where on such a name stands, then the
# answer. One process at a time; a ramp of 30 days takes about five minutes of
# CPU. FDI_FAULTS="f2 f9": these alone; none: FDI_FAULTS=" ". FDI_PERIOD=10 with
# `onboarded`: one sample in so many seconds, in the loop that any valve can
# have, onboarded on a day. FDI_UNTIL=.6: no longer than until this strength.
#
#     bench/slow_ramps.sh build/release/bin [benchmark|onboarded [SEED [HEALTHY_DAYS [RAMP_DAYS...]]]]
set -euo pipefail
bin=$(realpath "$1")
kind=${2:-benchmark}
seed=${3:-54100}
healthy_days=${4:-60}
ramps=("${@:5}")
[ ${#ramps[@]} -gt 0 ] || ramps=(7 30)
read -ra faults <<<"${FDI_FAULTS-f2 f3 f5 f6 f9 f18 f19}"
day=86400
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data

setting=(--excitation sine --set continuous_inputs=true --set cold_start=true)
record=7200
if [ "$kind" = onboarded ] && [ -n "${FDI_PERIOD:-}" ]; then
  setting=(--excitation inventory-loop --set "period_s=$FDI_PERIOD")
  record=$day
elif [ "$kind" = onboarded ]; then
  setting=(--excitation level-loop)
fi

run() {  # PROGRAM ARGUMENT...
  "$bin/$1" "${@:2}" >"$work/out" 2>"$work/log" || { cat "$work/log" >&2; exit 1; }
}

simulate() {  # SECONDS OPTION...
  seed=$((seed + 1))
  run fdi-simulator run --no-publish --speed max --seed "$seed" --duration "$1" \
    --parameters lublin-actuator-3 "${setting[@]}" -o "$work/run.csv" "${@:2}"
}

evaluate() {  # a line of the file, the faults of its set joined by bars
  run fdi-study evaluate --model-set "$kind" --assume-normal --csv \
    --file "$work/run.csv"
  tail -n 1 "$work/out" |
    sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g'
}

if [ "$kind" = benchmark ]; then
  run fdi-trainer train --campaign "$(dirname "$0")/../campaigns/benchmark.toml"
else
  simulate $record
  run fdi-trainer onboard --valve onboarded --file "$work/run.csv" --no-coverage
fi

for days in "${ramps[@]}"; do
  length=$(bc <<<"$days * $day / 1")
  for fault in "${faults[@]}"; do
    simulate "$(bc <<<"(900 + $length * ${FDI_UNTIL:-1}) / 1")" --fault "$fault:incipient@900+$length:strength=1"
    evaluate | awk -F, -v days="$days" -v length_s="$length" '
      function Share(seconds) {
        return seconds < 0 ? "never" : sprintf("%.4f", seconds / length_s)
      }
      { printf "%-4s over %s days: detected at %s, to stay at %s, in the name " \
          "at %s, to stay at %s, alone at %s; final set %s (%s), %d episodes, " \
          "%d wrong names\n", $2, days, Share($5), Share($6), Share($7),
          Share($8), Share($19), $17, $18, $20, $21 }'
  done
done
episodes=0
for ((n = 1; n <= healthy_days; n++)); do
  simulate "$day"
  line=$(evaluate)
  raised=$(cut -d, -f20 <<<"$line")
  [ "$raised" = 0 ] || echo "seed $seed: $line"
  episodes=$((episodes + raised))
done
echo "$healthy_days days without fault: $episodes episodes"
