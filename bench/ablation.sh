#!/usr/bin/env bash
# Measures each rule of diagnosis/decision/rules.h: scores every set of runs
# below with each rule left out, and writes docs/results/ablation.md. Results in
# DIR are kept, so that a stopped run continues; remove a DIR of another version.
# Needs FDI_REFERENCE_DATA. One process at a time, about half an hour of CPU for
# all rules without looks, ramps and slow days; those columns take minutes a
# rule, so name RULES for them. The observers only, but for the columns that
# end with -looks.
#
#     [RULES="drift lasting"] bench/ablation.sh build/release/bin DIR [COLUMN...]
#
# RULES: these only, beside the program as it is.
# SEEDS: others than "1 2"; a COLUMN-7 is of SEEDS=7.
# SHIFT: added to the seeds of perturbed-1 to -4.
set -euo pipefail
bin=$(realpath "$1")
mkdir -p "$2"
dir=$(realpath "$2")
wanted=" ${*:3} "
seeds=${SEEDS:-1 2}
shift=${SHIFT:-0}
cd "$(dirname "$0")/.."
data=$FDI_REFERENCE_DATA
export FDI_DATA=$dir/data
mkdir -p "$dir/runs"
rules=()
for rule in ${RULES:+none $RULES}; do rules+=(--rule "$rule"); done

quietly() { "$@" >"$dir/out" 2>"$dir/log" || { cat "$dir/log" >&2; exit 1; }; }

simulate() {  # NAME SEED SECONDS OPTION...
  [ -f "$dir/runs/$1.csv" ] || quietly "$bin/fdi-simulator" run --no-publish \
    --speed max --seed "$2" --duration "$3" -o "$dir/runs/$1.csv" "${@:4}"
}

once() {  # NAME COMMAND...
  [ -f "$dir/$1.made" ] || { quietly "${@:2}"; touch "$dir/$1.made"; }
}

is_wanted() { [ "$wanted" = "  " ] || [[ $wanted == *" $1 "* ]]; }

ablate() {  # COLUMN "SET [OPTION...]" FILE...
  local set files=()
  read -ra set <<<"$2"
  for file in "${@:3}"; do files+=(--file "$file"); done
  quietly "$bin/fdi-study" ablate --parts "$dir/parts" --column "$1" \
    --model-set "${set[@]}" "${files[@]}" "${rules[@]}"
  cat "$dir/out"
}

ablate_campaign() {  # COLUMN CAMPAIGN SEED_OFFSET [SET]
  quietly "$bin/fdi-study" ablate --parts "$dir/parts" --column "$1" \
    --model-set "${4:-benchmark}" --campaign "$2" --seed-offset "$3" "${rules[@]}"
  cat "$dir/out"
}

open_loop=(--parameters lublin-actuator-3 --excitation sine
  --set continuous_inputs=true --set cold_start=true)
level_loop=(--parameters lublin-actuator-3 --excitation level-loop)

benchmark_set() {
  once benchmark "$bin/fdi-trainer" train --campaign campaigns/benchmark.toml
}
own_set() {
  simulate own-healthy 5201 7200 "${level_loop[@]}"
  once own "$bin/fdi-trainer" onboard --valve own --no-coverage \
    --file "$dir/runs/own-healthy.csv"
}
given_set() {
  once LV1 "$bin/fdi-trainer" onboard --valve LV1 --no-coverage \
    --file "$data/closed-loop/healthy_onboard.csv"
}

# The benchmark without the seven ramps of a day, and these alone.
awk '/^\[\[validation\]\]/ { last = NR } { line[NR] = $0 }
  END { for (i = 1; i < last; i++) print line[i] }' \
  campaigns/benchmark.toml >"$dir/short.toml"
awk '/^\[\[validation\]\]/ && !first { first = NR }
  /^\[\[validation\]\]/ { last = NR } { line[NR] = $0 }
  END { for (i = 1; i <= NR; i++) if (i < first || i >= last) print line[i] }' \
  campaigns/benchmark.toml >"$dir/ramps.toml"

for n in $seeds; do
  if is_wanted benchmark-$n; then
    benchmark_set
    ablate_campaign benchmark-$n "$dir/short.toml" ${n}1000
  fi
done

if is_wanted loop-given; then
  given_set
  ablate loop-given LV1 "$data"/closed-loop/loop_*.csv
fi

# Fifteen faults of two strengths on an onboarded valve in its level loop.
for n in $seeds; do
  is_wanted loop-own-$n || continue
  own_set
  seed=${n}7400
  files=()
  for fault in f1 f2 f3 f4 f6 f7 f10 f11 f12 f12- f13 f16 f17 f18 f19; do
    for strength in .35 .7; do
      seed=$((seed + 1))
      case $fault in *-) s=-$strength ;; *) s=$strength ;; esac
      name=own-$n-${fault%-}=$s
      simulate "$name" $seed 2400 "${level_loop[@]}" \
        --fault "${fault%-}:abrupt@1200:strength=$s"
      files+=("$dir/runs/$name.csv")
    done
  done
  ablate loop-own-$n own "${files[@]}"
done

# Faults that a set of five does not know (bench/untrained.sh): the paper's set
# and the onboarded valve's.
untrained=(f2 f4 f5 f9 f10 f11 f12 f12- f13 f13- f15 f16 f17 f17- f18 f19- t1 t1-
  p1 p1- p2 p2-)
for n in $seeds; do
  if is_wanted untrained-paper-$n; then
    once paper "$bin/fdi-trainer" train --campaign campaigns/paper.toml
    files=()
    for fault in "${untrained[@]}"; do
      for strength in .3 .6; do
        case $fault in *-) s=-$strength ;; *) s=$strength ;; esac
        name=paper-$n-${fault%-}=$s
        simulate "$name" ${n}5200 600 --parameters paper-operating-point \
          --excitation operating-point --set excitation.amplitude_pct=12 \
          --set excitation.period_s=60 \
          --fault "${fault%-}:abrupt@200:strength=$s"
        files+=("$dir/runs/$name.csv")
      done
    done
    ablate untrained-paper-$n paper "${files[@]}"
  fi
  if is_wanted untrained-own-$n; then
    own_set
    once five "$bin/fdi-study" reduce own --as five --without \
      "f8,$(printf '%s\n' "${untrained[@]}" | grep -v -- - | paste -sd,)"
    files=()
    for fault in "${untrained[@]}"; do
      for strength in .3 .6; do
        case $fault in *-) s=-$strength ;; *) s=$strength ;; esac
        name=untrained-$n-${fault%-}=$s
        simulate "$name" ${n}5300 1200 "${level_loop[@]}" \
          --fault "${fault%-}:abrupt@600:strength=$s"
        files+=("$dir/runs/$name.csv")
      done
    done
    ablate untrained-own-$n five "${files[@]}"
  fi
  if is_wanted untrained-benchmark-$n; then
    benchmark_set
    once seven "$bin/fdi-study" reduce benchmark --as seven --without \
      f2,f5,f9,f10,f11,f12,f13,f15,f16,f17
    files=()
    for fault in f2 f5 f9 f10 f11 f12 f12- f13 f13- f15 f16 f17; do
      for strength in .3 .6; do
        case $fault in *-) s=-$strength ;; *) s=$strength ;; esac
        name=open-$n-${fault%-}=$s
        simulate "$name" ${n}5400 2100 "${open_loop[@]}" \
          --fault "${fault%-}:abrupt@900:strength=$s"
        files+=("$dir/runs/$name.csv")
      done
    done
    ablate untrained-benchmark-$n seven "${files[@]}"
  fi
  if is_wanted paper-$n; then
    once paper "$bin/fdi-trainer" train --campaign campaigns/paper.toml
    ablate_campaign paper-$n campaigns/paper.toml ${n}1000 paper
  fi
done

# A second fault 600 s after the first (bench/second_fault.sh).
pairs=(f13=.2,f1=.5 f13=.2,f2=.5 f13=.2,f7=.5 f13=.2,f4=.6 f19=-.3,f1=.5
  f19=-.3,f7=.5 f19=-.3,f4=.6 f1=.5,f19=-.3 f2=.5,f13=.2 f7=.5,f13=.2
  f4=.6,f19=-.3 f3=.6,f13=.2)
for n in $seeds; do
  is_wanted pairs-$n || continue
  benchmark_set
  files=()
  for i in "${!pairs[@]}"; do
    first=${pairs[i]%,*}
    second=${pairs[i]#*,}
    name=pair-$n-${first%=*}-${second%=*}
    simulate "$name" $((n * 10000 + 7700 + i)) 2700 "${open_loop[@]}" \
      --fault "${first%=*}:abrupt@900:strength=${first#*=}" \
      --fault "${second%=*}:abrupt@1500:strength=${second#*=}"
    files+=("$dir/runs/$name.csv")
  done
  ablate pairs-$n benchmark "${files[@]}"
done

# Without fault: hours of both loops, four given days under the sine (two of
# them drift).
if is_wanted healthy; then
  own_set
  files=()
  for n in 1 2 3; do
    simulate healthy-$n $((5900 + n)) 28800 "${level_loop[@]}"
    files+=("$dir/runs/healthy-$n.csv")
  done
  ablate healthy own "${files[@]}"
fi
if is_wanted days; then
  benchmark_set
  ablate days benchmark "$data"/fault-free-days/*.csv
fi

for n in $seeds; do
  if is_wanted ramps-$n; then
    benchmark_set
    ablate_campaign ramps-$n "$dir/ramps.toml" ${n}1000
  fi
done

# Faults of X that grow over a day, which are a drift at first.
for n in $seeds; do
  is_wanted slow-$n || continue
  benchmark_set
  seed=${n}9100
  files=()
  for fault in f9 f10 f11 f12; do
    seed=$((seed + 1))
    name=slow-$n-$fault
    simulate "$name" $seed 87300 "${open_loop[@]}" \
      --fault "$fault:incipient@900+86400:strength=1"
    files+=("$dir/runs/$name.csv")
  done
  ablate slow-$n benchmark "${files[@]}"
done

# Faults that grow over three days: an episode that is long, for `lasting`.
for n in $seeds; do
  is_wanted days-long-$n || continue
  benchmark_set
  seed=${n}6100
  files=()
  for fault in f2 f3 f6 f19; do
    seed=$((seed + 1))
    name=long-$n-$fault
    simulate "$name" $seed 260100 "${open_loop[@]}" \
      --fault "$fault:incipient@900+259200:strength=1"
    files+=("$dir/runs/$name.csv")
  done
  ablate days-long-$n benchmark "${files[@]}"
done

# Flow that is lost with the pressure, in four seconds, while the command is
# what it was; and a trim that fills until next to nothing passes.
for n in $seeds; do
  is_wanted lost-flow-$n || continue
  own_set
  files=()
  for share in .01 .03 .1; do
    awk -F, -v OFS=, -v share=$share '
      NR > 1 && $1 > 1200 { away = $1 > 1204 ? 1 : ($1 - 1200) / 4
        $3 = $4 + (1 - away * (1 - share)) * ($3 - $4) }
      { print $1, $2, $3, $4, $5, $6, $7 }' <(head -n 2402 \
      "$dir/runs/own-healthy.csv") >"$dir/pump-$share.in"
    simulate "pump-$n-$share" 3${n}000 2400 \
      --excitation "csv:$dir/pump-$share.in"
    files+=("$dir/runs/pump-$n-$share.csv")
  done
  for k in 1 2; do
    simulate grown-$n-$k 3${n}10$k 9000 "${level_loop[@]}" \
      --fault f2:incipient@900+5400:strength=1
    files+=("$dir/runs/grown-$n-$k.csv")
  done
  ablate lost-flow-$n own "${files[@]}"
  once three "$bin/fdi-trainer" onboard --valve three --no-coverage \
    --signals CV,X,F --file "$dir/runs/own-healthy.csv"
  ablate three-lost-flow-$n three "${files[@]}"
done

# Valves whose physics is 15 % off the data sheet that onboarding starts from
# (bench/set_calibration.sh), so that effects are off by a share.
n=0
for off in trim.kv_m3_h=102 trim.kv_m3_h=138 positioner.gain=85 \
  actuator.supply_pressure_gauge_pa=510e3; do
  n=$((n + 1))
  is_wanted perturbed-$n || continue
  valve=(--excitation level-loop --set "parameters.$off")
  seed=$((93000 + 100 * n + shift))
  simulate perturbed-healthy-$n $seed 7200 "${valve[@]}"
  once perturbed-$n "$bin/fdi-trainer" onboard --valve perturbed-$n \
    --no-coverage --file "$dir/runs/perturbed-healthy-$n.csv"
  files=()
  for fault in f1=.6 f2=.35 f2=.85 f3=.4 f3=.9 f4=.6 f5=.85 f6=.35 f7=.6 f10=.4 \
    f11=.85 f12=.65 f13=.2 f13=-.4 f15=.35 f16=.6 f17=.35 f18=.35 f19=.2 f19=-.35; do
    seed=$((seed + 1))
    simulate "perturbed-$n-$fault" $seed 2400 "${valve[@]}" \
      --fault "${fault%%=*}:abrupt@1200:strength=${fault#*=}"
    files+=("$dir/runs/perturbed-$n-$fault.csv")
  done
  ablate perturbed-$n perturbed-$n "${files[@]}"
done

# Columns with looks: the given loop; weak faults, which the observers name now
# and then; and a valve with 500 N of friction that is known without its
# pressures.
if is_wanted loop-looks; then
  given_set
  ablate loop-looks "LV1 --second-look" "$data"/closed-loop/loop_*.csv
fi
for n in $seeds; do
  is_wanted weak-looks-$n || continue
  own_set
  seed=${n}8400
  files=()
  for fault in f1 f2 f3 f4 f6 f10 f12 f13 f18 f19; do
    seed=$((seed + 1))
    name=weak-$n-$fault
    simulate "$name" $seed 3600 "${level_loop[@]}" \
      --fault "$fault:abrupt@1200:strength=.12"
    files+=("$dir/runs/$name.csv")
  done
  ablate weak-looks-$n "own --second-look" "${files[@]}"
done
for n in $seeds; do
  is_wanted friction-looks-$n || continue
  friction=("${level_loop[@]}" --set parameters.actuator.coulomb_friction_n=500)
  simulate friction-healthy 5301 7200 "${friction[@]}"
  once friction "$bin/fdi-trainer" onboard --valve friction --no-coverage \
    --signals CV,X,F --file "$dir/runs/friction-healthy.csv"
  files=()
  for fault in f1=.6 f4=.6 f12=.65 f15=.35 f16=.6 f18=.35; do
    simulate "friction-$n-$fault" ${n}2000 2400 "${friction[@]}" \
      --fault "${fault%=*}:abrupt@1200:strength=${fault#*=}"
    files+=("$dir/runs/friction-$n-$fault.csv")
  done
  ablate friction-looks-$n "friction --second-look" "${files[@]}"
done

# Recordings of others: real events of actuator 3; single bad readings, a start
# and faults of the collection cases-4.
if is_wanted real; then
  once A3 "$bin/fdi-trainer" onboard --valve A3 --no-coverage \
    --file "$data/plant/lublin_actuator3_2001-10-11_first40min.csv"
  ablate real A3 "$data"/real-faults/*.csv
fi
if is_wanted spikes; then
  given_set
  ablate spikes LV1 "$data/cases-4/p15_flow_spikes.csv.gz"
fi
if is_wanted starts; then
  once REF "$bin/fdi-trainer" onboard --valve REF --no-coverage \
    --map "$data/cases-4/p_map_1s.toml" \
    --file "$data/cases-4/p01_same_at_1s.csv.gz"
  ablate starts "REF --map $data/cases-4/p_map_1s.toml" \
    "$data"/cases-4/{p01_same_at_1s_leak.csv,p01_same_at_1s_flowmeter.csv} \
    "$data"/cases-4/{p17_start_after_shutdown.csv.gz,p24_position_transmitter_6pct.csv}
fi

mkdir -p docs/results
quietly "$bin/fdi-study" ablate --parts "$dir/parts" \
  --table docs/results/ablation.md
cat "$dir/out"
