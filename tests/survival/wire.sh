#!/usr/bin/env bash
# The plant's wire from end to end: an OPC UA server of a plant, the client, the
# gateways, the monitor, a broker and the OPC UA server of the findings are killed
# and stopped in turn, and the links to the plant and to the broker are cut, while
# faults grow in every fourth of FDI_WIRE_VALVES valves (default 8) and alarms are
# acknowledged. One more valve comes by an edge node of Sparkplug B and the broker.
# Plant and broker are hosts of their own, as network namespaces.
# The short form kills each part once, several at a time, then stops one and cuts a
# link. The long form, with
# FDI_WIRE_SECONDS of more than 200 (default 30), plays all ways in which a part
# goes, leaves it away for 20 s and a link for 60 s, and begins again until the
# time is up.
# While a part that a valve is judged by is away, neither the broker nor OPC UA
# calls the valve normal; at the end history, MQTT and OPC UA tell the same, and
# each acknowledgement is there once.
# Usage: wire.sh FOLDER-OF-PROGRAMS NODE_MODULES
#   77 without what it takes: node-opcua, sparkplug-payload, mosquitto, network
#   namespaces
set -euo pipefail
PATH=$PATH:/usr/sbin
modules=$(realpath -m "$2")
for needed in node mosquitto mosquitto_sub; do
  command -v $needed >/dev/null || needed_is_missing=1
done
[ -z "${needed_is_missing:-}" ] && [ -d "$modules/node-opcua-server" ] &&
  [ -d "$modules/sparkplug-payload" ] || {
  echo "wire: skipped, no mosquitto, or npm has not fetched node-opcua and sparkplug-payload"
  exit 77
}
tests=$(cd "$(dirname "$0")/.." && pwd)
# Interfaces that come and go are no other test's business.
if [ -z "${FDI_IN_NAMESPACE:-}" ]; then
  # In a chroot a namespace can be made but not entered.
  if ! command -v ip >/dev/null || ! ip netns add fdi-wire-$$ 2>/dev/null ||
    ! ip netns exec fdi-wire-$$ true 2>/dev/null; then
    ip netns del fdi-wire-$$ 2>/dev/null || true
    echo "wire: skipped, network namespaces are not permitted here"
    exit 77
  fi
  ip netns del fdi-wire-$$
  FDI_IN_NAMESPACE=1 exec unshare --net "$0" "$(realpath "$1")" "$modules"
fi
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo
source "$tests/system/programs.sh" "$1"
seconds=${FDI_WIRE_SECONDS:-30}
valves=${FDI_WIRE_VALVES:-8}
if [ "$seconds" -gt 200 ]; then
  rate=2 away=20 cut=60  # Rows a second; how long a part and a link are away [s].
  ways=(broker client out monitor server plant gateway:STOP plant:CUT edge
    gateway plant:STOP broker:CUT client:STOP monitor:STOP out:STOP host edge:STOP)
else
  rate=10 away=0 cut=0
  ways=("client edge" "out broker" gateway "plant host" "monitor server" gateway:STOP plant:CUT)
fi
plant_port=$((16000 + domain)) port=$((15000 + domain)) mqtt_port=$((17000 + domain))
export FDI_GATEWAY=$bin/fdi-gateway FDI_STORE=$bin/fdi-store
declare -A part  # By name, the group of its processes.
finish() {
  exec 2>/dev/null
  for name in "${!part[@]}"; do
    kill -CONT -- "-${part[$name]}" || true
    kill -9 -- "-${part[$name]}" || true
  done
  ip netns del "$plant_host" || true
  ip netns del "$broker_host" || true
  rm -rf "$work"
}
plant_host=fdi-plant-$$ broker_host=fdi-broker-$$
trap finish EXIT
add_host() {  # NAMESPACE LINK NET
  ip netns add "$1"
  ip link add "$2" type veth peer name eth0 netns "$1"
  ip addr add "$3.1/24" dev "$2"
  ip -n "$1" addr add "$3.2/24" dev eth0
  ip link set "$2" up
  ip -n "$1" link set lo up
  ip -n "$1" link set eth0 up
}
add_host "$plant_host" plant 10.78.1
add_host "$broker_host" broker 10.78.2
set -m
launch() {  # NAME: a group of processes that write NAME.log.
  "run_$1" >>"$1.log" 2>&1 &
  part[$1]=$!
}

cp "$tests"/../gateway/opcua/*.mjs "$tests"/gateway/{plant_server,opcua,sparkplug}.mjs .
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
} >host.toml
cp host.toml plant.toml
for i in $(seq "$valves"); do printf '[[loop]]\nname = "FV-%d"\n' $((100 + i)); done >>plant.toml
printf '[[loop]]\nname = "V1"\n' | tee -a host.toml | cat plant.toml - >all.toml
echo "anna:$(openssl passwd -6 secret):acknowledge" >users
printf 'listener %s\nallow_anonymous true\nuser %s\npersistence false\n' \
  $mqtt_port "$(id -un)" >broker.conf

export PLANT_BEGAN_MS PLANT_HOST=10.78.1.2 PLANT_RATE=$rate
PLANT_BEGAN_MS=$(date +%s%3N)
run_plant() {
  exec ip netns exec "$plant_host" node plant_server.mjs $plant_port "$valves" $rate "${tables[@]}"
}
run_broker() { exec ip netns exec "$broker_host" mosquitto -c broker.conf; }
run_monitor() { exec "$bin/fdi-monitor" --domain "$domain" run --model-set quick; }
run_in() {
  node client.mjs plant.toml --endpoint "opc.tcp://10.78.1.2:$plant_port" --interval 0 |
    "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --lines -
}
run_edge() {  # With a number for each connection.
  while true; do
    node sparkplug.mjs edge "10.78.2.2:$mqtt_port" plant line1 healthy.csv $(($(date +%s) % 256)) </dev/null || sleep 1
  done
}
run_host() {
  exec "$bin/fdi-gateway" --domain "$domain" in --plant host.toml \
    --mqtt "mqtt://10.78.2.2:$mqtt_port" --sparkplug plant
}
run_out() {
  exec "$bin/fdi-gateway" --domain "$domain" out --plant all.toml \
    --mqtt "mqtt://10.78.2.2:$mqtt_port"
}
run_server() {
  exec node server.mjs --port $port --users users -- --domain "$domain" --plant all.toml
}
names="plant broker monitor in host edge out server"
for name in $names; do
  launch $name
  [ $name != plant ] || await 60 grep -q ready plant.log
done

# The retained messages of TOPIC, COUNT of them.
retained() {
  ip netns exec "$broker_host" mosquitto_sub -p $mqtt_port -W 3 -C "$2" --retained-only \
    -t "fdi/plant/$1" -F '%p' 2>/dev/null || true
}
states() { retained +/state $((valves + 1)); }
blind=  # How the names of the valves begin that nobody judges.
# While the gateway is away, no state is current.
healthy_valves() {
  retained monitor 1 | grep -q '"alive":true' || { echo 0 && return; }
  states | grep "\"valve_id\":\"$blind" | grep -c '"health":"NORMAL"' || true
}
some_are_normal() { [ "$(healthy_valves)" -gt 0 ]; }
none_is_normal() { [ "$(healthy_valves)" -eq 0 ]; }
# VALVE and DeviceHealth, as numbers of OPC 10000-100, of all valves by OPC UA.
healths() {
  node opcua.mjs $port read V1/DeviceHealth \
    $(seq -f 'FV-%.0f/DeviceHealth' 101 $((100 + valves))) 2>opcua.log |
    sed -n 's=/DeviceHealth Good= =p' | tr -s ' '
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

none_is_normal_by_opcua() {
  healths >healths.txt && [ "$(wc -l <healths.txt)" -gt "$valves" ] &&
    ! grep -q "^$blind.* 0\$" healths.txt
}
# The processes of a part; the client and the gateway behind it are one service.
pids_of() {  # NAME
  case $1 in
  client) pgrep -g "${part[in]}" node ;;
  gateway) pgrep -g "${part[in]}" fdi-gateway ;;
  *) echo "-${part[$1]}" ;;
  esac
}
service_of() { case $1 in client | gateway) echo in ;; *) echo "$1" ;; esac; }
take_away() {  # NAME WAY
  case $2 in
  CUT) ip link set "$1" down ;;
  STOP) kill -STOP -- $(pids_of "$1") ;;
  *)
    kill -9 -- $(pids_of "$1")
    # When one end of the pipe is gone, the other one ends by itself.
    wait "${part[$(service_of "$1")]}" 2>/dev/null || true
    ;;
  esac
}
bring_back() {  # NAME WAY
  case $2 in
  CUT) ip link set "$1" up ;;
  STOP) kill -CONT -- $(pids_of "$1") ;;
  *) launch "$(service_of "$1")" ;;
  esac
}
# Without these parts nobody judges the valves, so that none may be normal until
# they are back. The longest time until none is goes to `blind_ms`.
blind_ms=0
stay_blind() {  # PARTS
  local begin_ms end=$((SECONDS + away))
  begin_ms=$(date +%s%3N)
  [[ $1 != *CUT* ]] || end=$((SECONDS + cut))
  await 60 none_is_normal
  local took=$(($(date +%s%3N) - begin_ms))
  echo "$SECONDS s: $1, no valve normal after $took ms" >>rounds.log
  [ $took -le $blind_ms ] || blind_ms=$took
  local by_opcua=none_is_normal_by_opcua
  # The server has a gateway of its own.
  [[ $1 != out* && $1 != *server ]] || by_opcua=true
  await 30 $by_opcua
  while [ $SECONDS -lt $end ]; do
    none_is_normal || fail "normal without $1: $(states)"
    sleep 1
  done
  $by_opcua || fail "OPC UA without $1: $(healths)"
}
judged_again() {
  for blind in FV V1; do await 120 some_are_normal; done
}

judged_again
end=$((SECONDS + seconds)) round=0
while [ $SECONDS -lt $end ] || [ $round -lt ${#ways[@]} ]; do
  parts=${ways[round % ${#ways[@]}]}
  for way in $parts; do take_away "${way%:*}" "${way#*:}"; done
  case $parts in
  *" "* | out* | monitor*) blind= ;;
  plant* | client* | gateway*) blind=FV ;;
  *) blind=V1 ;;
  esac
  case $parts in
  server) sleep $((away + 2)) ;;  # The broker has nothing to do with it.
  *) stay_blind "$parts" ;;
  esac
  for way in $parts; do bring_back "${way%:*}" "${way#*:}"; done
  back_ms=$(date +%s%3N)
  acknowledge
  judged_again
  echo "$SECONDS s: $parts, normal again within $(($(date +%s%3N) - back_ms)) ms" >>rounds.log
  round=$((round + 1))
done
acknowledged() {
  acknowledge
  [ "$acks" -gt 0 ]
}
await 180 acknowledged
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
# Health of each valve, the same by both.
same_health() {
  states | node -e '
    const health = {NORMAL: 0, FAILURE: 1, CHECK_FUNCTION: 2, OFF_SPEC: 3, MAINTENANCE_REQUIRED: 4};
    const lines = require("fs").readFileSync(0, "utf8").trim().split("\n").map(JSON.parse);
    for (const one of lines) console.log(one.valve_id, health[one.health]);' |
    sort >mqtt_health.txt && healths | sort >opcua_health.txt &&
    [ "$(wc -l <mqtt_health.txt)" -gt "$valves" ] && cmp -s mqtt_health.txt opcua_health.txt
}
agree() {
  same_health && by_history >history.txt && by_mqtt >mqtt.txt && by_opcua >opcua.txt &&
    [ -s history.txt ] && cmp -s history.txt mqtt.txt && cmp -s history.txt opcua.txt
}
for _ in $(seq 30); do
  ! agree || break
  sleep 1
done
agree || fail "they differ: $(diff mqtt_health.txt opcua_health.txt), history $(cat history.txt), MQTT $(cat mqtt.txt), OPC UA $(cat opcua.txt)"
stored=$(history "select count(*) from episode_event where kind = 'ACK'")
[ "$stored" = "$acks" ] || fail "$stored acknowledgements in the history, $acks given"
echo "wire: $round rounds, $(history "select count(*) || ' episodes of ' ||
  count(distinct valve_id) || ' valves' from episode")," \
  "$(wc -l <history.txt) alarms the same in all three, $acks acknowledged once," \
  "no valve normal after $blind_ms ms at most"
cat rounds.log
