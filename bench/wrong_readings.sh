#!/usr/bin/env bash
# Episodes that single wrong readings make of healthy hours, and what they do to
# records with a fault:
#
#     bench/wrong_readings.sh build/release/bin FOLDER/closed-loop
#
# FOLDER is the reference data. Wrong readings come at random, 1, 5 or 20 an hour
# in F, X or P1; each tenth is two in a row. `extreme` ones are at an end of the
# range of the transmitter, `impossible` ones are what no transmitter reads. The
# healthy hours are eight of the independent model's loop, and a day each of our
# own simulator in its level loop and under a sine, by sets of two hours. In the
# records with a fault, ten wrong readings of F an hour, half of each kind.
set -euo pipefail
bin=$(realpath "$1")
data=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data

run() {  # PROGRAM ARGUMENT...
  "$bin/$1" "${@:2}" >/dev/null 2>"$work/log" || { cat "$work/log" >&2; exit 1; }
}

onboard() {  # NAME FILE
  run fdi-trainer onboard --valve "$1" --file "$2" --no-coverage
}

spoil() {  # SEED RATE COLUMN EXTREME IMPOSSIBLE FILE: an empty value is not used
  awk -F, -v OFS=, -v seed="$1" -v rate="$2" -v name="$3" -v extreme="$4" \
    -v impossible="$5" '
    BEGIN { srand(seed) }
    NR == 1 { for (i = 1; i <= NF; i++) if (index($i, name "_") == 1) c = i }
    NR > 1 && (again || rand() < rate / 3600) {
      again = !again && rand() < .1
      $c = impossible == "" || (extreme != "" && rand() < .5) ? extreme : impossible
    }
    1' "$6"
}

evaluate() {  # NAME FILE...: run,detected,t_dt,final_set,episodes
  local name=$1 file files=()
  shift
  for file; do files+=(--file "$file"); done
  "$bin/fdi-trainer" evaluate --model-set "$name" --assume-normal --csv \
    "${files[@]}" 2>"$work/log" |
    sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g' |
    awk -F, '
      NR == 1 { for (i = 1; i <= NF; i++) at[$i] = i; next }
      { sub(/.*\//, "", $1)
        print $1 "," $(at["detected"]) "," $(at["t_dt"]) "," $(at["final_set"]) "," $(at["episodes"]) }'
}

simulate() {  # FILE LOOP SECONDS SEED
  run fdi-simulator run --no-publish --speed max --excitation "$2" --seed "$4" \
    --duration "$3" -o "$1"
}

onboard independent "$data/healthy_onboard.csv"
cp "$data"/healthy_4h_[12].csv "$work"
for loop in level-loop sine; do
  simulate "$work/taught.csv" $loop 7200 11
  onboard $loop "$work/taught.csv"
  simulate "$work/$loop.csv" $loop 86400 1501
done

echo "loop,hours,signal,kind,rate,episodes"
for loop in independent level-loop sine; do
  files=("$work/$loop.csv")
  [ $loop != independent ] || files=("$work"/healthy_4h_[12].csv)
  hours=$([ $loop = independent ] && echo 8 || echo 24)
  for signal in F:39.9:-999 X:100:655.35 P1:5000:-99999; do
    IFS=: read -r name extreme impossible <<<"$signal"
    for kind in extreme impossible; do
      for rate in 1 5 20; do
        spoilt=()
        for file in "${files[@]}"; do
          spoilt+=("$work/wrong-$(basename "$file")")
          seed=$((10 * ${#spoilt[@]} + rate))
          if [ $kind = extreme ]; then spoil $seed $rate "$name" "$extreme" "" "$file"
          else spoil $seed $rate "$name" "" "$impossible" "$file"; fi >"${spoilt[-1]}"
        done
        evaluate $loop "${spoilt[@]}" |
          awk -F, -v row="$loop,$hours,$name,$kind,$rate" '{ n += $5 } END { print row "," n + 0 }'
      done
    done
  done
done

echo "record,t_dt,final_set,t_dt_wrong,final_set_wrong"
spoilt=()
for file in "$data"/loop_f*.csv; do
  spoilt+=("$work/$(basename "$file")")
  spoil 7 10 F 39.9 -999 "$file" >"${spoilt[-1]}"
done
evaluate independent "$data"/loop_f*.csv >"$work/clean"
evaluate independent "${spoilt[@]}" >"$work/spoilt"
paste -d, "$work/clean" "$work/spoilt" | awk -F, -v OFS=, '{ print $1, $3, $4, $8, $9 }'
