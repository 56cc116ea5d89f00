#!/usr/bin/env bash
# Counts how often the final set holds the fault: 20 faults at strengths between
# those of the observers, in the level loop of valves whose Kv, positioner gain,
# viscous friction or supply is 15 % off the data sheet that onboarding starts
# from; by name also valves that differ in kind, and valves of another medium,
# trim or action in a loop of their own (gas, gas-linear, steam, linear,
# quick-opening, to-close; onboarded as a valve of that type). Each valve is
# onboarded on two healthy hours of its own; those of another kind also have two
# times four more.
# Prints a line for each valve and one for all; the answers go to FDI_RUNS, if
# that is set.
# FDI_SIGNALS=CV,F: the valve measures these alone. FDI_PERIOD=60: one sample in
# so many seconds, and as many rows. FDI_EFFECTS="10 20": instead of the twenty,
# every fault and sign at the least strengths that move F or X, at the recorded
# inputs, by so many per cent of their mean (root mean square of four minutes);
# faults that do not are left out. FDI_FAULTS="f2 f13-": these alone.
# FDI_ROWS="600 810": the fault begins in row 600 of 810 instead of 1200 of 2400.
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
  [gas-linear]=$'base = "gas-globe"
[medium]\nmolar_mass_kg_kmol = 18.02\ncompressibility = 0.95
isentropic_exponent = 1.3\n[trim]\nkv_m3_h = 400.0
characteristic = "linear"
[instruments]\nflow = { low = 0.0, high = 60.0, noise_sd = 0.085 }'
  [linear]=$'base = "liquid-globe"\n[trim]\ncharacteristic = "linear"'
  [quick-opening]=$'base = "liquid-globe"\n[trim]
characteristic = "quick-opening"'
  [to-close]=$'base = "liquid-globe"\n[actuator]\nspring = "to-close"')
[ ${#names[@]} -gt 0 ] || names=(nominal {Kv,gain,supply,friction}{-,+}15)
faults=(f1=.6 f2=.35 f2=.85 f3=.4 f3=.9 f4=.6 f5=.85 f6=.35 f7=.6 f10=.4
  f11=.85 f12=.65 f13=.2 f13=-.4 f15=.35 f16=.6 f17=.35 f18=.35 f19=.2 f19=-.35)
moving=(f{1..13} f{15..19} f{12,13,17,19}-)  # f14 moves neither F nor X.
[ -z "${FDI_FAULTS:-}" ] || read -ra moving <<<"$FDI_FAULTS"
period=${FDI_PERIOD:-1}
read -r begin rows <<<"${FDI_ROWS:-1200 2400}"

run_valve() {  # EXCITATION OPTION...
  local valve=(--set "parameters.${valves[$name]:-}")
  [ -z "${types[$name]:-}" ] || valve=(--parameters "$work/$name.toml")
  "$bin/fdi-simulator" run --no-publish --excitation "$1" "${valve[@]}" \
    "${@:2}" >/dev/null
}

simulate() {  # FILE ROWS OPTION...
  local loop=level-loop
  [ -z "${types[$name]:-}" ] || loop=inventory-loop
  seed=$((seed + 1))
  run_valve $loop --set period_s="$period" --duration $(($2 * period)) \
    --seed "$seed" -o "$1.all" "${@:3}"
  awk -F, -v OFS=, -v only="${FDI_SIGNALS:-CV,P1,P2,T1,X,F}" '
    NR == 1 { for (i = 1; i <= NF; ++i) {
      split($i, name, "_")
      keep[i] = name[1] !~ /^(CV|P1|P2|T1|X|F)$/ ||
        index("," only ",", "," name[1] ",") } }
    { line = $1
      for (i = 2; i <= NF; ++i) if (keep[i]) line = line OFS $i
      print line }' "$1.all" >"$1"
}

# FAULT[-] STRENGTH: whether it moves F or X by $effect % of the mean.
moves() {
  local sign=${1//[^-]/}
  run_valve "csv:$work/inputs.csv" --set noise=false -o "$work/moved.csv" \
    --fault "${1%-}:abrupt@60:strength=$sign$2"
  awk -F, -v effect="$effect" '
    FNR == 1 { for (i = 1; i <= NF; ++i) column[substr($i, 1, 2)] = i; next }
    FNR < 102 { next }
    NR == FNR { f[FNR] = $column["F_"]; x[FNR] = $column["X_"]; next }
    { sum_f += f[FNR]; sum_x += x[FNR]; n++
      square_f += ($column["F_"] - f[FNR]) ^ 2
      square_x += ($column["X_"] - x[FNR]) ^ 2 }
    END { exit sqrt(square_f * n) / sum_f < effect / 100 &&
      sqrt(square_x * n) / sum_x < effect / 100 }' \
    "$work/still.csv" "$work/moved.csv"
}

# To $faults: those at the least strengths that move the valve by FDI_EFFECTS.
find_strengths() {
  local fault effect low high middle
  head -n 301 "$work/healthy.csv.all" | cut -d, -f1-7 >"$work/inputs.csv"
  run_valve "csv:$work/inputs.csv" --set noise=false -o "$work/still.csv"
  faults=()
  for effect in $FDI_EFFECTS; do
    for fault in "${moving[@]}"; do
      moves "$fault" 1 || continue
      low=0 high=64
      while [ $((high - low)) -gt 1 ]; do
        middle=$(((low + high) / 2))
        if moves "$fault" "$(bc -l <<<"$middle/64")"; then
          high=$middle
        else
          low=$middle
        fi
      done
      faults+=("${fault%-}=${fault//[^-]/}$(bc -l <<<"scale=4; $high/64")")
    done
  done
}

# A set is one quoted field: "f6,f18" becomes f6|f18.
sets_with_bars() {
  sed -E ':again; s/("[^",]*),([^"]*")/\1|\2/; t again; s/"//g'
}

count() {  # NAME: of lines of `evaluate --csv`
  awk -F, -v name="$1" '
    $2 == "normal" { healthy++; episodes += $20; next }
    { runs++; detected += $4 == "true" }
    $17 != "" && $17 != "unknown" {
      named++; held = index("|" $17 "|", "|" $2 "|") > 0
      holds += held; alone += $17 == $2; wrong += !held && $17 !~ /\|/ }
    END { printf "%-13s%4d runs%4d detected%4d with a set%4d of them hold " \
      "the fault (%.0f %%)%4d are it%4d one wrong name", name, runs, detected,
      named, holds, named ? 100 * holds / named : 0, alone, wrong
      if (healthy)
        printf ", %d episodes in %d healthy runs", episodes, healthy
      print "" }'
}

for name in "${names[@]}"; do
  type=()
  if [ -n "${types[$name]:-}" ]; then
    printf '%s\n' "${types[$name]}" >"$work/$name.toml"
    type=(--type "$work/$name.toml")
  fi
  simulate "$work/healthy.csv" 7200
  [ -z "${FDI_EFFECTS:-}" ] || find_strengths
  "$bin/fdi-trainer" onboard --valve V --file "$work/healthy.csv" "${type[@]}" \
    --no-coverage >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
  files=()
  for fault in "${faults[@]}"; do
    # Only for water is it known when it evaporates.
    [[ $fault != f7=* || ${types[$name]:-} != *gas* ]] || continue
    [[ $fault != f7=* || ${types[$name]:-} != *steam* ]] || continue
    simulate "$work/$fault.csv" "$rows" --fault \
      "${fault%=*}:abrupt@$((begin * period)):strength=${fault#*=}"
    files+=(--file "$work/$fault.csv")
  done
  if [ -n "${types[$name]:-}${FDI_SIGNALS:-}${FDI_PERIOD:-}" ]; then
    for hours in 4 8; do
      simulate "$work/none-$hours.csv" 14400
      files+=(--file "$work/none-$hours.csv")
    done
  fi
  "$bin/fdi-study" evaluate --valve V "${files[@]}" --csv \
    2>"$work/log" | tail -n +2 | sets_with_bars | sed "s|$work/||" \
    >"$work/$name.runs"
  count "$name" <"$work/$name.runs"
  sed "s/^/$name,/" "$work/$name.runs" >>"${FDI_RUNS:-/dev/null}"
done
cat "$work"/*.runs | count all
