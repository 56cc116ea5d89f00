#!/usr/bin/env bash
# Onboards a plant from one table: TYPES valve types with PER_TYPE valves each,
# and DATA_ONLY loops, SECONDS of each in one wide file. Measures the dry run of
# 1000 rows, time and memory of the whole, a second run, and a run that is killed
# and started again, whose model sets must be those of one run.
#
#     bench/plant_table.sh build/release/bin [TYPES [PER_TYPE [DATA_ONLY [SECONDS]]]]
set -euo pipefail
bin=$(realpath "$1")
types=${2:-10}
per_type=${3:-10}
data_only=${4:-200}
seconds=${5:-3600}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

# Columns of one simulated loop under the names of its tags.
simulate() {  # TAG SEED COLUMNS OPTION...
  local tag=$1 seed=$2 columns=$3
  shift 3
  "$bin/fdi-simulator" run --no-publish --speed max --excitation level-loop \
    --duration "$seconds" --seed "$seed" -o one.csv "$@" >/dev/null
  awk -F, -v tag="$tag" -v columns="$columns" '
    NR == 1 {
      n = split(columns, name, " ")
      for (i = 1; i <= n; ++i) {
        split(name[i], pair, "=")
        for (c = 1; c <= NF; ++c) if ($c == pair[2]) at[i] = c
        printf "%s%s.%s", (i > 1 ? "," : ""), tag, pair[1]
      }
      print ""
      next
    }
    { for (i = 1; i <= n; ++i) printf "%s%s", (i > 1 ? "," : ""), $at[i]
      print "" }' one.csv >"columns/$tag"
}

mkdir columns
{
  echo 'files = ["plant.csv"]'
  echo '[defaults]'
  for tag in op=OP pv=PV x=ZT p1=P1 p2=P2 t1=T1 sp=SP; do
    echo "${tag%=*} = \"{loop}.${tag#*=}\""
  done
  echo 'service = "F"'
  echo 'pv_unit = "t/h"'
} >plant.toml
valve='OP=CV_pct PV=F_t_h ZT=X_pct P1=P1_kPa P2=P2_kPa T1=T1_degC'
for ((t = 1; t <= types; ++t)); do
  printf 'base = "lublin-actuator-3"\n[trim]\nkv_m3_h = %d.0\n[positioner]\ngain = %d.0\n' \
    $((90 + 6 * t)) $((80 + 5 * t)) >"type-$t.toml"
  for ((v = 1; v <= per_type; ++v)); do
    name=FV$(printf '%02d%02d' "$t" "$v")
    simulate "$name" $((1000 * t + v)) "$valve" --parameters "type-$t.toml"
    printf '[[loop]]\nname = "%s"\ntype = "type-%d.toml"\ngroup = "unit %d"\n' \
      "$name" "$t" "$t" >>plant.toml
  done
done
# Twenty records serve all loops without a model.
for ((v = 1; v <= data_only; ++v)); do
  name=FIC$(printf '%04d' "$v")
  if [ "$v" -le 20 ]; then
    simulate "$name" $((900000 + v)) 'OP=CV_pct PV=F_t_h'
  else
    sed "1s/[^.,]*\./$name./g" \
      "columns/FIC$(printf '%04d' $((v % 20 + 1)))" >"columns/$name"
  fi
  printf '[[loop]]\nname = "%s"\n' "$name" >>plant.toml
done
cut -d, -f1 one.csv >time.csv
ulimit -n 4096
paste -d, time.csv columns/* >plant.csv
rows=$((types * per_type + data_only))
echo "$rows loops, $types types, $data_only data only, $(wc -c <plant.csv) bytes"

# Time, processor time and peak memory of a command:
# "label: S s, C s of CPU, M MB"; its seconds remain in $took.
TIMEFORMAT='%R %U %S'
measured() {  # LABEL COMMAND...
  local label=$1 peak=0 now pid status=0
  shift
  {
    time {
      "$@" >out.txt 2>err.txt &
      pid=$!
      while kill -0 "$pid" 2>/dev/null; do
        now=$(awk '/VmHWM/ { print $2 }' "/proc/$pid/status" 2>/dev/null || true)
        peak=${now:-$peak}
        sleep 0.2
      done
      wait "$pid" || status=$?
    }
  } 2>time.txt
  [ "$status" -eq 0 ] || { cat err.txt; return 1; }
  read -r took user system <time.txt
  awk -v label="$label" -v took="$took" -v user="$user" -v kernel="$system" \
    -v peak="$peak" 'BEGIN {
      printf "%s: %.1f s, %.1f s of CPU, %.0f MB\n", label, took,
             user + kernel, peak / 1024 }'
}
sets() {  # DATA: the sets that are assigned, by their content
  "$bin/fdi-store" --data "$1" models list --json |
    grep -oE '"(content_hash|name|model_set)": *"[^"]*"' | sort
}

# A thousand rows over the tags that are there.
head -17 plant.toml | sed '/\[\[loop\]\]/,$d' >thousand.toml
names=(columns/*)
for ((i = 0; i < 1000; ++i)); do
  tag=$(basename "${names[$((i % ${#names[@]}))]}")
  printf '[[loop]]\nname = "L%04d"\nop = "%s.OP"\npv = "%s.PV"\n' \
    "$i" "$tag" "$tag" >>thousand.toml
done
measured 'dry run of 1000 rows' "$bin/fdi-trainer" --data dry onboard \
  --plant thousand.toml --dry-run
measured 'all rows' "$bin/fdi-trainer" --data whole onboard --plant plant.toml
half=$(awk -v took="$took" 'BEGIN { print took / 2 }')
tail -3 out.txt
measured 'second run' "$bin/fdi-trainer" --data whole onboard --plant plant.toml
tail -1 out.txt

"$bin/fdi-trainer" --data killed onboard --plant plant.toml >/dev/null 2>&1 &
victim=$!
sleep "$half"
kill -9 "$victim" 2>/dev/null || true
wait "$victim" 2>/dev/null || true
measured 'after a kill' "$bin/fdi-trainer" --data killed onboard \
  --plant plant.toml
tail -1 out.txt
sets whole >whole.txt
sets killed | diff whole.txt - && echo 'killed and started again: the same sets'
