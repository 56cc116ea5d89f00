#!/usr/bin/env bash
# Slow records of our own level loop, read each 10 and 60 s: a healthy day is
# onboarded, then another one and eight hours with each fault at half its
# strength (from the fourth hour on) are evaluated. The loop itself runs a
# sample a second; the rows between are left out, as a historian does.
# Prints the lines of the report that say what is not seen, the answers, and the
# CPU time of onboarding and of the evaluation of each run.
#
#     bench/slow_records.sh build/release/bin [SEED [PERIOD...]]
set -euo pipefail
bin=$(realpath "$1")
seed=${2:-8101}
periods=("${@:3}")
[ ${#periods[@]} -gt 0 ] || periods=(10 60)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data
TIMEFORMAT='%U s of CPU'

simulate() {  # NAME SECONDS OPTION...
  "$bin/fdi-simulator" run --no-publish --speed max --excitation level-loop \
    --seed "$seed" --duration "$2" -o "$work/$1.csv" "${@:3}" >/dev/null
  seed=$((seed + 1))
}

simulate healthy 86400
simulate other-day 86400
for fault in f3 f6 f18 f19; do
  simulate "$fault" 28800 --fault "$fault:abrupt@14400:strength=0.5"
done
for period in "${periods[@]}"; do
  for file in healthy other-day f3 f6 f18 f19; do
    awk -v p="$period" 'NR == 1 || (NR - 2) % p == 0' "$work/$file.csv" \
      >"$work/$file-$period.csv"
  done
  echo "== one sample in $period s"
  time "$bin/fdi-trainer" onboard --valve "V$period" \
    --file "$work/healthy-$period.csv" 2>"$work/log" || cat "$work/log"
  for file in other-day f3 f6 f18 f19; do
    time "$bin/fdi-study" evaluate --valve "V$period" --assume-normal --csv \
      --file "$work/$file-$period.csv" 2>"$work/log" || cat "$work/log"
  done
done
