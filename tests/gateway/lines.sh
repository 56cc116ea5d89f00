#!/usr/bin/env bash
# Three valves by one gateway: the same samples from a file and from lines; a
# source that falls silent costs its valve alone; a table that is read again.
# Usage: lines.sh FOLDER-OF-PROGRAMS
set -euo pipefail
tests=$(cd "$(dirname "$0")/.." && pwd)
source "$tests/system/programs.sh" "$1"
gateway=
finish() {
  exec 2>/dev/null
  kill -9 ${gateway:-} ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
valves="V1 V2 V3"

"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" \
  >/dev/null 2>train.log
for valve in $valves; do
  "$bin/fdi-simulator" run --no-publish --duration 120 --seed "${valve#V}" \
    --parameters paper-operating-point -o "$valve.csv" --log-level error \
    >/dev/null
done
cat "$tests/gateway/defaults.toml" - >plant.toml <<'END'
[[loop]]
name = "V1"
[[loop]]
name = "V2"
[[loop]]
name = "V3"
[[loop]]
name = "V4"
x_unit = "furlong"
END
# The readings of rows FIRST to LAST from second START on, a line each.
readings() {  # FIRST LAST START VALVE...
  for valve in "${@:4}"; do
    awk -F, -v first="$1" -v last="$2" -v start="$3" -v valve="$valve" '
      NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; next }
      NR - 2 >= first && NR - 2 <= last {
        split("OP CV_pct ZT X_pct FT F_m3_h P1 P1_kPa P2 P2_kPa T1 T1_degC", w, " ")
        for (i = 1; i < 12; i += 2)
          printf "{\"tag\":\"%s.%s\",\"t\":%d,\"v\":%s,\"source\":\"plc-%s\"}\n",
            valve, w[i], start + NR - 2 - first, $at[w[i + 1]], valve
      }' "$valve.csv"
  done | sort -t: -s -k3,3
}
samples() {  # DATA: of all runs, by valve.
  for valve in $valves; do
    for run in $(sqlite3 -readonly "$1/runs.db" \
      "select id from run where valve_id = '$valve' order by first_stamp_ns"); do
      "$bin/fdi-store" --data "$1" runs export "$run"
    done
  done
}

! "$bin/fdi-gateway" --domain "$domain" out --lines no/such 2>out.log ||
  fail "out writes to a folder that is not there"
grep -q "no/such cannot be written: No such file" out.log || fail "$(cat out.log)"

# By file and by lines.
base=$(($(date +%s) - 7200))
for valve in $valves; do
  awk -F, -v OFS=, -v base=$base 'NR > 1 { $1 += base } 1' "$valve.csv" >file.csv
  cp file.csv "$valve.stamped.csv"
done
start --record --model-set quick
for valve in $valves; do
  "$bin/fdi-simulator" --domain "$domain" replay --file "$valve.stamped.csv" \
    --valve "$valve" --keep-stamps --speed max >/dev/null 2>replay.log
done
stop
samples "$FDI_DATA" >by_file.txt
rm "$FDI_DATA"/runs.db* "$FDI_DATA"/history.db*
start --record --model-set quick
readings 0 119 $base $valves |
  "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --lines - \
    >gateway.txt 2>gateway.log
stop
samples "$FDI_DATA" >by_lines.txt
[ "$(wc -l <by_file.txt)" -eq 363 ] || fail "$(wc -l <by_file.txt) lines by file"
cmp by_file.txt by_lines.txt || fail "other samples by lines than by file"
grep -q "row_refused valve=V4.*x_unit is" gateway.log || fail "V4 is not refused"
grep -q "^samples: *360" gateway.txt || fail "$(cat gateway.txt)"
rm "$FDI_DATA"/runs.db* "$FDI_DATA"/history.db*

# Live: V3 is silent from its sixth second on. The monitor reads one group.
sed -i '1s/$/\ngroup = "A"/' plant.toml
start --record --model-set quick --partition A
mkfifo pipe
"$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --by-group --lines pipe \
  >gateway.txt 2>live.log &
gateway=$!
exec 3>pipe
began=$(date +%s)
feed() {  # The readings up to now.
  local now
  now=$(($(date +%s) - began))
  for row in $(seq $((fed + 1)) $now); do
    readings "$row" "$row" $((began + row)) V1 V2 >&3
    [ "$row" -gt 5 ] || readings "$row" "$row" $((began + row)) V3 >&3
    fed=$row
  done
}
fed=-1
feed_until() {  # ROW
  while [ $fed -lt "$1" ]; do
    feed
    sleep 0.3
  done
}
feed_until 16
grep -q "source_silent name=plc-V3" live.log || fail "V3 is not said to be silent"
! grep -q "source_silent name=plc-V[12]" live.log || fail "V1 or V2 is silent"
await 20 grep -q "valve=V3.*missing_signal\|missing_signal.*valve=V3" monitor.log
! grep "missing_signal" monitor.log | grep -q "valve=V[12]" ||
  fail "V1 or V2 lacks signals"

# A table that is too long for the writers of the first one is refused.
mv plant.toml kept.toml
{
  cat kept.toml
  for i in $(seq 200); do printf '[[loop]]\nname = "W%d"\n' "$i"; done
} >plant.toml
kill -HUP $gateway
await 20 grep -q "table_refused.*203 valves.*room for 106" live.log
mv kept.toml plant.toml

# A valve less, one in another group, and the others go on.
sed -i '/"V2"/d; s/^name = "V4"/name = "V2"\ngroup = "B"\n[[loop]]\n&/' plant.toml
kill -HUP $gateway
await 20 grep -q "table_read.*refused=2" live.log
feed_until $((fed + 6))
exec 3>&-
wait $gateway || fail "the gateway ended with $?"
gateway=
stop
seen=$(sqlite3 -readonly "$FDI_DATA/runs.db" \
  "select group_concat(valve_id || ' ' || (samples > 12)) from
   (select valve_id, sum(samples) samples from run group by 1 order by 1)")
[ "$seen" = "V1 1,V2 1,V3 0" ] || fail "recorded: $seen"
last_of() {  # VALVE
  sqlite3 -readonly "$FDI_DATA/runs.db" \
    "select max(last_stamp_ns) / 1000000000 from run where valve_id = '$1'"
}
[ $(($(last_of V1) - $(last_of V2))) -ge 4 ] || fail "V2 is read beyond its group"
echo "lines: the same by file and by lines; V3 silent alone"
