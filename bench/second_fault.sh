#!/usr/bin/env bash
# Finds second faults: twelve pairs of a transmitter's and a valve's fault, the
# second one 600 s after the first, in open loop with the benchmark's set
# (campaigns/benchmark.toml, needs FDI_REFERENCE_DATA), and in the level loop
# with a set onboarded on two healthy hours of the valve. One line for each run:
# the name of the first at the end, what is on top of it and since when [s].
#
#     bench/second_fault.sh build/release/bin [open|loop|"open loop" [SEED]]
set -euo pipefail
bin=$(realpath "$1")
loops=${2:-open loop}
seed=${3:-7700}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data

pairs=(f13=.2,f1=.5 f13=.2,f2=.5 f13=.2,f7=.5 f13=.2,f4=.6 f19=-.3,f1=.5
  f19=-.3,f7=.5 f19=-.3,f4=.6 f1=.5,f19=-.3 f2=.5,f13=.2 f7=.5,f13=.2
  f4=.6,f19=-.3 f3=.6,f13=.2)

run() {  # PROGRAM ARGUMENT...
  "$bin/$1" "${@:2}" >/dev/null 2>"$work/log" || { cat "$work/log" >&2; exit 1; }
}

simulate() {  # FILE SEED OPTION...
  run fdi-simulator run --no-publish --seed "$2" --parameters lublin-actuator-3 \
    -o "$1" "${@:3}"
}

for loop in $loops; do
  setting=(--excitation level-loop)
  judge=(--valve V)
  if [ "$loop" = open ]; then
    setting=(--excitation sine --set continuous_inputs=true --set cold_start=true)
    judge=(--model-set benchmark)
    run fdi-trainer train --campaign campaigns/benchmark.toml
  else
    simulate "$work/healthy.csv" 5201 --duration 7200 "${setting[@]}"
    run fdi-trainer onboard --valve V --file "$work/healthy.csv" --no-coverage
  fi
  files=()
  for i in "${!pairs[@]}"; do
    first=${pairs[i]%,*}
    second=${pairs[i]#*,}
    file=$work/${first%=*}-${second%=*}.csv
    simulate "$file" $((seed + i)) --duration 2700 "${setting[@]}" \
      --fault "${first%=*}:abrupt@900:strength=${first#*=}" \
      --fault "${second%=*}:abrupt@1500:strength=${second#*=}"
    files+=(--file "$file")
  done
  "$bin/fdi-study" evaluate "${judge[@]}" "${files[@]}" --csv 2>"$work/log" |
    sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g' |
    awk -F, -v loop="$loop" '
      NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
      function Holds(set, fault) { return index("|" set "|", "|" fault "|") > 0 }
      {
        run = $at["run_id"]
        gsub(/.*\/|\.csv.*/, "", run)
        split(run, fault, "-")
        name = $at["final_set"]
        top = $at["second_set"]
        since = $at["second_t"]
        printf "%s %-8s %-10s on top %-14s %s\n", loop, run,
          name == "" ? "unknown" : name, top == "" ? "-" : top,
          since < 0 ? "" : since
        runs++
        kept += Holds(name, fault[1])
        detected += since > 1500
        held += since > 1500 && Holds(top, fault[2])
        third += name != "" && name !~ /\|/ && name != fault[1] &&
          name != fault[2]
      }
      END {
        printf "%s: of %d the first keeps its name in %d, the second is " \
          "detected in %d and in its set in %d, a third name alone in %d\n",
          loop, runs, kept, detected, held, third
      }'
done
