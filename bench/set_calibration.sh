#!/usr/bin/env bash
# How often the final set holds the fault: 20 faults at strengths between those
# of the observers, in the level loop of valves whose Kv, positioner gain,
# viscous friction or supply is 15 % off the data sheet that onboarding starts
# from; by name also valves that differ in kind. Each valve is onboarded on two
# healthy hours of its own. Prints a line for each valve and one for all; the
# answers go to FDI_RUNS, if that is set.
#
#     bench/set_calibration.sh build/release/bin [SEED [VALVE...]]
set -euo pipefail
bin=$(realpath "$1")
seed=${2:-20000}
names=("${@:3}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export FDI_DATA=$work/data

declare -A valves=(
  [nominal]=trim.kv_m3_h=120
  [Kv-15]=trim.kv_m3_h=102 [Kv+15]=trim.kv_m3_h=138
  [gain-15]=positioner.gain=85 [gain+15]=positioner.gain=115
  [friction-15]=actuator.damping_n_s_m=1275
  [friction+15]=actuator.damping_n_s_m=1725
  [supply-15]=actuator.supply_pressure_gauge_pa=510e3
  [supply+15]=actuator.supply_pressure_gauge_pa=690e3
  [coulomb150]=actuator.coulomb_friction_n=150
  [coulomb500]=actuator.coulomb_friction_n=500
  [plug-40]=actuator.plug_area_m2=1.178e-3
  [integral30]=positioner.integral_time_s=30)
[ ${#names[@]} -gt 0 ] || names=(nominal {Kv,gain,supply,friction}{-,+}15)
faults=(f1=.6 f2=.35 f2=.85 f3=.4 f3=.9 f4=.6 f5=.85 f6=.35 f7=.6 f10=.4
  f11=.85 f12=.65 f13=.2 f13=-.4 f15=.35 f16=.6 f17=.35 f18=.35 f19=.2 f19=-.35)

simulate() {  # FILE OPTION...
  seed=$((seed + 1))
  "$bin/fdi-simulator" run --no-publish --speed max --excitation level-loop \
    --set "parameters.${valves[$name]}" --seed "$seed" --export "$@" >/dev/null
}

count() {  # NAME: of lines of `evaluate --csv`
  awk -F, -v name="$1" '
    { runs++; detected += $4 == "true" }
    $17 != "" && $17 != "unknown" {
      named++; held = index("|" $17 "|", "|" $2 "|") > 0
      holds += held; alone += $17 == $2; wrong += !held && $17 !~ /\|/ }
    END { printf "%-13s%4d runs%4d detected%4d with a set%4d of them hold " \
      "the fault (%.0f %%)%4d are it%4d one wrong name\n", name, runs,
      detected, named, holds, named ? 100 * holds / named : 0, alone, wrong }'
}

for name in "${names[@]}"; do
  simulate "$work/healthy.csv" --duration 7200
  "$bin/fdi-trainer" onboard --valve V --file "$work/healthy.csv" \
    --no-coverage >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
  files=()
  for fault in "${faults[@]}"; do
    simulate "$work/$fault.csv" --duration 2400 \
      --fault "${fault%=*}:abrupt@1200:strength=${fault#*=}"
    files+=(--file "$work/$fault.csv")
  done
  "$bin/fdi-trainer" evaluate --valve V "${files[@]}" --csv \
    2>"$work/log" | tail -n +2 | sed "s|$work/||" >"$work/$name.runs"
  count "$name" <"$work/$name.runs"
  sed "s/^/$name,/" "$work/$name.runs" >>"${FDI_RUNS:-/dev/null}"
done
cat "$work"/*.runs | count all
