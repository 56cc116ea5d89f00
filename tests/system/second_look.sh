#!/usr/bin/env bash
# A valve in its level loop, onboarded on a healthy hour: the monitor, fed over
# DDS, ends with the name that fdi-trainer evaluate gives the same samples, and
# the history says that a simulation of the valve gave it.
# Usage: second_look.sh FOLDER-OF-PROGRAMS
set -euo pipefail
source "$(dirname "$0")/programs.sh" "$1"

record() {  # FILE OPTIONS
  "$bin/fdi-simulator" run --no-publish --speed max --excitation level-loop \
    -o "$@" 2>simulator.log >&2 || fail "the simulator fails"
}

record healthy.csv --seed 31 --duration 3600
record faulty.csv --seed 32 --duration 600 --fault f3:abrupt@300:strength=0.6
"$bin/fdi-trainer" onboard --valve LV-1 --file healthy.csv --no-coverage \
  >onboard.log 2>&1 || fail "onboarding fails"
"$bin/fdi-trainer" evaluate --valve LV-1 --file faulty.csv --json \
  >evaluated.json 2>evaluate.log || fail "the evaluation fails"
wanted=$(sqlite3 :memory: "select group_concat(value, '|') from
  (select value from json_each(cast(readfile('evaluated.json') as text),
   '\$.runs[0].final_set') order by value)")

start
timeout 400 "$bin/fdi-simulator" --domain "$domain" replay --file faulty.csv \
  --valve LV-1 --speed 12 >simulator.log 2>&1 || fail "the simulator fails"
stop

found=$(history "select group_concat(name, '|') from
  (select value as name from episode, json_each('[\"' ||
   replace(fault, '|', '\",\"') || '\"]') order by value)")
[ "$found" = "$wanted" ] || fail "named $found, evaluated as $wanted"
[ "$(history 'select layer from episode')" = physics ] ||
  fail "named by $(history 'select layer from episode')"
[ "$(history "select count(*) from episode_event where layer = 'physics'")" -gt 0 ] ||
  fail "no event of the physics"
"$bin/fdi-store" history show last --json >shown.json
explained=$(sqlite3 :memory: "select group_concat(value ->> 'fault', '|')
  from json_each(cast(readfile('shown.json') as text), '\$.look.faults')")
[ "$(tr '|' '\n' <<<"$explained" | sort)" = "$(tr '|' '\n' <<<"$found" | sort)" ] ||
  fail "history show explains it by $explained, and names it $found"
echo "second_look: $found"
