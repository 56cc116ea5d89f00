#!/usr/bin/env bash
# An edge node of Sparkplug B gives the readings of two valves, and a host reads what
# is found; both by a library that nobody here wrote. The node loses a message, says
# nothing, loses a device and dies; the gateway and the broker are killed; others
# publish nonsense.
# Usage: sparkplug.sh FOLDER-OF-PROGRAMS NODE_MODULES     77 without what it takes.
set -euo pipefail
PATH=$PATH:/usr/sbin:/usr/local/sbin
modules=$(realpath -m "$2")
for needed in node mosquitto mosquitto_pub mosquitto_sub; do
  command -v $needed >/dev/null || needed_is_missing=1
done
[ -z "${needed_is_missing:-}" ] && [ -d "$modules/sparkplug-payload" ] || {
  echo "sparkplug: skipped, no mosquitto, or npm has not fetched sparkplug-payload"
  exit 77
}
tests=$(cd "$(dirname "$0")/.." && pwd)
source "$tests/system/programs.sh" "$1"
broker= in= out= edge= host=
finish() {
  exec 2>/dev/null
  kill -9 $broker $in $out $edge $host ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
port=$((17000 + domain))  # No ephemeral one, nor one of a test's domain.
says() { await 60 grep -q "$1" "$2"; }  # WORDS FILE
cp "$tests/gateway/sparkplug.mjs" .
ln -s "$modules" node_modules
start_broker() {
  printf 'listener %s 127.0.0.1\nuser %s\nallow_anonymous true\n' \
    $port "$(id -un)" >broker.conf
  mosquitto -c broker.conf >broker.out 2>&1 &
  broker=$!
  await 20 mosquitto_sub -p $port -W 1 -E -t none
}
start_host() {
  mosquitto_sub -p $port -t 'spBv1.0/findings/#' -F '%t %x' > >(node sparkplug.mjs decode | tee -a all.txt >>told.txt) &
  host=$!
}
start_edge() {
  rm -f orders
  mkfifo orders
  node sparkplug.mjs edge $port plant line1 V1.csv <orders >>edge.txt 2>>edge.log &
  edge=$!
  exec 3>orders
}
start_in() {
  "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --mqtt "mqtt://127.0.0.1:$port" \
    --sparkplug plant >in.txt 2>in.log &
  in=$!
}
start_out() {
  "$bin/fdi-gateway" --domain "$domain" out --plant plant.toml --mqtt "mqtt://127.0.0.1:$port" \
    --sparkplug findings --site north 2>>out.log &
  out=$!
}
publish() { mosquitto_pub -p $port -t "spBv1.0/plant/$1" "${@:2}"; }  # TOPIC OPTIONS

"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" >/dev/null 2>train.log
"$bin/fdi-simulator" run --no-publish --duration 300 --seed 1 -o V1.csv \
  --parameters paper-operating-point --log-level error >/dev/null
head -1 V1.csv | grep -q '^t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h' ||
  fail "columns: $(head -1 V1.csv)"
cat "$tests/gateway/defaults.toml" - >plant.toml <<'END'
[[loop]]
name = "V1"
[[loop]]
name = "V2"
[[loop]]
name = "V3"
END
start_broker
start --model-set quick
start_host
start_in
# It listens once it refuses a device of no node. Births that come before are asked for
# again, and a line of the same node is said once a minute only.
ghost() {
  publish DDATA/ghost/V9 -n && grep -q 'tag=ghost reason="ghost/V9: no NBIRTH has come' in.log
}
await 60 ghost
start_edge
start_out
says 'NBIRTH/north bdSeq=[0-9]* Node Control/Rebirth=false' told.txt
says 'V1 .*DeviceHealth=0' told.txt
says 'V2 .*Description=judged in part' told.txt
says 'DBIRTH/north/V3 DeviceHealth=2 Description=no monitor tells of it Fault=null' told.txt
says 'DDEATH/north/V3' told.txt

# A message is lost: said, and all comes back by a birth.
: >edge.txt
: >told.txt
echo gap >&3
says 'instead of [0-9]*: a message is missing' in.log
says rebirth edge.txt

# Nonsense is said by topic or tag, and the others go on.
publish DDATA/line1/V1 -m 41.5
says 'spBv1.0/plant/DDATA/line1/V1.*no payload of Sparkplug B' in.log
node sparkplug.mjs encode '{"timestamp": 1, "metrics": [{"name": "bdSeq", "type": "UInt64", "value": 4}]}' |
  publish NDEATH/line1 -s
says 'its bdSeq is not that of the birth, 5' in.log
birth() {  # METRICS: of a node that is born with V3
  node sparkplug.mjs encode '{"timestamp": '"$(date +%s%3N)"', "seq": 0, "metrics": []}' | publish NBIRTH/other -s
  node sparkplug.mjs encode '{"timestamp": '"${2:-$(date +%s%3N)}"', "seq": 1, "metrics": ['"$1"']}' |
    publish DBIRTH/other/V3 -s
}
birth '{"name": "V3.OP", "type": "Template", "value": {"isDefinition": false}}'
says 'V3.OP.*data type 19 is neither number nor text' in.log
birth '{"name": "V3.P1", "type": "Double", "value": 300}' 1000
says 'V3.P1.*its stamp is 1970' in.log
birth '{"name": "V3.P2", "type": "Double", "value": 300}' $(($(date +%s%3N) + 31536000000))
says 'V3.P2.*its stamp is 20.*ahead of this host' in.log
seq 30000 | publish DDATA/flood/V1 -l
says 'spBv1.0/plant/DDATA/flood/V1' in.log

# The gateway begins again: the node was born before it listened. The diagnosis
# begins again, too.
: >edge.txt
: >told.txt
kill $in
wait $in || fail "in ended with $?"
grep -E '^(readings|unreadable|dropped)' in.txt >first.txt
start_in
says 'tag=line1 reason="line1/V[12]: no NBIRTH has come' in.log
says rebirth edge.txt

# A node that lives and says nothing: its values stand. A device dies, and is born
# again.
is_normal() { grep 'V1 .*DeviceHealth' all.txt | tail -1 | grep -q DeviceHealth=0; }
says 'V1 .*DeviceHealth=2' told.txt
await 60 is_normal
: >told.txt
echo quiet >&3
sleep 8
! grep 'V1 .*DeviceHealth=2' told.txt || fail "V1 is not judged while its values stand"
echo go >&3
: >told.txt
echo "death V1" >&3
says 'V1 .*DeviceHealth=2' told.txt
says 'source_silent name=line1/V1 ' in.log
echo "birth V1" >&3
says 'V1 .*DeviceHealth=0' told.txt

# A host asks for a rebirth.
: >told.txt
node sparkplug.mjs encode '{"timestamp": 1, "metrics": [{"name": "Node Control/Rebirth", "type": "Boolean", "value": true}]}' |
  mosquitto_pub -p $port -t spBv1.0/findings/NCMD/north -s
says 'NBIRTH/north' told.txt
says 'DBIRTH/north/V1 DeviceHealth=0' told.txt
says 'DBIRTH/north/V2 DeviceHealth=2' told.txt

# The gateway is killed: the broker tells the death of its birth.
born=$(sed -n 's/.*NBIRTH\/north \(bdSeq=[0-9]*\).*/\1/p' told.txt)
kill -9 $out
wait $out 2>/dev/null || true
says "NDEATH/north $born\$" told.txt
start_out
says 'V1 .*DeviceHealth=0' told.txt

# The broker is killed: all comes back by itself, with another number.
kill -9 $broker
wait $broker 2>/dev/null || true
await 20 grep -q broker_lost in.log
await 20 grep -q broker_lost out.log
kill $host
: >told.txt
start_broker
start_host
start_edge
says 'V1 .*DeviceHealth=0' told.txt

# The node dies: nothing that is held is taken for measured.
: >told.txt
kill -9 $edge
wait $edge 2>/dev/null || true
edge=
says 'V1 .*DeviceHealth=2' told.txt
kill $out
wait $out || fail "out ended with $?"
out=
says NDEATH/north told.txt
! grep WRONG told.txt || fail "the order of messages"
kill $in
wait $in || fail "in ended with $?"
in=
stop
echo "sparkplug:" $(cat first.txt)
