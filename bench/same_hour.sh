#!/usr/bin/env bash
# The same hour of three valves by a file, by lines, by MQTT and by OPC UA, of
# which the last three say only what has changed (lines, OPC UA) or all tags in
# one message (MQTT): how many samples and episodes differ from those of the file.
# Usage: same_hour.sh FOLDER-OF-PROGRAMS NODE_MODULES     77 without mosquitto
set -euo pipefail
export LC_ALL=C
PATH=$PATH:/usr/sbin
modules=$(realpath "$2")
command -v mosquitto_pub >/dev/null || exit 77
tree=$(cd "$(dirname "$0")/.." && pwd)
source "$tree/tests/system/programs.sh" "$1"
module=$bin/../lib/fdi_samples
server= broker= gateway= client=
finish() {
  exec 2>/dev/null
  kill -9 $server $broker $gateway $client ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
valves="FV-101 FV-102 FV-103"
rows=3600 rate=60  # Rows a second by OPC UA.
port=$((16000 + domain))

"$bin/fdi-trainer" train --campaign "$tree/tests/survival/quick.toml" >/dev/null 2>train.log
simulate() {  # VALVE OPTIONS
  "$bin/fdi-simulator" run --no-publish --duration $rows --seed "${1#FV-}" --log-level error \
    --parameters paper-operating-point --set excitation.amplitude_pct=8 \
    --set excitation.period_s=80 -o "$1.csv" "${@:2}" >/dev/null
}
simulate FV-101 --fault f19:abrupt@1200:strength=0.5:until=2400
simulate FV-102
simulate FV-103 --fault f19:incipient@1800+600:strength=0.6
{
  printf '[defaults]\nop = "{loop}.OP"\nx = "{loop}.ZT"\nf = "{loop}.FT"\nf_unit = "m3/h"\n'
  printf 'p1 = "{loop}.P1"\np1_unit = "kPa"\np2 = "{loop}.P2"\np2_unit = "kPa"\n'
  printf 't1 = "{loop}.T1"\ntopic = "plant"\nvalue = "{tag}"\n'
  for valve in $valves; do printf '[[loop]]\nname = "%s"\n' "$valve"; done
} >plant.toml

# Each row is a second of a plant whose last one is of now; OPC UA has it so.
export PLANT_BEGAN_MS=$((($(date +%s) / 60 + 3) * 60000))
first=$((PLANT_BEGAN_MS / 1000 - (rows - rows / rate)))
# The readings of all valves, a row after the other: VALVE-TAG VALUE ...
readings() {
  awk -F, -v first=$first '
    BEGIN { split("CV_pct OP X_pct ZT F_m3_h FT P1_kPa P1 P2_kPa P2 T1_degC T1", w, " ")
      for (i = 1; i < 12; i += 2) tag[w[i]] = w[i + 1] }
    FNR == 1 { valve = substr(FILENAME, 1, 6); for (i = 1; i <= NF; ++i) name[i] = $i; next }
    { for (i = 1; i <= NF; ++i)
        if (name[i] in tag) row[FNR] = row[FNR] " " valve "." tag[name[i]] " " $i }
    END { for (n = 2; n <= FNR; ++n) print first + n - 2 row[n] }' FV-10[123].csv
}
# Prints the samples and episodes that the monitor has stored for LABEL.
keep() {
  stop
  sqlite3 -readonly "$FDI_DATA/runs.db" ".load $module" "select valve_id, stamp_ns, cv, p1, p2, t1, x, f
    from sample where valve_id glob 'FV-*'
    and stamp_ns between ${first}000000000 and $((first + rows - 1))000000000" | sort >"$1.samples"
  history "select valve_id, fault, detected_utc, isolated_utc, cleared_utc from fault_history
    " | sort >"$1.episodes"
  rm "$FDI_DATA"/{runs,history}.db*
  echo "$1: $(wc -l <"$1.samples") samples, of which" \
    "$(comm -13 file.samples "$1.samples" | wc -l) are not in the file's and" \
    "$(comm -23 file.samples "$1.samples" | wc -l) of those are missing;" \
    "$(wc -l <"$1.episodes") episodes, $(comm -13 file.episodes "$1.episodes" | wc -l) others"
}
begin() { start --record --model-set quick; }

begin
for valve in $valves; do
  awk -F, -v OFS=, -v first=$first 'NR > 1 { $1 += first } 1' "$valve.csv" >stamped.csv
  "$bin/fdi-simulator" --domain "$domain" replay --file stamped.csv --valve "$valve" \
    --keep-stamps --speed max >/dev/null 2>replay.log
done
keep file

begin
readings | awk '{ for (i = 2; i < NF; i += 2) if (last[$i] != $(i + 1))
    printf "{\"tag\":\"%s\",\"t\":%d,\"v\":%s}\n", $i, $1, last[$i] = $(i + 1)
  printf "{\"alive\":%d}\n", $1 }' |
  "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --lines - >totals.txt 2>lines.log
keep lines

printf 'listener %s 127.0.0.1\nallow_anonymous true\nuser %s\n' $port "$(id -un)" >broker.conf
mosquitto -c broker.conf >mosquitto.log 2>&1 &
broker=$!
begin
"$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --mqtt "mqtt://127.0.0.1:$port" \
  >totals.txt 2>mqtt.log &
gateway=$!
await 20 grep -q broker_connected mqtt.log
readings | perl -ne '$| = 1; my ($t, @rest) = split;
  print "{\"t\":$t"; printf ",\"%s\":%s", splice(@rest, 0, 2) while @rest;
  print "}\n"; select undef, undef, undef, 0.01' | mosquitto_pub -p $port -l -t plant
sleep 4
kill $gateway
wait $gateway
kill $broker
gateway= broker=
keep MQTT

cp "$tree/gateway/opcua/client.mjs" "$tree/tests/gateway/plant_server.mjs" .
ln -s "$modules" node_modules
begin
node plant_server.mjs $port 3 $rate FV-10[123].csv 2>server.log &
server=$!
await 60 grep -q ready server.log
FDI_GATEWAY=$bin/fdi-gateway node client.mjs plant.toml --endpoint "opc.tcp://127.0.0.1:$port" \
  --interval 0 2>client.log > >(exec "$bin/fdi-gateway" --domain "$domain" in \
    --plant plant.toml --lines - >totals.txt 2>opcua.log) &
client=$!
await 60 grep -q "18 of 18" client.log
[ "$(date +%s%3N)" -lt $PLANT_BEGAN_MS ] || fail "the hour began without the client"
await 400 grep -q "all rows" server.log
sleep 2
kill $client
wait $client
client=
sleep 3
keep OPC_UA
