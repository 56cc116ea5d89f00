#!/usr/bin/env bash
# Episodes that starts and stops make of a healthy valve:
#
#     bench/starts.sh build/release/bin DIR [KEY=VALUE...]
#
# A valve, with the scenario keys, is onboarded on two hours of its level loop,
# by three signals and by six. Then it is shut at 1800 s, opens at 3600 s by a
# step or along a ramp to where it would be or 15 % beside it, and is where it
# would be from 5400 to 9600 s. A monitor judges it, with second looks. DIR has
# the list of episodes for either set. The names of valves say ramp [s],
# distance [%] and, where it is special, how it opens: `wide` open for two
# minutes, at the `seat` or nearly shut (`low`) for five or ten, in steps to
# 68 and 81 % of closing (`steps`), or with the `pump` that starts with it.
set -euo pipefail
bin=$(realpath "$1")
mkdir -p "$2"
dir=$(realpath "$2")
keys=()
for key in "${@:3}"; do keys+=(--set "$key"); done
export FDI_DATA=$dir/data
starts=(0:0 30:0 120:0 600:0 0:-15 30:-15 120:-15 0:15 30:15 600:15 0:0:wide
  30:0:wide 120:-15:wide 30:0:seat 30:0:low 30:15:low 0:0:steps 30:0:steps
  0:0:pump 30:0:pump)

monitor=
trap '[ -z "$monitor" ] || kill "$monitor" || true' EXIT

quietly() { "$@" >"$dir/out" 2>"$dir/log" || { cat "$dir/log" >&2; exit 1; }; }

simulate() {  # FILE SEED SECONDS EXCITATION
  [ -f "$1" ] || quietly "$bin/fdi-simulator" run --no-publish --speed max \
    --seed "$2" --duration "$3" -o "$1" --excitation "$4" "${keys[@]}"
}

# The pressures follow the flow about as in the level loop.
shut_and_open() {  # RAMP DISTANCE KIND
  awk -F, -v OFS=, -v ramp="$1" -v distance="$2" -v kind="$3" '
    NR == 1 {
      for (i = 1; i <= NF; i++) { sub(/_.*/, "", $i); at[$i] = i }
      print "t_s,CV_pct,X_pct,P1_kPa,P2_kPa,T1_degC"
      next
    }
    {
      cv = $(at["CV"]); p1 = $(at["P1"]); p2 = $(at["P2"])
      since = $1 - 3600
      aim = $1 >= 1800 && $1 < 5400 ? cv + distance : cv
      if ($1 >= 1800 && since < 0) aim = 100
      else if (since >= 0 && since < ramp) aim = 100 - (100 - aim) * since / ramp
      if (kind == "wide" && since >= 0 && since < 120) aim = 0
      if (kind == "seat" && since >= 0 && since < 300) aim = 98 + 1.5 * sin(since / 8)
      if (kind == "low" && since >= 0 && since < 600) aim = 96 + 2 * sin(since / 40)
      if (kind == "steps" && since >= 0 && since < 600) aim = int(since / 30) % 2 ? 81 : 68
      aim = aim > 100 ? 100 : aim < 0 ? 0 : aim
      open = (100 - aim) / (100 - cv)
      open = open > 1 ? 1 : open
      p1 += 50 * (1 - open); p2 -= 35 * (1 - open)
      if (kind == "pump" && $1 >= 1800 && since < 60)
        p1 = p2 + (since > 0 ? (p1 - p2) * since / 60 : 0)
      print $1, aim, aim, p1, p2, $(at["T1"])
    }' "$dir/hours.csv"
}

simulate "$dir/taught.csv" 5501 7200 level-loop
simulate "$dir/hours.csv" 5502 9600 level-loop
for start in "${starts[@]}"; do
  IFS=: read -r ramp distance kind <<<"$start"
  shut_and_open "$ramp" "$distance" "$kind" >"$dir/${start//:/_}.in"
  simulate "$dir/${start//:/_}.csv" 5511 9600 "csv:$dir/${start//:/_}.in"
done
for signals in CV,X,F CV,X,F,P1,P2,T1; do
  set=of$(tr -dc , <<<"$signals," | wc -c)
  [ -f "$dir/$set.made" ] || quietly "$bin/fdi-trainer" onboard --valve "$set" \
    --no-coverage --signals "$signals" --file "$dir/taught.csv"
  touch "$dir/$set.made"
  rm -f "$FDI_DATA"/history.db*
  "$bin/fdi-monitor" run --model-set "$set" >"$dir/$set.log" 2>&1 &
  monitor=$!
  for start in "${starts[@]}"; do
    quietly "$bin/fdi-simulator" replay --valve "${start//:/_}" --speed max \
      --keep-stamps --wait-reader 60 --file "$dir/${start//:/_}.csv"
  done
  kill "$monitor"
  wait "$monitor"
  monitor=
  "$bin/fdi-store" history list --rows 1000 --csv >"$dir/$set.csv"
  echo "$set: ${#starts[@]} starts, $(sqlite3 -readonly "$FDI_DATA/history.db" \
    "SELECT round(sum(hours), 1) FROM judged_hours") hours judged," \
    "$(($(wc -l <"$dir/$set.csv") - 1)) episodes"
done
