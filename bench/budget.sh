#!/usr/bin/env bash
# How often a budget of alarms is overdrawn by healthy valves: twelve of several
# kinds, each onboarded on two hours of its own, then judged for parts of five
# days. Every part has seeds and demands of its own, which differ from those of
# the two hours. The tails of a day rest on the hours before it, and the first
# part is not counted. What is done stays in FOLDER, so that a run goes on where
# the last one ended; a part of all valves takes about ten minutes of processor.
#
#     bench/budget.sh build/release/bin FOLDER PARTS [BUDGET...]
set -euo pipefail
bin=$(realpath "$1")
dir=$2
parts=$3
mkdir -p "$dir"/{data,taught,hours}
export FDI_DATA=$dir/data

# Name, excitation, key of the demand; its value as taught and those of the
# parts, in turns; what the valve is.
valves='
v01 level-loop steam_demand_t_h 14.89,15,14.2,15.5,14.6,15.8
v02 level-loop steam_demand_t_h 14.89,14,15,14.4,15.4,13.8 trim.kv_m3_h=105 actuator.coulomb_friction_n=150
v03 level-loop steam_demand_t_h 13.5,14.5,14,13,14.8,13.8 actuator.spring_preload_m=0.0085 positioner.gain=85
v04 level-loop level_set_point_pct 50,52,48,51,49,50.5 actuator.damping_n_s_m=1800
v05 sine phase_s 0,13,29,47,61,83
v06 sine phase_s 0,13,29,47,61,83 trim.kv_m3_h=135 actuator.play_fraction=0.013
v07 operating-point amplitude_pct 12,10,9,11,8,12.5 actuator.diaphragm_area_m2=0.031
v08 operating-point amplitude_pct 10,8,9,11,7,10.5 trim.exponent=4.4
v09 inventory-loop initial_cv_pct 60,58,61,57,62,59
v10 inventory-loop initial_cv_pct 60,58,61,57,62,59 trim.exponent=3.8
v11 inventory-loop initial_cv_pct 60,62,58,61,57,59 actuator.coulomb_friction_n=300 trim.kv_m3_h=110
v12 level-loop steam_demand_t_h 14.89,15.5,14.3,15,14.6,15.8 positioner.filter_time_s=0.4 actuator.chamber_volume_m3=0.0063
'

scenario() {  # SEED EXCITATION KEY VALUE KEY=VALUE...
  echo "seed = $1"
  # Shares of an hour are the same within 0.001 as with the usual tolerances.
  if [ "$2" = sine ]; then
    printf 'continuous_inputs = true\ntolerance_scale = 10\n'
  else
    echo 'tolerance_scale = 100'
  fi
  printf '[excitation]\nname = "%s"\n%s = %s\n' "$2" "$3" "$4"
  printf '[parameters]\nname = "lublin-actuator-3"\n'
  for each in "${@:5}"; do echo "${each/=/ = }"; done
}

step() {  # FILE COMMAND...: once; the command leaves FILE.part
  [ ! -e "$1" ] || return 0
  "${@:2}" </dev/null >"$dir/log" 2>&1 || { tail -3 "$dir/log" >&2; exit 1; }
  mv "$1.part" "$1"
}

onboard() {  # VALVE
  "$bin/fdi-simulator" run --scenario "$dir/taught/$1.toml" --duration 7200 \
    --no-publish -o "$dir/taught/$1.csv" &&
    "$bin/fdi-trainer" onboard --valve "$1" --file "$dir/taught/$1.csv" \
      --no-coverage &&
    touch "$dir/taught/$1.done.part"
}

for part in $(seq 0 $((parts - 1))); do
  while read -r valve excitation key values what; do
    [ -n "$valve" ] || continue
    IFS=, read -ra value <<<"$values"
    read -ra what <<<"$what"
    scenario 11 "$excitation" "$key" "${value[0]}" "${what[@]}" \
      >"$dir/taught/$valve.toml"
    step "$dir/taught/$valve.done" onboard "$valve"
    # A day has the next seed: a million of a valve are never used up.
    scenario $((100000000 + 1000000 * 10#${valve#v})) "$excitation" "$key" \
      "${value[1 + part % (${#value[@]} - 1)]}" "${what[@]}" >"$dir/day.toml"
    hours=$dir/hours/$valve.$(printf %03d "$part").csv
    step "$hours" "$bin/fdi-study" hours --model-set "$valve" \
      --scenario "$dir/day.toml" --first-day $((5 * part)) --days 5 \
      -o "$hours.part"
  done <<<"$valves"
done
for budget in "${@:4}"; do
  echo "== $budget"
  "$bin/fdi-study" budget "$dir"/hours/*.csv --budget "$budget" \
    --taught-hours 120
done
