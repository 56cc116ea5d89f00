#!/usr/bin/env bash
# Scores all methods on all data and writes docs/results/table.md and table.csv:
# what each layer of ours buys, and what well-known detectors find with limits
# for the same rate of false alarms, from the same healthy hours. The data
# benchmark, loop, loop-hours and given-days need FDI_REFERENCE_DATA.
# bench/baselines.py needs Debian's python3-sklearn and python3-numpy; a row whose
# package is missing is skipped by name.
#
# DIR keeps what is made, and a run that was stopped goes on there; parts that
# are named later join the page. It belongs to one commit. One process at a time;
# everything takes about an hour and a half of CPU.
#
#     bench/table.sh [OPTION...] build/release/bin DIR [PART...]
#
# PART: data (paper benchmark untrained loop own loop-hours own-hours open-hours
# given-days), and what is done with those that are named:
#   second       simulated data with other seeds
#   curves       other rates of false alarms: CURVES=, their methods
#   retrainings  sets that were trained again from other random starts
#   real         records of real valves (bench/real_data.py)
# METHODS="ours pca": these alone.
#
# --quick: without ramps of a day and with a tenth of the healthy hours.
# --days N: healthy days of each kind (10).
# --retrainings N: 10.
# --seeds N: added to those of all simulated runs but the training of campaigns.
# -o FILE.md: the page.
set -euo pipefail
cd "$(dirname "$0")/.."
days=10
retrainings=10
quick=""
seeds=0
page=docs/results/table.md
while [[ ${1:-} == -* ]]; do
  case $1 in
    --quick) quick=1 days=1 ;;
    --days) days=$2; shift ;;
    --retrainings) retrainings=$2; shift ;;
    --seeds) seeds=$2; shift ;;
    -o) page=$2; shift ;;
    *) echo "table: no option $1" >&2; exit 2 ;;
  esac
  shift
done
bin=$(realpath "$1")
mkdir -p "$2"
dir=$(realpath "$2")
all=(paper benchmark untrained loop own loop-hours own-hours open-hours
  given-days second curves retrainings real)
wanted=("${@:3}")
[ ${#wanted[@]} -gt 0 ] || wanted=("${all[@]}")
for name in "${wanted[@]}"; do
  [[ " ${all[*]} " == *" $name "* ]] || {
    echo "table: no part $name; there are ${all[*]}" >&2
    exit 2
  }
  case $name in
    benchmark | loop* | *-days | real)
      : "${FDI_REFERENCE_DATA:?names the folder with closed-loop/}"
      ;;
  esac
done
data=${FDI_REFERENCE_DATA:-}
export FDI_DATA=$dir/data OMP_NUM_THREADS=1
mkdir -p "$dir"/{runs,models,parts,verdicts}

version="$("$bin/fdi-study" --version | head -n 1)${quick:+, quick}, $days days"
version+=", seeds +$seeds"
[ -f "$dir/version" ] || echo "$version" >"$dir/version"
[ "$(cat "$dir/version")" = "$version" ] || {
  echo "table: $dir is of $(cat "$dir/version"): name another folder" >&2
  exit 2
}

# These differ from the first pass over the data: `again` names the runs of
# second seeds, `variant` the sets of another rate or another training.
again=""
variant=""
wanted_rate=""
clustering_seed=""
# Seeds that no other study has; those from 200000000 on are for the next release.
second_seeds=40000000

TIMEFORMAT="%U %S"

# Runs a command once, and notes its CPU time. With exit code 77 there will be no
# such thing; why is the last line of its output.
once() {  # NAME COMMAND...
  [ -f "$dir/$1" ] && return
  local code=0
  { time "${@:2}" >"$dir/out" 2>"$dir/log"; } 2>"$dir/time" || code=$?
  [ $code -eq 0 ] || [ $code -eq 77 ] || {
    cat "$dir/out" "$dir/log" >&2
    echo "table: ${*:2}: exit code $code" >&2
    exit 1
  }
  tail -n 1 "$dir/time" >"$dir/$1.cpu"
  if [ $code -eq 77 ]; then
    tail -n 1 "$dir/out" >"$dir/$1.skipped"
    return
  fi
  rm -f "$dir/$1.skipped"
  cp "$dir/out" "$dir/$1.tmp"
  mv "$dir/$1.tmp" "$dir/$1"
}

quietly() { "$@" >"$dir/out" 2>"$dir/log" || { cat "$dir/log" >&2; exit 1; }; }

simulate() {  # NAME SEED SECONDS OPTION...
  [ -f "$dir/runs/$1.csv" ] && return
  mkdir -p "$(dirname "$dir/runs/$1")"
  quietly "$bin/fdi-simulator" run --no-publish --seed $(($2 + seeds)) \
    --duration "$3" -o "$dir/runs/$1.tmp" "${@:4}"
  mv "$dir/runs/$1.tmp" "$dir/runs/$1.csv"
}

paper=(--parameters paper-operating-point --excitation operating-point
  --set excitation.amplitude_pct=12 --set excitation.period_s=60)
open=(--parameters lublin-actuator-3 --excitation sine
  --set continuous_inputs=true --set cold_start=true)
level=(--parameters lublin-actuator-3 --excitation level-loop)

# Trains the set of a campaign under another name, with lines of [training].
train() {  # CAMPAIGN NAME LINE...
  local options=()
  [ -z "$wanted_rate" ] || options=(--false-alarms-per-hour "$wanted_rate")
  awk '{ print } /^\[training\]/ { print more; done = 1 }
    END { if (!done) print "[training]\n" more }' \
    more="$(printf '%s\n' "${@:3}")" "campaigns/$1.toml" >"$dir/$2.toml"
  once "models/$2" "$bin/fdi-trainer" train --campaign "$dir/$2.toml" \
    --name "$2" "${options[@]}"
}

# The set of ours that a method takes, into `model`; none: it does not exist for
# the data. A fit by onboarding has no switch for its rules.
make_variant() {  # METHOD
  model=$set_name$variant
  [ "$1" != ours ] || return 0
  model+=-$1
  case $1 in
    linear)
      [ -f "campaigns/$set_name.toml" ] || { model="" && return; }
      train "$set_name" "$model" "min_rules = 1" "max_rules = 1" \
        "search_rules = 1"
      ;;
    *)
      once "models/$model" "$bin/fdi-study" reduce "$set_name$variant" \
        --as "$model" --without-parts "${1/observers/looks,floor}"
      ;;
  esac
}

make_set() {  # SET
  case $1 in
    paper | benchmark)
      train "$1" "$1$variant" \
        ${clustering_seed:+"clustering_seed = $clustering_seed"}
      ;;
    loop)
      once models/loop "$bin/fdi-trainer" onboard --valve loop --no-coverage \
        --file "$data/closed-loop/healthy_onboard.csv"
      ;;
    own*)
      simulate "$1-healthy" 11 7200 "${level[@]}"
      once "models/$1" "$bin/fdi-trainer" onboard --valve "$1" --no-coverage \
        --file "$dir/runs/$1-healthy.csv"
      ;;
  esac
}

# Writes the runs on which a set was trained into `training`.
training_of() {  # SET
  case $1 in
    paper)
      mkdir -p "$dir/runs/paper-training"
      if [ ! -f "$dir/runs/paper-training/made" ]; then
        # By content, not by id, for trees depend on the order of the runs.
        for id in $("$bin/fdi-store" runs list --valve PAPER --json |
          sed -n 's/.*"run_id": "\(.*\)".*/\1/p'); do
          quietly "$bin/fdi-store" runs export "$id" -o "$dir/run.csv"
          mv "$dir/run.csv" "$dir/runs/paper-training/$(
            md5sum "$dir/run.csv" | cut -c1-12).csv"
        done
        touch "$dir/runs/paper-training/made"
      fi
      training=("$dir"/runs/paper-training/*.csv)
      ;;
    benchmark) training=("$data"/valve-reference/sine_*.csv) ;;
    loop) training=("$data/closed-loop/healthy_onboard.csv") ;;
    own*) training=("$dir/runs/$1-healthy.csv") ;;
  esac
}

# The runs of each data set, into `files`; and the set that scores them.
hours() {  # DATA SEED OPTION...
  local n
  for n in $(seq "$days"); do
    simulate "$1$again/$n" $(($2 + n)) $((quick ? 28800 : 86400)) "${@:3}"
  done
  files=("$dir/runs/$1$again"/*.csv)
}
make_runs() {  # DATA
  local seed fault strength
  case $1 in
    paper)
      set_name=paper seed=90000
      for fault in f1:abrupt@50:strength=.5 f3:abrupt@50:strength=.5 \
        f6:abrupt@50:strength=.6 f7:abrupt@50:strength=.5 \
        f19:abrupt@50:strength=.5 f1:incipient@500+1200:from=.26:strength=.6 \
        f{3,6}:incipient@50+1650:strength=1 f7:incipient@50+210:strength=1 \
        f19:incipient@50+850:strength=1; do
        seed=$((seed + 1))
        simulate "paper$again/$fault" $seed 2000 "${paper[@]}" --fault "$fault"
      done
      ;;
    benchmark)
      set_name=benchmark seed=7000
      for fault in f{1,7,8,10,13,16,18}={.25,.5,.75} \
        f{12,14,19}=-{.25,.5,.75} f{2,11,15,17}=.75; do
        seed=$((seed + 1))
        simulate "benchmark$again/$fault" $seed 1501 "${open[@]}" \
          --fault "${fault%=*}:abrupt@900:strength=${fault#*=}"
      done
      for fault in f13+900 f{4,17}+3600 f{2,3,5,6,9,11,18}+86400; do
        seed=$((seed + 1))
        [ -z "$quick" ] || [ "${fault#*+}" -lt 86400 ] || continue
        case ${fault#*+} in
          900) seconds=2401 ;; 3600) seconds=5101 ;; *) seconds=85501 ;;
        esac
        simulate "benchmark$again/$fault" $seed $seconds "${open[@]}" \
          --fault "${fault%+*}:incipient@900+${fault#*+}:strength=1"
      done
      ;;
    untrained)
      set_name=paper seed=95200
      for fault in f{2,4,5,9,10,11,12,13,15,16,17,18}={.3,.6} \
        f{12,13,17,19}=-{.3,.6} {t1,p1,p2}={.3,-.3,.6,-.6}; do
        seed=$((seed + 1))
        simulate "untrained$again/$fault" $seed 600 "${paper[@]}" \
          --fault "${fault%=*}:abrupt@200:strength=${fault#*=}"
      done
      ;;
    own)
      set_name=own$again seed=97400
      for fault in f{1,2,3,4,6,7,10,11,12,13,16,17,18,19}={.35,.7} \
        f12=-{.35,.7}; do
        seed=$((seed + 1))
        simulate "own$again/$fault" $seed 2400 "${level[@]}" \
          --fault "${fault%=*}:abrupt@1200:strength=${fault#*=}"
      done
      ;;
    loop) set_name=loop files=("$data"/closed-loop/loop_*.csv); return ;;
    loop-hours)
      set_name=loop files=("$data"/closed-loop/healthy_4h_*.csv)
      return
      ;;
    own-hours) set_name=own$again; hours own-hours 98000 "${level[@]}"; return ;;
    open-hours) set_name=benchmark; hours open-hours 98500 "${open[@]}"; return ;;
    given-days)
      set_name=benchmark files=("$data"/fault-free-days/*.csv)
      return
      ;;
  esac
  files=("$dir/runs/$1$again"/*.csv)
}

# False alarms an hour that the set of the data is trained for.
rate_of() {  # DATA
  case $1 in paper | untrained) echo 1e-4 ;; *) echo 1e-3 ;; esac
}

score() {  # DATA METHOD
  local part=$1$again$variant fitted=$set_name$variant-$2 runs=() rate file
  for file in "${files[@]}"; do runs+=(--file "$file"); done
  rate=${wanted_rate:-$(rate_of "$1")}
  case $2 in
    ours | observers | early | floor | looks | windows | linear)
      make_variant "$2"
      [ -z "$model" ] ||
        once "parts/$part/$2.csv" "$bin/fdi-study" evaluate --assume-normal \
          --csv --model-set "$model" "${runs[@]}"
      ;;
    arx-cusum | signature-table)
      once "parts/$part/$2.csv" "$bin/fdi-study" baseline "$2" --assume-normal \
        --csv --false-alarms-per-hour "$rate" \
        "${training[@]/#/--train-file=}" "${runs[@]}"
      ;;
    *)
      once "models/$fitted" bench/baselines.py fit "$2" --per-hour "$rate" \
        -o "$dir/models/$fitted.pickle" "${training[@]}"
      if [ -f "$dir/models/$fitted.skipped" ]; then
        cp "$dir/models/$fitted.skipped" "$dir/parts/$part/$2.csv.skipped"
        return
      fi
      once "verdicts/$part-$2" bench/baselines.py score \
        "$dir/models/$fitted.pickle" -o "$dir/verdicts/$part/$2" "${files[@]}"
      once "parts/$part/$2.csv" "$bin/fdi-study" verdicts --assume-normal --csv \
        "$(for file in "${files[@]}"; do
          echo "$dir/verdicts/$part/$2/$(basename "$file")"
        done | paste -sd,)" "${runs[@]}"
      ;;
  esac
}

score_all() {  # DATA METHOD...
  local method
  mkdir -p "$dir/parts/$1$again$variant"
  make_runs "$1"
  make_set "$set_name"
  training_of "$set_name"
  cat "${files[@]}" | wc -l >"$dir/parts/$1$again$variant/rows"
  for method in "${@:2}"; do
    score "$1" "$method"
    echo "$1$again$variant $method"
  done
}

# Those of the data that were named.
among() {  # DATA...
  local name
  for name in "$@"; do
    [[ " ${wanted[*]} " != *" $name "* ]] || echo "$name"
  done
}

read -ra methods <<<"${METHODS:-ours observers early floor looks windows linear \
  position pca forest boosted arx-cusum signature-table}"
read -ra curves <<<"${CURVES:-ours position pca forest boosted arx-cusum}"
for name in "${wanted[@]}"; do
  case $name in
    second)
      again=-second seeds=$((seeds + second_seeds))
      for one in $(among paper benchmark untrained own own-hours open-hours); do
        score_all "$one" "${methods[@]}"
      done
      again="" seeds=$((seeds - second_seeds))
      ;;
    curves)
      for wanted_rate in 1e-1 1e-2 1e-3 1e-4; do
        variant=-at$wanted_rate
        for one in $(among paper benchmark untrained open-hours); do
          [ "$wanted_rate" = "$(rate_of "$one")" ] ||
            score_all "$one" "${curves[@]}"
        done
      done
      variant="" wanted_rate=""
      ;;
    retrainings)
      for n in $(seq "$retrainings"); do
        variant=-training$n clustering_seed=$((1 + 100 * n))
        for one in $(among paper benchmark untrained); do
          score_all "$one" ours
        done
      done
      variant="" clustering_seed=""
      ;;
    real) once real bench/real_data.py "$bin" "$dir/real-data" ;;
    *) score_all "$name" "${methods[@]}" ;;
  esac
done
bench/table.py "$dir" "$page"
