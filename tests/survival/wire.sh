#!/usr/bin/env bash
# The plant's wire from end to end: an OPC UA server of a plant, the client, the
# gateways, the monitor, a broker and the OPC UA server of the findings are killed
# and stopped in turn, each at least once and for FDI_WIRE_SECONDS (default 60),
# while faults grow in every fourth of FDI_WIRE_VALVES valves (default 8) and
# alarms are acknowledged.
# While the plant or its client is away no valve is normal; at the end history,
# MQTT and OPC UA tell the same, and each acknowledgement is there once.
# Usage: wire.sh FOLDER-OF-PROGRAMS NODE_MODULES     77 without what it takes.
set -euo pipefail
PATH=$PATH:/usr/sbin
modules=$(realpath -m "$2")
for needed in node mosquitto mosquitto_sub; do
  command -v $needed >/dev/null || needed_is_missing=1
done
[ -z "${needed_is_missing:-}" ] && [ -d "$modules/node-opcua-server" ] || {
  echo "wire: skipped, no mosquitto, or npm has not fetched node-opcua"
  exit 77
}
tests=$(cd "$(dirname "$0")/.." && pwd)
source "$tests/system/programs.sh" "$1"
seconds=${FDI_WIRE_SECONDS:-60}
valves=${FDI_WIRE_VALVES:-8}
rate=$((seconds > 200 ? 2 : 10))  # Rows a second.
plant_port=$((16000 + domain)) port=$((15000 + domain)) mqtt_port=$((17000 + domain))
export FDI_GATEWAY=$bin/fdi-gateway FDI_STORE=$bin/fdi-store
declare -A part  # By name, the group of its processes.
finish() {
  exec 2>/dev/null
  for name in "${!part[@]}"; do
    kill -CONT -- "-${part[$name]}" || true
    kill -9 -- "-${part[$name]}" || true
  done
  rm -rf "$work"
}
trap finish EXIT
set -m
launch() {  # NAME: a group of processes that write NAME.log.
  "run_$1" >>"$1.log" 2>&1 &
  part[$1]=$!
}
kill_part() {
  kill -CONT -- "-${part[$1]}" 2>/dev/null || true
  kill -9 -- "-${part[$1]}" 2>/dev/null || true
  wait "${part[$1]}" 2>/dev/null || true
}

cp "$tests"/../gateway/opcua/*.mjs "$tests/gateway/plant_server.mjs" .
ln -s "$modules" node_modules
"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" >/dev/null 2>train.log
rows=$((rate * (seconds + 900)))
simulate() {  # FILE OPTIONS
  "$bin/fdi-simulator" run --no-publish --parameters paper-operating-point \
    --set excitation.amplitude_pct=8 --set excitation.period_s=80 \
    --duration "$rows" --log-level error -o "$@" >/dev/null
}
simulate healthy.csv --seed 7
tables=()
for i in $(seq "$valves"); do
  if [ $((i % 4)) -ne 1 ]; then
    tables+=(healthy.csv)
    continue
  fi
  # The last of them begins to grow after half of the time.
  begin=$((100 + i * seconds * rate / (2 * valves)))
  simulate "$i.csv" --seed "$i" --fault "f19:incipient@$begin+300:strength=0.6"
  tables+=("$i.csv")
done
{
  printf '[defaults]\nop = "{loop}.OP"\nx = "{loop}.ZT"\nf = "{loop}.FT"\nf_unit = "m3/h"\n'
  printf 'p1 = "{loop}.P1"\np1_unit = "kPa"\np2 = "{loop}.P2"\np2_unit = "kPa"\nt1 = "{loop}.T1"\n'
  for i in $(seq "$valves"); do printf '[[loop]]\nname = "FV-%d"\n' $((100 + i)); done
} >plant.toml
echo "anna:$(openssl passwd -6 secret):acknowledge" >users
printf 'listener %s 127.0.0.1\nallow_anonymous true\nuser %s\npersistence false\n' \
  $mqtt_port "$(id -un)" >broker.conf

export PLANT_BEGAN_MS
PLANT_BEGAN_MS=$(date +%s%3N)
run_plant() { exec node plant_server.mjs $plant_port "$valves" $rate "${tables[@]}"; }
run_broker() { exec mosquitto -c broker.conf; }
run_monitor() { exec "$bin/fdi-monitor" --domain "$domain" run --model-set quick; }
run_in() {
  node client.mjs plant.toml --endpoint "opc.tcp://127.0.0.1:$plant_port" --interval 0 |
    "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --lines -
}
run_out() {
  exec "$bin/fdi-gateway" --domain "$domain" out --plant plant.toml \
    --mqtt "mqtt://127.0.0.1:$mqtt_port"
}
run_server() {
  exec node server.mjs --port $port --users users -- --domain "$domain" --plant plant.toml
}
names="plant broker monitor in out server"
for name in $names; do
  launch $name
  [ $name != plant ] || await 60 grep -q ready plant.log
done

# VALVE and HEALTH of each retained state, in the order of the valves.
states() {
  mosquitto_sub -p $mqtt_port -W 3 --retained-only -t 'fdi/plant/+/state' -F '%p' 2>/dev/null ||
    true
}
healthy_valves() { states | grep -c '"health":"NORMAL"' || true; }
some_are_normal() { [ "$(healthy_valves)" -gt 0 ]; }
none_is_normal() {
  [ "$(states | wc -l)" -eq "$valves" ] && [ "$(healthy_valves)" -eq 0 ]
}
alarms() { node alarm_client.mjs --endpoint "opc.tcp://127.0.0.1:$port" "$@" 2>client.log; }
acks=0
acknowledge() {  # The first alarm that nobody has acknowledged, if there is one.
  local valve
  valve=$(alarms list | grep -m 1 'Active/Unacknowledged' | cut -f1) || return 0
  if OPCUA_PASSWORD=secret alarms --user anna ack "$valve" "round $round" | grep -q Good; then
    acks=$((acks + 1))
  fi
}

await 120 some_are_normal
end=$((SECONDS + seconds)) round=0
while [ $SECONDS -lt $end ] || [ $round -lt 8 ]; do
  case $((round % 8)) in
  0) name=broker ;;
  1) name=in ;;
  2) name=out ;;
  3) name=monitor ;;
  4) name=server ;;
  5) name=plant ;;
  6) name=in way=STOP ;;
  7) name=plant way=STOP ;;
  esac
  if [ "${way:-}" = STOP ]; then
    kill -STOP -- "-${part[$name]}"
  else
    kill_part $name
  fi
  # Nobody judges a valve whose readings do not come.
  case $name in
  plant | in) await 60 none_is_normal ;;
  *) sleep 2 ;;
  esac
  if [ "${way:-}" = STOP ]; then
    kill -CONT -- "-${part[$name]}"
  else
    launch $name
  fi
  way=
  acknowledge
  case $name in
  plant | in | monitor) await 120 some_are_normal ;;
  esac
  round=$((round + 1))
done
for name in $names; do
  kill -0 -- "-${part[$name]}" || fail "$name has ended: $(tail -3 $name.log)"
done

# The same alarms everywhere: valve, state, who acknowledged.
by_history() {
  history "select valve_id, alarm_state, ifnull(acked_by, '') from fault_history
    where alarm_state <> 'NORMAL' order by 1, 2, 3" | tr '|' ' '
}
by_mqtt() {
  states | node -e '
    const lines = require("fs").readFileSync(0, "utf8").trim().split("\n").map(JSON.parse);
    for (const {valve_id: valve, alarms} of lines)
      for (const {state, acked_by: by} of alarms ?? []) console.log(valve, state, by ?? "");' |
    sort
}
by_opcua() {
  alarms list | awk -F'\t' '{
    split($3, s, "/"); acked = s[2] == "Acknowledged"
    print $1, (s[1] == "Active" ? (acked ? "ACKED" : "UNACK") : "RTN_UNACK"), $8 }' | sort
}
agree() {
  by_history >history.txt && by_mqtt >mqtt.txt && by_opcua >opcua.txt &&
    [ -s history.txt ] && cmp -s history.txt mqtt.txt && cmp -s history.txt opcua.txt
}
for _ in $(seq 30); do
  ! agree || break
  sleep 1
done
agree || fail "they differ: history $(cat history.txt), MQTT $(cat mqtt.txt), OPC UA $(cat opcua.txt)"
stored=$(history "select count(*) from episode_event where kind = 'ACK'")
[ "$stored" = "$acks" ] || fail "$stored acknowledgements in the history, $acks given"
[ "$acks" -gt 0 ] || fail "no acknowledgement"
echo "wire: $round rounds, $(history "select count(*) from episode") episodes," \
  "$(wc -l <history.txt) alarms the same in all three, $acks acknowledged once"
