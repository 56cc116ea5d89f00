#!/usr/bin/env bash
# The whole way of docs/learning.md with the built programs over DDS: a fault
# that the set does not know is recorded, labelled, learnt, compared and
# activated. Usage: learning.sh FOLDER-OF-PROGRAMS
set -euo pipefail
source "$(dirname "$0")/programs.sh" "$1"

expect() {  # WHAT FOUND WANTED
  [ "$2" = "$3" ] || fail "$1: $2, wanted $3"
}
# SQL over the columns value of what PATH holds in a JSON file.
json() {  # FILE PATH SQL
  sqlite3 :memory: "with j as (select * from json_each(
    cast(readfile('$1') as text), '$2')) $3"
}
publish() {  # SEED
  timeout 60 "$bin/fdi-simulator" --domain "$domain" run --scenario plant.toml \
    --seed "$1" --speed max >simulator.log 2>&1 || fail "the simulator fails"
  timeout 30 sh -c "until grep -q 'transition=CLOSED' monitor.log; do sleep 0.05; done" ||
    fail "the episode does not end"
}

common='parameters = "paper-operating-point"
excitation = {name = "operating-point", amplitude_pct = 8, period_s = 80}'
cat >campaign.toml <<TOML
name = "valve"
[training]
max_rules = 1
max_regressors = 2
starts = 1
[scenario]
$common
duration_s = 300
[[run]]
simulate = {duration_s = 900}
[[run]]
simulate = {}
faults = ["f19"]
strengths = [0.5]
TOML
cat >plant.toml <<TOML
valve = "LV-1"
$common
duration_s = 1200
faults = ["f1:abrupt@600:strength=0.5"]
TOML

"$bin/fdi-trainer" train --campaign campaign.toml >/dev/null 2>train.log
start
publish 77
stop
expect 'fault of the episode' \
  "$(history 'select fault from fault_history')" travel_deviation
episode=$(history 'select episode_id from fault_history')
"$bin/fdi-store" history label "$episode" f1 --by kim >/dev/null

"$bin/fdi-trainer" relearn "*" --strength "$episode=0.5" --json \
  >trained.json 2>train.log || fail "training fails"
expect 'lineage' "$(json trained.json '$.lineage.episodes' \
  "select value ->> 'episode_id', value ->> 'labelled_by', value ->> 'fault'
   from j")" "$episode|kim|f1"

others=()
for seed in 500 501 502 503 504 505; do
  "$bin/fdi-simulator" run --scenario plant.toml --seed $seed --speed max \
    --no-publish -o "$seed.csv" >simulator.log 2>&1 ||
    fail "the simulator fails"
  others+=(--file "$seed.csv")
done
"$bin/fdi-trainer" compare valve@1 valve@2 "${others[@]}" --json \
  >compared.json 2>compare.log || fail "comparing fails"
expect 'right by the parent, right by the new set, of' \
  "$(sqlite3 :memory: "select c ->> '\$.a.exact', c ->> '\$.b.exact',
    c ->> '\$.b.faulty_runs' from
    (select cast(readfile('compared.json') as text) as c)")" '0|6|6'
expect 'judgement' "$(json compared.json '$.measures' \
  "select value ->> 'judgement' from j
   where value ->> 'measure' = 'final set'")" 'valve@2 is better (p = 0.0313)'

start
publish 78
stop
expect 'what the new set says' \
  "$(history "select fault from fault_history where model_set = 'valve@2'")" f1
echo "learning: ok"
