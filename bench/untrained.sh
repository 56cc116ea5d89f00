#!/usr/bin/env bash
# Shows how a set of the paper's five faults answers to a fault that it does not
# know: every other fault and sign at .3 and .6, abrupt, and the answer at the
# end of the run: unknown, a set, or one wrong name.
#
# A fault counts as different if its run, without noise, is further from that of
# every trained fault at every strength (.01 to .05, .1, ... 1, and what lies
# between) than the noise of one reading: the root mean square of the difference
# of at least one signal, over the time in which the fault acts, is more than the
# standard deviation of that signal's noise. The others look like what the set
# knows. Faults that are not detected count for neither.
#
# With `onboarded`, the set is one of a valve in its level loop, onboarded on two
# healthy hours of its own and reduced to the same five faults; it has no second
# look, which knows all faults. The answers go to FDI_RUNS, if that is set.
#
#     bench/untrained.sh build/release/bin [CAMPAIGN.toml|onboarded [SEED]]
set -euo pipefail
bin=$(realpath "$1")
campaign=${2:-campaigns/paper.toml}
seed=${3:-5200}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data
begin=200
seconds=600
setting=(--parameters paper-operating-point --excitation operating-point
  --set excitation.amplitude_pct=12 --set excitation.period_s=60)
if [ "$campaign" = onboarded ]; then
  begin=600
  seconds=1200
  setting=(--parameters lublin-actuator-3 --excitation level-loop)
fi

trained=(f1 f3 f6 f7 f19)
untrained=(f2 f4 f5 f9 f10 f11 f12 f12- f13 f13- f15 f16 f17 f17- f18 f19- t1 t1-
  p1 p1- p2 p2-)

run() {  # PROGRAM ARGUMENT...
  "$bin/$1" "${@:2}" >/dev/null 2>"$work/log" || { cat "$work/log" >&2; exit 1; }
}

simulate() {  # FILE OPTION...
  run fdi-simulator run --no-publish --seed "$seed" --duration "$seconds" \
    "${setting[@]}" -o "$@"
}

simulate_fault() {  # FILE FAULT STRENGTH OPTION...
  simulate "$1" --fault "${2%-}:abrupt@$begin:strength=$3" "${@:4}"
}

if [ "$campaign" = onboarded ]; then
  run fdi-simulator run --no-publish --seed $((seed + 1)) --duration 7200 \
    "${setting[@]}" -o "$work/healthy.csv"
  run fdi-trainer onboard --valve V --file "$work/healthy.csv" --no-coverage
  set_name=five
  without=f8,$(printf '%s\n' "${untrained[@]}" | grep -v -- - | paste -sd,)
  run fdi-study reduce V --as "$set_name" --without "$without"
else
  run fdi-trainer train --campaign "$campaign"
  set_name=$(sed -n 's/^name = "\(.*\)"/\1/p' "$campaign")
fi

simulate "$work/noisy.csv"
simulate "$work/clean.csv" --set noise=false
for fault in "${trained[@]}"; do
  for strength in .01 .02 .03 .04 .05 .1 .15 .2 .25 .3 .35 .4 .45 .5 .55 .6 \
    .65 .7 .75 .8 .85 .9 .95 1; do
    simulate_fault "$work/known-$fault=$strength" "$fault" "$strength" \
      --set noise=false
  done
done
files=()
for fault in "${untrained[@]}"; do
  for strength in .3 .6; do
    case $fault in *-) strength=-$strength ;; esac
    run=${fault%-}=$strength
    simulate_fault "$work/$run.csv" "$fault" "$strength"
    simulate_fault "$work/clean-$run" "$fault" "$strength" \
      --set noise=false
    files+=(--file "$work/$run.csv")
  done
done

# The nearest trained fault of each run and how far it is, in deviations; between
# two strengths, runs are interpolated. Every fifth reading is taken.
awk -F, '
  FNR == 1 { file++; next }
  file < 3 {
    for (c = 2; c <= 7; c++) {
      if (file == 1) noisy[FNR, c] = $c
      else square[c] += ($c - noisy[FNR, c]) ^ 2
    }
    count = FNR - 1
    next
  }
  FNR == 2 {
    name = FILENAME
    sub(/.*\/(clean|known)-/, "", name)
    fault = name
    sub(/=.*/, "", fault)
    names[file] = name
    follows[file] = FILENAME ~ /known-/ && fault == before
    before = FILENAME ~ /known-/ ? fault : ""
  }
  $1 < begin + 20 || $1 % 5 { next }
  {
    k = ++rows[file]
    for (c = 2; c <= 7; c++) value[file, k, c] = $c
  }
  function Compare(a, p, q,    c, k, w, d, most, from, over, cross, wide) {
    for (c = 2; c <= 7; c++) {
      from[c] = cross[c] = wide[c] = 0
      for (k = 1; k <= rows[a]; k++) {
        d = value[a, k, c] - value[p, k, c]
        over = value[q, k, c] - value[p, k, c]
        from[c] += d * d
        cross[c] += d * over
        wide[c] += over * over
      }
    }
    for (w = 0; w <= 1.001; w += .05) {
      most = 0
      for (c = 2; c <= 7; c++) {
        d = from[c] - 2 * w * cross[c] + w * w * wide[c]
        d = square[c] > 0 ? d / rows[a] * count / square[c] : 0
        if (d > most) most = d
      }
      if (most < least) { least = most; nearest = names[q] }
    }
  }
  END {
    for (a = first; a <= file; a++) {
      least = 1e9
      for (q = 4; q < first; q++) if (follows[q]) Compare(a, q - 1, q)
      printf "%s,%s,%.2f\n", names[a], nearest, sqrt(least > 0 ? least : 0)
    }
  }' first=$((3 + 24 * ${#trained[@]})) begin=$begin \
  "$work/noisy.csv" "$work/clean.csv" "$work"/known-* "$work"/clean-* \
  >"$work/distances"

"$bin/fdi-study" evaluate --model-set "$set_name" "${files[@]}" --csv \
  2>"$work/log" | tail -n +2 |
  sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g' >"$work/answers"
cat "$work/answers" >>"${FDI_RUNS:-/dev/null}"
awk -F, '
  NR == FNR { nearest[$1] = $2; distance[$1] = $3; next }
  { run = $1; sub(/.*\//, "", run); sub(/\.csv.*/, "", run)
    answer = $4 != "true" ? "not detected" : $17 == "" ? "unknown" : $17
    printf "%-9s nearest %-9s %7.2f deviations  %s\n", run, nearest[run], distance[run], answer
    if ($4 != "true") next
    kind = distance[run] > 1 ? "different" : "alike"
    runs[kind]++
    unknown[kind] += answer == "unknown"
    set[kind] += answer ~ /\|/
    wrong[kind] += answer != "unknown" && answer !~ /\|/
  }
  END {
    for (kind in runs)
      printf "%s: %d detected, %d unknown, %d a set, %d one wrong name\n", kind,
        runs[kind], unknown[kind], set[kind], wrong[kind]
  }' "$work/distances" "$work/answers"
