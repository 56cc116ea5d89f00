#!/usr/bin/env bash
# The samples of a runs.db by SQL (fdi_samples.so), with the sqlite3 shell and
# with Python, are those of `runs export`, the hours of health in a history.db are
# those of `fdi-store health`; what cannot be read is an SQL error.
# Skipped (77) without the sqlite3 shell.
# Usage: samples_module.sh BUILD_DIRECTORY
set -euo pipefail
build=$(cd "$1" && pwd)
tests=$(cd "$(dirname "$0")" && pwd)
command -v sqlite3 >/dev/null || exit 77
folder=$(mktemp -d)
monitor=
trap '[ -z "$monitor" ] || kill "$monitor" || true; rm -rf "$folder"' EXIT
cd "$folder"
fail() {
  echo "samples_module: $*" >&2
  exit 1
}
export FDI_DATA=$folder
simulate() {
  "$build/bin/fdi-simulator" run --no-publish --record --log-level error \
    --valve "$1" --start "$2T10:00:00Z" --duration "$3" >/dev/null
}
simulate FV-101 2026-01-05 3000
simulate FV-101 2026-01-06 100
simulate FV-102 2026-01-05 700
fdi_store() { "$build/bin/fdi-store" "$@"; }
sql() {  # FILE STATEMENT
  sqlite3 -readonly -bail "$1" ".load $build/lib/fdi_samples" "$2"
}
expect() {  # RESULT STATEMENT
  local result
  result=$(sql runs.db "$2") || fail "$2"
  [ "$result" = "$1" ] || fail "$2: $result instead of $1"
}
refuses() {  # FILE WORDS STATEMENT
  if sql "$1" "$3" >out.txt 2>&1; then
    fail "$1: $3 succeeds"
  fi
  grep -q "$2" out.txt || fail "$1: $3: $(cat out.txt)"
}

# All samples, and each constraint that chunks are chosen by.
expect 3800 "select count(*) from sample"
expect 3800 "select count(distinct rowid) from sample"
expect 3100 "select count(*) from sample where valve_id = 'FV-101'"
expect 3800 "select count(*) from sample where valve_id glob 'FV-1*'"
expect 800 "select count(*) from sample where valve_id in ('FV-102', 'x')
  or utc > '2026-01-06'"
expect 100 "select count(*) from sample where utc >= '2026-01-06'"
expect 0 "select count(*) from sample where utc < '2026-01-05T10:00:00'"
expect 1 "select count(*) from sample where valve_id = 'FV-101'
  and utc = '2026-01-05T10:30:00.000Z'"
expect 21 "select count(*) from sample where valve_id = 'FV-102' and stamp_ns
  between (strftime('%s', '2026-01-05T10:09:50')) * 1000000000
  and (strftime('%s', '2026-01-05T10:10:10')) * 1000000000"
expect 700 "select count(*) from sample s join run r on s.run_id = r.id
  where r.valve_id = 'FV-102'"
expect 0 "select count(*) from sample where stamp_ns > 'text' or valve_id = 7"
expect "GOOD|AUTO|t/h|1|1" "select distinct quality, mode, flow_unit, sp is null,
  f is not null from sample"

# Bit for bit what the export writes.
run=$(sqlite3 -readonly runs.db \
  "select id from run where valve_id = 'FV-101' order by start_ns limit 1")
fdi_store runs export "$run" --stamps -o export.csv
head -n 1 export.csv | grep -q ',stamp_ns,utc$' || fail "no stamps"
compare='
import csv, sqlite3, sys
con = sqlite3.connect("file:runs.db?mode=ro", uri=True)
con.enable_load_extension(True)
con.load_extension(sys.argv[1])
rows = con.execute("select stamp_ns, cv, p1, p2, t1, x, f from sample"
                   " where run_id = ?", (sys.argv[2],)).fetchall()
with open("export.csv") as file:
    expected = [tuple([int(r["stamp_ns"])] + [float(r[k]) for k in (
        "CV_pct", "P1_kPa", "P2_kPa", "T1_degC", "X_pct", "F_t_h")])
        for r in csv.DictReader(file)]
assert len(rows) == 3000 and rows == expected, rows[:1] + expected[:1]
'
# Not every Python can load extensions; Debian's can.
python=
for each in /usr/bin/python3 python3; do
  ! "$each" -c 'import sqlite3
sqlite3.Connection.enable_load_extension' 2>/dev/null || python=${python:-$each}
done
if [ -n "$python" ]; then
  "$python" -c "$compare" "$build/lib/fdi_samples.so" "$run" || fail "$python"
else
  echo "samples_module: no Python that can load extensions"
fi
# The columns that an export adds for people do not disturb an import.
fdi_store --data again runs import export.csv --valve FV-101 >/dev/null
fdi_store --data again runs export last --stamps -o again.csv
cut -d, -f1-7 export.csv | cmp - <(cut -d, -f1-7 again.csv) || fail "import"

# Beside another database.
sqlite3 other.db "create table t (a)"
sql other.db "attach 'runs.db' as runs; select count(*) from sample" |
  grep -qx 3800 || fail "attached"

# Queries and files that cannot be.
refuses other.db 'none of the open databases is a runs.db' \
  "select * from sample"
refuses runs.db 'no such column' "select pressure from sample"
refuses runs.db 'may not be modified' "delete from sample"
cp runs.db later.db
sqlite3 later.db "pragma user_version = 99"
refuses later.db 'has version 99' "select * from sample"
cp runs.db damaged.db
sqlite3 damaged.db "update chunk set bytes = substr(bytes, 1, 50)
  where first = 600"
refuses damaged.db "run $run, chunk of sample 600 is damaged" \
  "select count(x) from sample"
sql damaged.db "select count(*) from sample where valve_id = 'FV-101'
  and utc < '2026-01-05T10:09:00'" | grep -qx 540 ||
  fail "a damaged chunk spoils others"
echo garbage >garbage.db
refuses garbage.db 'not a database' "select * from sample"

# The hours of health that a monitor makes of two valves.
if grep -q '^FDI_PLANNER:BOOL=OFF' "$build/CMakeCache.txt"; then
  echo "samples_module: as exported, without hours of health"
  exit
fi
source "$tests/domain.sh"
"$build/bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" \
  --activate >/dev/null 2>train.log || fail "$(cat train.log)"
"$build/bin/fdi-monitor" --domain "$domain" run >monitor.log 2>&1 &
monitor=$!
timeout 30 sh -c 'until grep -q monitor_ready monitor.log; do sleep 0.05; done' ||
  fail "$(cat monitor.log)"
"$build/bin/fdi-simulator" --domain "$domain" run --valve LV --count 2 \
  --parameters paper-operating-point --fault f19:abrupt@3000:strength=0.5 \
  --duration 7500 --speed max --log-level error >/dev/null
kill "$monitor"
wait "$monitor" || fail "the monitor ended with $?"
monitor=
for valve in LV-1 LV-2; do
  fdi_store health --valve "$valve" --hourly --json >"$valve.json"
done
health='
import json, sqlite3, sys
con = sqlite3.connect("file:history.db?mode=ro", uri=True)
con.enable_load_extension(True)
con.load_extension(sys.argv[1])
names = set()
for valve in "LV-1", "LV-2":
    for hour in json.load(open(valve + ".json"))["hours"]:
        rows = con.execute("select name, part, cv_from, samples, value from"
                           " health_hour_value where valve_id = ? and hour_utc = ?"
                           " and model_hash = ?", (valve,
                           hour["hour_utc"][:19] + "Z", hour["model_hash"])).fetchall()
        assert len(rows) > 12, (valve, hour)
        bins = {(c["signal"], b["cv_from"]): b for c in hour["channels"] for b in c["bins"]}
        assert len([r for r in rows if r[0] == "residual"]) == len(bins)
        faults = {s["fault"]: s for s in hour["strengths"]}
        for name, part, cv_from, samples, value in rows:
            names.add(name)
            if name == "reading":
                continue
            expected = (bins[part, cv_from]["mean"] if name == "residual" else
                        bins[part, cv_from]["rms"] if name == "residual_rms" else
                        faults[part]["strength"] if name == "strength" else hour[name])
            assert abs(value - expected) <= 1e-5 * abs(expected), (name, value, expected)
            if name.startswith("residual"):
                assert samples == bins[part, cv_from]["samples"]
assert {"residual", "reading", "strength", "d0", "seen_h"} <= names, names
'
if [ -n "$python" ]; then
  "$python" -c "$health" "$build/lib/fdi_samples.so" || fail "$python"
fi
same() {  # TWO STATEMENTS on history.db
  local one two
  one=$(sql history.db "$1") && two=$(sql history.db "$2") || fail "$1"
  [ -n "$one" ] && [ "$one" = "$two" ] || fail "$1: $one, but $two"
}
same "select valve_id, hour_utc, round(sum(value), 6) from health_hour_value
    where name = 'live_h' group by 1, 2 order by 1, 2" \
  "select valve_id, hour_utc, round(hours, 6) from judged_hours order by 1, 2"
all="select count(*) from health_hour_value"
same "$all" "select count(distinct rowid) from health_hour_value"
same "$all" "$all where valve_id glob 'LV-*' or hour_utc > '2000-01-01'"
same "$all" "select count(*) from health_hour_value v join judged_hours j
  on v.valve_id = j.valve_id and v.hour_utc = j.hour_utc"
same "select 0" "$all where valve_id = 'FV-101' or hour_utc < '2026-01-01'"
refuses runs.db 'none of the open databases is a history.db' "$all"
refuses history.db 'may not be modified' "delete from health_hour_value"
cp history.db damaged.db
sqlite3 damaged.db "update health_hour set bytes = substr(bytes, 1, 9)
  where valve_id = 'LV-2'"
refuses damaged.db 'health of LV-2 is damaged: bytes are missing' "$all"
sql damaged.db "$all where valve_id = 'LV-1'" >/dev/null ||
  fail "a damaged hour spoils others"
echo "samples_module: as exported"
