#!/usr/bin/env bash
# An alarm reaches a client of the OPC UA server, and its acknowledgement the
# history and the broker; what nobody judges is never normal; what hostile
# clients try has an answer and changes nothing.
# Usage: opcua.sh FOLDER-OF-PROGRAMS NODE_MODULES     77 without what it takes.
set -euo pipefail
PATH=$PATH:/usr/sbin
modules=$(realpath -m "$2")
[ -d "$modules/node-opcua-server" ] || {
  echo "opcua: skipped, npm has not fetched node-opcua"
  exit 77
}
tests=$(cd "$(dirname "$0")/.." && pwd)
source "$tests/system/programs.sh" "$1"
server= feed= third= healthy= broker= out= mqtt= listener= page=
finish() {
  exec 2>/dev/null
  kill -9 $server $feed $third $healthy $broker $out $mqtt $listener $page ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
port=$((15000 + domain)) # No ephemeral one, nor one of a test's domain.
export FDI_GATEWAY=$bin/fdi-gateway FDI_STORE=$bin/fdi-store
cp "$tests"/../gateway/opcua/*.mjs "$tests/gateway/opcua.mjs" .
ln -s "$modules" node_modules
shows() { node alarm_client.mjs --endpoint "opc.tcp://127.0.0.1:$port" list 2>/dev/null | grep "$1"; }
client() { node opcua.mjs $port "$@" 2>client.log; }
alarms() { node alarm_client.mjs --endpoint "opc.tcp://127.0.0.1:$port" "$@" 2>client.log; }
serve() {  # OPTIONS
  : >server.log
  node server.mjs --port $port --users users "$@" -- --domain "$domain" \
    --plant plant.toml 2>server.log &
  server=$!
  await 60 grep -q "opcua_server: ready" server.log
}

# The server refuses at the start what cannot be.
node server.mjs --port $port --host 0.0.0.0 2>refused.log && fail "open to all without users"
grep -q "takes --users" refused.log || fail "$(cat refused.log)"
echo "anna:secret:acknowledge" >users
node server.mjs --port $port --users users 2>refused.log && fail "a password in clear"
grep -q "users line 1: expected NAME:HASH:ROLE" refused.log || fail "$(cat refused.log)"
for user in anna:acknowledge otto:view; do
  echo "${user%:*}:$(openssl passwd -6 secret):${user#*:}"
done >users

"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" >/dev/null 2>train.log
printf '[defaults]\nop = "{loop}.OP"\nx = "{loop}.ZT"\ngroup = "hall 1"\n' >plant.toml
printf '[[loop]]\nname = "%s"\n' V1 V2 V3 "3:odd/name" >>plant.toml
serve
# Nobody has told of any valve.
client await V1/DeviceHealth "Good 2" >/dev/null
client read V1/Description V1/Fault "3%3Aodd%2Fname/DeviceHealth" >read.txt
diff read.txt - <<'END' || fail "without a monitor"
V1/Description Good no monitor tells of it
V1/Fault BadNoData 
3%3Aodd%2Fname/DeviceHealth Good 2
END
client follow V2/DeviceHealth 600 >health.txt &
listener=$!
await 60 test -s health.txt

console=  # Port of the page, unless it is left out of the build.
[ ! -d "$bin/../share/fdi/console" ] || console=$((port + 600))
start --model-set quick ${console:+--console=$console}
run() {  # VALVE OPTIONS
  exec "$bin/fdi-simulator" --domain "$domain" run --valve "$1" --speed 20 --seed 7 \
    --parameters paper-operating-point --set excitation.amplitude_pct=8 \
    --set excitation.period_s=80 --duration 1000000 --log-level error "${@:2}" >/dev/null
}
run V1 --fault f19:abrupt@100:strength=0.5 &
feed=$!
run V3 --fault f19:abrupt@100:strength=0.5 &
third=$!
run V2 &
healthy=$!
client await V2/DeviceHealth "Good 0" >/dev/null
client await V1/Fault "Good f19" >/dev/null
client read V1/DeviceHealth V1/FaultName V1/Severity V1/Certainty >read.txt
diff read.txt - <<'END' || fail "an alarm"
V1/DeviceHealth Good 1
V1/FaultName Good Flow transmitter wrong
V1/Severity Good 750
V1/Certainty Good sure
END
alarms list | grep ^V1 >alarms.txt
[ "$(cut -f1-5 alarms.txt)" = "$(printf 'V1\tFailureAlarm\tActive/Unacknowledged\t\t750')" ] ||
  fail "$(cat alarms.txt)"

# Whoever may not act, and nonsense of who may; the broker hears of what counts.
[ "$(client hostile V1)" = refused ] || fail "hostile: $(cat client.log)"
[ "$(OPCUA_USER=otto OPCUA_PASSWORD=secret client hostile V1 | tail -1)" = refused ] ||
  fail "hostile otto: $(cat client.log)"
acknowledged=$(history "select count(*) || ' ' || max(who) || ' ' || max(comment) from episode_event where kind = 'ACK'")
[[ $acknowledged == "1 anna call "[12] ]] || fail "in the history: $acknowledged"
await 20 shows "V1.*Acknowledged"
export OPCUA_PASSWORD=secret
alarms --user anna shelve V1 8 | grep -q Good || fail "shelve: $(cat client.log)"
await 20 shows "V1.*Shelved"
alarms --user anna unshelve V1 | grep -q Good || fail "unshelve: $(cat client.log)"

# From the call of a client to the history, and to the broker.
if command -v mosquitto >/dev/null && command -v mosquitto_sub >/dev/null; then
  printf 'listener %s 127.0.0.1\nallow_anonymous true\nuser %s\n' \
    $((port + 500)) "$(id -un)" >broker.conf
  mosquitto -c broker.conf >mosquitto.out 2>&1 &
  broker=$!
  await 20 mosquitto_sub -p $((port + 500)) -W 1 -E -t none
  "$bin/fdi-gateway" --domain "$domain" out --mqtt "mqtt://127.0.0.1:$((port + 500))" 2>out.log &
  out=$!
  mosquitto_sub -p $((port + 500)) -F '%U %p' -t fdi/plant/V3/state >broker.txt &
  mqtt=$!
  await 20 grep -q '"state":"UNACK"' broker.txt
fi
if [ -n "$console" ]; then  # When the page has it [ms since 1970].
  node --input-type=module -e '
    const ours = /"acked_by": ?"anna".*"ack_comment": ?"V3"/;
    for (let page = ""; !ours.test(page);) {
      await new Promise(resolve => setTimeout(resolve, 50));
      page = await (await fetch(process.argv[1])).text();
    }
    console.log(Date.now());' "http://127.0.0.1:$console/api/v1/alarms" >page.txt 2>page.log &
  page=$!
fi
called=$(OPCUA_USER=anna client acknowledge V3)
await 10 test "$(history "select acked_by from fault_history where valve_id = 'V3'")" = anna
after="history $(history "select (max(recorded_ns) - ${called}000000) / 1000000
  from episode_event where kind = 'ACK' and who = 'anna' and comment = 'V3'") ms"
if [ -n "$console" ]; then
  await 10 test -s page.txt
  after+=", page $(($(cat page.txt) - called)) ms"
fi
if [ -n "$broker" ]; then
  await 10 grep -q '"acked_by":"anna"' broker.txt
  after+=", MQTT $(awk -v t="$called" '/"acked_by":"anna"/ { printf "%d", 1000 * $1 - t; exit }' broker.txt) ms"
  kill $out $mqtt $broker
  wait $out || fail "out ended with $?"
  out= mqtt= broker=
fi

# The source of V2 ends: not normal from then on. So it is while the gateway is
# killed or stands still, and while the monitor is away.
kill -9 $healthy
client await V2/DeviceHealth "Good 2" >/dev/null
client read V2/Fault | grep -q "BadNoData" || fail "V2 without data"
run V2 &
healthy=$!
client await V2/DeviceHealth "Good 0" >/dev/null
gateway=$(pgrep -P $server fdi-gateway)
kill -STOP "$gateway"
client await V2/DeviceHealth "Good 2" >/dev/null
client read V2/Description | grep -q "fdi-gateway is silent" || fail "$(cat server.log)"
client await V2/DeviceHealth "Good 0" >/dev/null
kill -9 "$monitor"
wait "$monitor" 2>/dev/null || true
client await V2/DeviceHealth "Good 2" >/dev/null
alarms list | cut -f1-3 | grep -q "V1.*Active" || fail "the alarm of V1 went with the monitor"
start --model-set quick
client await V2/DeviceHealth "Good 0" >/dev/null

# The server is killed and comes back with what it has to tell.
kill -9 $server $listener
wait $server $listener 2>/dev/null || true
server= listener=
serve
client await V1/Fault "Good f19" >/dev/null
kill $server
wait $server || fail "the server ended with $?"
server=

# Beyond loopback: encrypted, with a certificate that was trusted, and a user.
end_server() {
  kill $server
  wait $server || fail "the server ended with $?"
  server=
}
trust() {  # Trusts the rejected certificates, and restarts.
  end_server
  mv "$FDI_DATA"/opcua/rejected/* "$FDI_DATA/opcua/trusted/certs"
  serve --host 0.0.0.0
}
refuses() { ! client read V1/DeviceHealth >read.txt || fail "$* can read"; }
serve --host 0.0.0.0
refuses "a client without encryption"
export OPCUA_PKI=$work/client
refuses "an unknown certificate"
trust
refuses "anonymous"
OPCUA_USER=anna OPCUA_PASSWORD=wrong refuses "a wrong password"
export OPCUA_USER=anna
client read V1/DeviceHealth | grep -q "V1/DeviceHealth Good" || fail "$(cat client.log)"
export OPCUA_EXPIRED=1
refuses "an expired certificate"
trust
refuses "an expired certificate that was trusted"
grep -q BadCertificateTimeInvalid server.log || fail "not refused as expired"
end_server
kill $feed $third $healthy
stop
[ "$(head -1 health.txt)" = "Good 2" ] || fail "V2 began as $(head -1 health.txt)"
echo "opcua: acknowledged after $after; V2 was $(tr '\n' ' ' <health.txt)"
