#!/usr/bin/env bash
# A broker, `fdi-gateway in` and `out`, a monitor: readings come by topics, the
# findings go out; the broker's certificate expires, it refuses, is killed and comes back.
# Usage: mqtt.sh FOLDER-OF-PROGRAMS      77 without mosquitto.
set -euo pipefail
PATH=$PATH:/usr/sbin:/usr/local/sbin
for needed in mosquitto mosquitto_pub mosquitto_sub; do
  command -v $needed >/dev/null || {
    echo "mqtt: skipped, no $needed (Debian: mosquitto, mosquitto-clients)"
    exit 77
  }
done
tests=$(cd "$(dirname "$0")/.." && pwd)
source "$tests/system/programs.sh" "$1"
broker= in= out= feeds=
finish() {
  exec 2>/dev/null
  rm -f feeding
  # A client that has lost its broker waits for it.
  for feed in $feeds; do pkill -P "$feed" || true; done
  kill -9 $broker $in $out $feeds ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
port=$((17000 + domain))  # No ephemeral one, nor one of a test's domain.
await() {  # SECONDS WORD FILE
  timeout "$1" sh -c 'until grep -q "$0" "$1"; do sleep 0.1; done' "$2" "$3" ||
    fail "no $2 in $3 within $1 s: $(tail -5 "$3")"
}
# The retained state of a valve has WORD within 150 s.
expect_state() {  # VALVE WORD
  for _ in $(seq 300); do
    mosquitto_sub -p $port -C 1 -W 2 -t "fdi/north/$1/state" >state.json \
      2>/dev/null || true
    ! grep -q "$2" state.json || return 0
    sleep 0.5
  done
  fail "the state of $1 is $(cat state.json), not $2"
}
start_broker() {
  printf 'listener %s 127.0.0.1\nuser %s\nallow_anonymous false\npassword_file %s\n' \
    $port "$(id -un)" "$work/users" >broker.conf
  mosquitto -c broker.conf >broker.out 2>&1 &
  broker=$!
}
mosquitto_passwd -b -c users fdi s3cret
mosquitto_sub() { command mosquitto_sub -u fdi -P s3cret "$@"; }

"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" \
  >/dev/null 2>train.log
"$bin/fdi-simulator" run --no-publish --duration 300 --seed 1 -o V1.csv \
  --parameters paper-operating-point --log-level error >/dev/null
cat "$tests/gateway/defaults.toml" - >plant.toml <<'END'
topic = "plant/{loop}"
value = "{signal}"
[[loop]]
name = "V1"
[[loop]]
name = "V2"
END
# A certificate of the broker that has expired is said, and a new one goes.
openssl req -x509 -newkey rsa:2048 -nodes -keyout ca.key -out ca.pem -subj /CN=ca 2>/dev/null
openssl req -newkey rsa:2048 -nodes -keyout broker.key -out broker.csr -subj /CN=127.0.0.1 \
  -addext subjectAltName=IP:127.0.0.1 2>/dev/null
# OpenSSL 3.4 and later refuse an end before the start, and take both as dates.
expired=(-days -1)
! openssl x509 -help 2>&1 | grep -q -- -not_after ||
  expired=(-not_before 20200101000000Z -not_after 20200102000000Z)
certify() {  # OPTION...
  openssl x509 -req -in broker.csr -CA ca.pem -CAkey ca.key -copy_extensions copy "$@" \
    -out broker.pem 2>/dev/null
}
certify "${expired[@]}"
printf 'listener %s 127.0.0.1\nuser %s\nallow_anonymous true\ncertfile broker.pem\nkeyfile broker.key\n' \
  $port "$(id -un)" >broker.conf
mosquitto -c broker.conf >broker.out 2>&1 &
broker=$!
"$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --mqtt "mqtts://127.0.0.1:$port" \
  --ca ca.pem 2>expired.log &
in=$!
await 20 'broker_lost.*certificate verify failed' expired.log
certify -days 1
kill -HUP $broker
await 20 broker_connected expired.log
kill $in
wait $in || fail "in ended with $?"
kill $broker
wait $broker || true

start_broker
start --model-set quick
echo wrong >password
"$bin/fdi-gateway" --domain "$domain" in --plant plant.toml \
  --mqtt "mqtt://fdi@127.0.0.1:$port" --password-file password 2>refused.log &
in=$!
await 20 "broker_lost" refused.log
grep -q "not authorised" refused.log || fail "$(cat refused.log)"
kill $in
wait $in || fail "in ended with $?"
echo s3cret >password
"$bin/fdi-gateway" --domain "$domain" in --plant plant.toml \
  --mqtt "mqtt://fdi@127.0.0.1:$port" --password-file password >in.txt \
  2>in.log &
in=$!
FDI_MQTT_PASSWORD=s3cret "$bin/fdi-gateway" --domain "$domain" out \
  --mqtt "mqtt://fdi@127.0.0.1:$port" --site north 2>out.log &
out=$!
await 20 broker_connected in.log
await 20 broker_connected out.log

# Both valves once a second, V2 without its position, while there is a file
# "feeding".
feed() {  # VALVE FORMAT-OF-X
  while [ -e feeding ]; do
    tail -n +2 V1.csv | while [ -e feeding ] && IFS=, read -r _ cv p1 p2 t1 x f _; do
      printf "{\"op\":%s,\"p1\":%s,\"p2\":%s,\"t1\":%s,\"f\":%s,$2\"q\":\"good\"}\n" \
        "$cv" "$p1" "$p2" "$t1" "$f" "$x"
      sleep 1
    done | mosquitto_pub -u fdi -P s3cret -p $port -l -t "plant/$1" \
      2>/dev/null || true
    sleep 0.3
  done
}
head -1 V1.csv | grep -q '^t_s,CV_pct,P1_kPa,P2_kPa,T1_degC,X_pct,F_m3_h' ||
  fail "columns: $(head -1 V1.csv)"
touch feeding
feed V1 '\"x\":%s,' >/dev/null 2>&1 &
feeds=$!
feed V2 '\"no_x\":%s,' >/dev/null 2>&1 &
feeds+=" $!"
expect_state V1 '"health":"NORMAL"'
expect_state V2 '"health":"CHECK_FUNCTION"'
mosquitto_sub -p $port -C 1 -W 5 -t fdi/north/monitor | grep -q '"alive":true' ||
  fail "the monitor's topic"

# The broker is killed: what it kept is gone, and all comes back by itself.
kill -9 $broker
wait $broker 2>/dev/null || true
await 20 broker_lost in.log
await 20 broker_lost out.log
start_broker
expect_state V1 '"health":"NORMAL"'

# Without readings nothing stays normal.
rm feeding
expect_state V1 '"health":"CHECK_FUNCTION"'
grep -q "tag_silent" in.log || fail "no tag is said to be silent"

# The gateway is killed: the broker publishes the last will.
kill -9 $out
wait $out 2>/dev/null || true
out=
for _ in $(seq 60); do
  mosquitto_sub -p $port -C 1 -W 2 -t fdi/north/monitor >alive.json || true
  ! grep -q '"alive":false' alive.json || break
  sleep 0.5
done
grep -q '"alive":false' alive.json || fail "no last will: $(cat alive.json)"
kill $in
wait $in || fail "in ended with $?"
in=
stop
echo "mqtt: $(grep '^readings' in.txt), $(grep '^samples' in.txt)"
