#!/usr/bin/env bash
# Simulates the surroundings of a monitor on real hosts, in a network namespace: two
# monitors in containers, peers without multicast, keys before the clock is set, a
# clock that is set back, prune with the clock years ahead. Needs root; what needs
# faketime is left out where that is missing.
# Usage: world.sh BIN_DIRECTORY      77 where namespaces are not permitted.
set -euo pipefail
if [ "${FDI_IN_NAMESPACE:-}" = "" ]; then
  unshare --net true 2>/dev/null || { echo "world: skipped, no namespaces"; exit 77; }
  FDI_IN_NAMESPACE=1 exec unshare --net "$0" "$@"
fi
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo
bin=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
out=$(mktemp -d)
chmod 755 "$out"
faketime=$(find /usr/lib -name libfaketimeMT.so.1 | head -1)
pids=()
end_all() {
  # unshare blocks what would end it while its child runs.
  for pid in "${pids[@]}"; do pkill -P "$pid" || true; done
  kill "${pids[@]}" 2>/dev/null || true
  wait "${pids[@]}" 2>/dev/null || true
  pids=()
}
finish() {
  end_all
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "world: $*" >&2
  tail -n 5 "$out"/*.log >&2
  exit 1
}
start() {  # LOG COMMAND...
  local log=$out/$1.log
  shift
  "$@" >"$out/stdout" 2>"$log" &
  pids+=($!)
}
await() {  # SECONDS CONDITION...
  local until=$(($(date +%s) + $1))
  shift
  until "$@"; do
    [ "$(date +%s)" -lt $until ] || return 1
    sleep 0.2
  done
}
said() { grep -q "$2" "$out/$1.log"; }
ready() { await 30 said "$1" monitor_ready || fail "$1 is not ready"; }
at() {  # OFFSET COMMAND...
  env LD_PRELOAD="$faketime" FAKETIME="$1" DONT_FAKE_MONOTONIC=1 "${@:2}"
}
monitor() {  # NAME OPTIONS...
  mkdir -p "$out/$1"
  "$bin/fdi-store" --data "$out/$1" models import "$out/quick.model" >/dev/null
  start "$1" "$bin/fdi-monitor" --data "$out/$1" run --model-set quick "${@:2}"
}
publish() {
  start "sim-$1" "$bin/fdi-simulator" run --valve "$1" --duration 10000 \
    --parameters paper-operating-point "${@:2}"
}
metric() { curl -s -m 3 "127.0.0.1:$1/metrics" | awk -v m="$2" '$1 == m {print $2}'; }

mkdir "$out/train"
"$bin/fdi-trainer" --data "$out/train" train --campaign "$here/quick.toml" --activate >/dev/null
"$bin/fdi-store" --data "$out/train" models export quick -o "$out/quick.model" >/dev/null

# Both are HOST:1, and share the valve.
for each in a b; do
  mkdir "$out/$each"
  "$bin/fdi-store" --data "$out/$each" models import "$out/quick.model" >/dev/null
  start $each unshare --pid --fork --mount-proc --kill-child \
    "$bin/fdi-monitor" --data "$out/$each" run --model-set quick
done
ready a
ready b
publish FV-1
for each in a b; do
  await 15 said $each valves_contested || fail "$each does not see the other"
done
end_all
echo "world: containers of one name see each other"

# Eight participants, called at their ports because nothing is multicast.
ip route del 224.0.0.0/4 dev lo
ip route add blackhole 224.0.0.0/4
cat >"$out/peers.xml" <<'XML'
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
 <participant profile_name="fdi_participant"><rtps><builtin><initialPeersList>
  <locator><udpv4><address>127.0.0.1</address></udpv4></locator>
 </initialPeersList></builtin></rtps></participant>
</profiles>
XML
for i in 1 2 3 4 5 6; do publish "P-$i" --qos "$out/peers.xml"; done
monitor peers --http=127.0.0.1:9464 --qos "$out/peers.xml"
ready peers
six() { [ "$(metric 9464 fdi_valves)" = 6 ]; }
await 40 six || fail "$(metric 9464 fdi_valves) of six publishers are heard"
end_all
ip route del blackhole 224.0.0.0/4
ip route add 224.0.0.0/4 dev lo
echo "world: six of six peers are heard without multicast"

if [ -n "$faketime" ]; then
  "$bin/fdi-keys" init "$out/keys" >/dev/null
  "$bin/fdi-keys" add "$out/keys" m1 --role monitor >/dev/null
  for offset in -20000d -2d; do
    code=0
    at $offset timeout 10 "$bin/fdi-monitor" --data "$out/boot" \
      --security "$out/keys/m1" run 2>"$out/boot.log" || code=$?
    [ $code = 6 ] || fail "with the clock at $offset the monitor ended with $code"
  done
  echo "world: keys that are not valid yet end with 6"

  monitor clock
  ready clock
  publish FV-1 --speed 50 --set excitation.amplitude_pct=12 \
    --set excitation.period_s=60 --fault f19:abrupt@60:strength=0.5:until=160
  store() { "$bin/fdi-store" --data "$out/clock" "$@"; }
  closed() { store history list --state closed | grep >/dev/null FV-1; }
  await 30 closed || fail "there is no episode"
  store history shelve FV-1 --for 8h --by anna >/dev/null
  for offset in -3600s -2min +3600s; do
    at $offset "$bin/fdi-store" --data "$out/clock" history list --shelved |
      grep >/dev/null FV-1 ||
      fail "the shelf is lifted by a clock at $offset"
  done
  store history ack last --by anna >/dev/null
  sleep 11  # Events leave the outbox 10 s after their acknowledgement.
  code=0
  at +4000d "$bin/fdi-store" --data "$out/clock" prune --history-age 400d \
    >/dev/null 2>"$out/prune.log" || code=$?
  [ $code = 3 ] || fail "prune with the clock years ahead ended with $code"
  closed || fail "prune deleted the episode"
  end_all
  echo "world: a clock that is set lifts no shelf and deletes nothing"
else
  echo "world: without faketime, clocks are left out"
fi

