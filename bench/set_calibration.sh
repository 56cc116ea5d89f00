#!/usr/bin/env bash
# How often the final set holds the fault: 20 faults at strengths between those
# of the observers, in the level loop of valves whose Kv, positioner gain,
# viscous friction or supply is 15 % off the data sheet that onboarding starts
# from; by name also valves that differ in kind, and valves of another medium,
# trim or action in a loop of their own (gas, steam, linear, quick-opening,
# to-close; onboarded as a valve of that type). Each valve is onboarded on two
# healthy hours of its own, and has four more without a fault. Prints a line for
# each valve and one for all; the answers go to FDI_RUNS, if that is set.
# FDI_SIGNALS=CV,F: the valve measures these alone. FDI_PERIOD=60: one sample in
# so many seconds, and as many rows.
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
# Type files of their own.
declare -A types=([gas]='base = "gas-globe"' [steam]='base = "steam-globe"'
  [linear]=$'base = "liquid-globe"\n[trim]\ncharacteristic = "linear"'
  [quick-opening]=$'base = "liquid-globe"\n[trim]
characteristic = "quick-opening"'
  [to-close]=$'base = "liquid-globe"\n[actuator]\nspring = "to-close"')
[ ${#names[@]} -gt 0 ] || names=(nominal {Kv,gain,supply,friction}{-,+}15)
faults=(f1=.6 f2=.35 f2=.85 f3=.4 f3=.9 f4=.6 f5=.85 f6=.35 f7=.6 f10=.4
  f11=.85 f12=.65 f13=.2 f13=-.4 f15=.35 f16=.6 f17=.35 f18=.35 f19=.2 f19=-.35)
period=${FDI_PERIOD:-1}

simulate() {  # FILE ROWS OPTION...
  local valve=(--excitation level-loop --set "parameters.${valves[$name]:-}")
  [ -z "${types[$name]:-}" ] ||
    valve=(--excitation inventory-loop --parameters "$work/$name.toml")
  seed=$((seed + 1))
  "$bin/fdi-simulator" run --no-publish "${valve[@]}" --set period_s="$period" \
    --duration $(($2 * period)) --seed "$seed" --export "$1.all" "${@:3}" \
    >/dev/null
  awk -F, -v OFS=, -v only="${FDI_SIGNALS:-CV,P1,P2,T1,X,F}" '
    NR == 1 { for (i = 1; i <= NF; ++i) {
      split($i, name, "_")
      keep[i] = name[1] !~ /^(CV|P1|P2|T1|X|F)$/ ||
        index("," only ",", "," name[1] ",") } }
    { line = $1
      for (i = 2; i <= NF; ++i) if (keep[i]) line = line OFS $i
      print line }' "$1.all" >"$1"
  rm "$1.all"
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
  type=()
  if [ -n "${types[$name]:-}" ]; then
    printf '%s\n' "${types[$name]}" >"$work/$name.toml"
    type=(--type "$work/$name.toml")
  fi
  simulate "$work/healthy.csv" 7200
  "$bin/fdi-trainer" onboard --valve V --file "$work/healthy.csv" "${type[@]}" \
    --no-coverage >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
  files=()
  for fault in "${faults[@]}"; do
    # Of water alone it is known when it evaporates.
    [[ $fault != f7=* || ${types[$name]:-} != *gas* ]] || continue
    [[ $fault != f7=* || ${types[$name]:-} != *steam* ]] || continue
    simulate "$work/$fault.csv" 2400 --fault \
      "${fault%=*}:abrupt@$((1200 * period)):strength=${fault#*=}"
    files+=(--file "$work/$fault.csv")
  done
  if [ -n "${types[$name]:-}${FDI_SIGNALS:-}${FDI_PERIOD:-}" ]; then
    simulate "$work/none.csv" 14400
    files+=(--file "$work/none.csv")
  fi
  "$bin/fdi-trainer" evaluate --valve V "${files[@]}" --csv \
    2>"$work/log" | tail -n +2 | sed "s|$work/||" >"$work/$name.runs"
  count "$name" <"$work/$name.runs"
  sed "s/^/$name,/" "$work/$name.runs" >>"${FDI_RUNS:-/dev/null}"
done
cat "$work"/*.runs | count all
