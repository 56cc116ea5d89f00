#!/usr/bin/env bash
# A valve that is onboarded at five operating points: 20 min of our own
# simulator at each of CV 35, 42, 50, 58 and 66 %, moved by 1.5 %. Scored are
# healthy runs of 40 min between and beyond them and four faults at 74 %, before
# and after `relearn --models` with 20 healthy minutes at 74 %.
#
#     bench/plateaus.sh build/release/bin [SEED]
set -euo pipefail
bin=$(realpath "$1")
seed=${2:-97000}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data
cd "$work"

run() {  # PROGRAM ARGUMENT...
  "$bin/$1" "${@:2}" >out 2>log || { cat log >&2; exit 1; }
}

simulate() {  # FILE CV SECONDS OPTION...
  seed=$((seed + 1))
  run fdi-simulator run --no-publish --speed max --parameters lublin-actuator-3 \
    --excitation operating-point --set "excitation.cv_pct=$2" \
    --set excitation.amplitude_pct=1.5 --set excitation.period_s=90 \
    --seed $seed --duration "$3" -o "$1" "${@:4}"
}

score() {
  echo "$1"
  run fdi-study evaluate --valve V --assume-normal "${scored[@]}" --csv
  sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g' out |
    awk -F, 'NR > 1 { sub(/\.csv/, "", $1)
      printf "  %-12s %s\n", $1, $4 == "true" ? "detected after " $5 \
        " s, named after " $7 " s, final set " $17 : "no episode" }'
}

taught=()
for cv in 35 42 50 58 66; do
  simulate "taught-$cv.csv" $cv 1200
  taught+=(--file "taught-$cv.csv")
done
scored=()
for cv in 38 46 54 62 30 74; do
  simulate "healthy-$cv.csv" $cv 2400
  scored+=(--file "healthy-$cv.csv")
done
for fault in f2 f7 f13 f19; do
  simulate "$fault-74.csv" 74 2400 --fault "$fault:abrupt@1200:strength=.5"
  scored+=(--file "$fault-74.csv")
done
simulate more.csv 74 1200
run fdi-trainer onboard --valve V "${taught[@]}"
score "as onboarded"
run fdi-trainer relearn V --models --activate --file more.csv
score "extended"
