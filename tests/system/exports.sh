#!/usr/bin/env bash
# A record of a valve as historians and spreadsheets export it: what onboarding
# and diagnosis make of each form, beside the record itself (docs/import.md).
# The record is that of the plant in FDI_REFERENCE_DATA; the fault is put onto
# the last sixth of it.
# Usage: exports.sh FOLDER-OF-PROGRAMS [all|FORM...]
#   by default the spreadsheet alone; all prints the table of docs/results/onboarding.md
#   77 without the record
set -euo pipefail
[ -n "${FDI_REFERENCE_DATA:-}" ] || {
  echo "exports: skipped, FDI_REFERENCE_DATA is not set"
  exit 77
}
tests=$(cd "$(dirname "$0")" && pwd)
source "$tests/programs.sh" "$1"
shift
[ "${1:-}" != all ] ||
  set -- record spreadsheet long 5s 10s swinging-door
zone=Europe/Warsaw
healthy=1500  # Seconds that are learnt from.
begin=2000    # The faults begin here.
faults=(f18:abrupt@$begin:strength=0.25 f19:abrupt@$begin:strength=0.25
  t1:abrupt@$begin:strength=0.1)
[ $# -gt 0 ] || {
  set -- spreadsheet
  faults=("${faults[0]}")
}

cp "$FDI_REFERENCE_DATA"/plant/lublin_actuator3_2001-10-11_first40min.csv \
  healthy.csv
for fault in "${faults[@]}"; do
  "$bin/fdi-study" inject --file healthy.csv --fault "$fault" \
    -o "${fault%%:*}.csv" >inject.log 2>&1 || fail "inject fails"
done

# RECORD, FORM: what the plant's people would have exported, to stdout.
export_as() {
  [ "$2" != record ] || { cut -d, -f1-7 "$1"; return; }
  awk -v form="$2" -f "$tests/exports.awk" "$1"
}
# VALUE of a query over a JSON file.
json() {  # FILE SQL
  sqlite3 :memory: "with d as (select cast(readfile('$1') as text) as d) $2"
}

printf '%-14s %8s %8s %8s' form 'X %' 'F t/h' 'F(CV)'
for fault in "${faults[@]}"; do printf '  %-16s' "${fault%%:strength*}"; done
echo
for form in "$@"; do
  export_as healthy.csv "$form" >export.csv
  map=()
  if [ "$form" != record ]; then
    "$bin/fdi-store" runs sniff export.csv --zone $zone -o tags.toml \
      >sniff.log 2>&1 || fail "sniff refuses $form"
    # Sizes do not tell it: a tag without unit may be gauge or absolute.
    sed -i 's/^unit = "bar"$/unit = "bar g"/' tags.toml
    map=(--map tags.toml)
  fi
  "$bin/fdi-trainer" onboard --valve "$form" --file export.csv@0:$healthy \
    "${map[@]}" --no-coverage --json >onboarded.json 2>onboard.log || {
    [ "$form" != spreadsheet ] || fail "onboarding refuses $form"
    printf '%-14s refused: %s\n' "$form" \
      "$(sed -n 's/^fdi-trainer: error: \(.*\)\. Check.*/\1/p' onboard.log)"
    continue
  }
  printf '%-14s' "$form"
  json onboarded.json "select printf(' %8.3f %8.3f %8.3f',
    max(iif(c = 'X', e, 0)), max(iif(c = 'F', e, 0)),
    max(iif(c = 'F(CV)', e, 0)))
    from (select value ->> 'channel' as c, value ->> 'rmse' *
        iif(value ->> 'unit' = 'm3/h', 0.9584, 1) as e
      from d, json_each(d.d, '\$.fit'))" | tr -d '\n'
  for fault in "${faults[@]}"; do
    name=${fault%%:*}
    export_as "$name.csv" "$form" >export.csv
    "$bin/fdi-study" evaluate --model-set "$form" \
      --file export.csv@$healthy: "${map[@]}" --no-second-look \
      --vectors vectors.csv --json >evaluated.json 2>evaluate.log ||
      fail "evaluating refuses $form"
    printf '  %-16s' "$(awk -F, -v begin=$begin -v healthy=$healthy '
      NR == 1 {for (i = 1; i <= NF; ++i) column[$i] = i; next}
      NR == 2 {first = $column["stamp_ns"]}
      {t = ($column["stamp_ns"] - first) / 1e9 + healthy - begin}
      t >= 0 && !detected && $column["state"] != "NORMAL" {
        detected = 1; printf "%.0f", t}
      t >= 0 && !isolated && $column["state"] == "ISOLATED" {
        isolated = 1; printf " %.0f", t}' vectors.csv) $(json evaluated.json \
      "select group_concat(value, '|') from
       d, json_each(d.d, '\$.runs[0].final_set')")"
  done
  echo
done

# A healthy loop whose command moves by some per cent every second: what is drawn
# between its readings is wrong by as much, and is not judged.
"$bin/fdi-simulator" run --no-publish --duration 1500 --seed 31 \
  --excitation level-loop -o loop.csv --log-level error >/dev/null
"$bin/fdi-trainer" onboard --valve loop --file loop.csv --no-coverage \
  >onboard.log 2>&1 || fail "onboarding refuses the loop"
awk -v form=spreadsheet -f "$tests/exports.awk" loop.csv >export.csv
"$bin/fdi-store" runs sniff export.csv --zone $zone -o loop.toml \
  >sniff.log 2>&1 || fail "sniff refuses the loop"
sed -i 's/^unit = "bar"$/unit = "bar g"/' loop.toml
"$bin/fdi-study" evaluate --model-set loop --file export.csv --map loop.toml \
  --no-second-look --vectors vectors.csv >evaluate.log 2>&1 ||
  fail "evaluating refuses the loop"
awk -F, 'NR == 1 {for (i = 1; i <= NF; ++i) column[$i] = i; next}
  $column["quality"] == "LIVE" {++judged}
  $column["state"] != "NORMAL" {++alarms}
  END {exit alarms > 0 || judged < 1200}' vectors.csv ||
  fail "a healthy loop has an episode as a spreadsheet"

# The third command: as live data, into an episode.
[ "$form" != record ] || exit 0
start --model-set "$form"
name=${faults[0]%%:*}
export_as "$name.csv" "$form" >export.csv
timeout 60 "$bin/fdi-simulator" --domain "$domain" replay --valve LC51_03 \
  --file export.csv --map tags.toml --split-gaps --speed max >simulator.log 2>&1 ||
  fail "the replay fails"
stop
found=$(history "select fault from fault_history where valve_id = 'LC51_03'")
# Where samples are missing, f13 may stay beside the two.
case $found in
  "f6|f18" | "f6|f13|f18") ;;
  *) fail "found '$found', not one episode of f6|f18" ;;
esac
echo "exports: $form replayed: $found"
