#!/usr/bin/env bash
# Two hosts as network namespaces at a switch, which is a third one: the monitor in
# one, publishers in the other, the link cut for FDI_CUT_SECONDS (default 5, long
# form 60). The valves are reported stale; what was published is diagnosed when the
# link is back, or is a data gap; nothing hangs. Then the interface of the monitor's
# host is removed and made anew: the monitor ends with exit code 6 and is started
# again, as its unit would do. Without its interface the publisher ends likewise.
# Usage: link_cut.sh BIN_DIRECTORY      77 where namespaces are not permitted.
set -euo pipefail
bin=$1
cut=${FDI_CUT_SECONDS:-5}
valves=5
tag=$$
near=fdi-a-$tag far=fdi-b-$tag switch=fdi-h-$tag
out=$(mktemp -d)
export FDI_DATA=$out/data
mkdir "$FDI_DATA"

finish() {
  kill "${supervisor:-}" "${publisher:-}" \
    "$(cat "$out/monitor.pid" 2>/dev/null)" 2>/dev/null || true
  for name in "$near" "$far" "$switch"; do
    ip netns del "$name" 2>/dev/null || true
  done
  rm -rf "$out"
}
fail() {
  echo "link_cut: $*" >&2
  cat "$out"/*.log >&2
  exit 1
}
now_ms() { date +%s%3N; }

trap finish EXIT
# In a chroot a namespace can be made but not entered.
if ! command -v ip >/dev/null || ! ip netns add "$near" 2>/dev/null ||
  ! ip netns exec "$near" true 2>/dev/null; then
  echo "link_cut: skipped, network namespaces are not permitted here"
  exit 77
fi
ip netns add "$far"
ip netns add "$switch"
ip -n "$switch" link add br0 type bridge mcast_snooping 0
ip -n "$switch" link set br0 up
plug() {  # NAMESPACE PORT ADDRESS
  ip link add "$2" netns "$switch" type veth peer name eth0 netns "$1"
  ip -n "$switch" link set "$2" master br0 up
  ip -n "$1" addr add "$3/24" dev eth0
  ip -n "$1" link set lo up
  ip -n "$1" link set eth0 up
  ip -n "$1" route add 224.0.0.0/4 dev eth0
}
plug "$near" near 10.77.0.1
plug "$far" far 10.77.0.2

# Restart=on-failure, RestartSec=2 and RestartPreventExitStatus=2 5 of the unit.
supervise() {
  local code
  while :; do
    code=0
    ip netns exec "$near" "$bin/fdi-monitor" --interface 10.77.0.1 \
      run --record --model-set quick >>"$out/monitor.out" 2>>"$out/monitor.log" &
    echo $! >"$out/monitor.pid"
    wait $! || code=$?
    echo "$code" >>"$out/codes.log"
    case $code in 0 | 2 | 5) return "$code" ;; esac
    sleep 2
  done
}

"$bin/fdi-trainer" train --campaign "$(dirname "$0")/quick.toml" \
  --activate >/dev/null
: >"$out/codes.log"
supervise &
supervisor=$!
ip netns exec "$far" "$bin/fdi-simulator" --interface 10.77.0.2 \
  run --count $valves --keep-alive \
  --duration $((cut + 300)) --parameters paper-operating-point \
  >"$out/publisher.out" 2>"$out/publisher.log" &
publisher=$!
start_ms=$(now_ms)

received() {
  sqlite3 -readonly "$FDI_DATA/runs.db" "select ifnull(sum(samples), 0) from run where origin = 'recorded'" \
    2>/dev/null || echo 0
}
await() {  # SECONDS CONDITION...
  local until=$(($(now_ms) + $1 * 1000))
  shift
  until "$@"; do
    [ "$(now_ms)" -lt $until ] || return 1
    sleep 0.1
  done
}
some() { [ "$(received)" -ge $((5 * valves)) ]; }
stale() { [ "$(grep -c valve_stale "$out/monitor.log")" -ge 1 ]; }
await 60 some || fail "nothing was received"

ip -n "$switch" link set far down
cut_ms=$(now_ms)
await 60 stale || fail "no valve was reported stale"
stale_ms=$(($(now_ms) - cut_ms))
sleep "$(awk "BEGIN {left = $cut - $stale_ms / 1000; print (left > 0 ? left : 0)}")"
ip -n "$switch" link set far up
before=$(received)
up_ms=$(now_ms)
more() { [ "$(received)" -ge $((before + 2 * valves)) ]; }
await 60 more || fail "nothing was received after the cut"
back_ms=$(($(now_ms) - up_ms))

# Without its interface the monitor ends, and cannot start before it is back.
codes() { grep -c '^6$' "$out/codes.log" || true; }
ended() { [ "$(codes)" -ge 1 ]; }
again() { [ "$(codes)" -ge 2 ]; }
ip -n "$near" link del eth0
await 60 ended || fail "the monitor goes on without its interface"
await 60 again || fail "the monitor started without its interface"
before=$(received)
plug "$near" near 10.77.0.1
up_ms=$(now_ms)
await 60 more || fail "nothing was received on the interface made anew"
anew_ms=$(($(now_ms) - up_ms))
sent_s=$((($(now_ms) - start_ms) / 1000))

ip -n "$far" link del eth0
code=0
wait "$publisher" || code=$?
[ "$code" = 6 ] || fail "the publisher without its interface ended with $code"
publisher=
kill -TERM "$(cat "$out/monitor.pid")"
wait "$supervisor" || fail "the monitor ended with $?"
supervisor=
[ "$(grep -vc '^6$' "$out/codes.log")" = 1 ] || fail "the monitor ended otherwise"

# Samples that a run lacks between its first and last, in stretches.
missing=0
for run in $("$bin/fdi-store" runs list --json |
  sed -n 's/.*"run_id": "\([0-9a-f]*\)".*/\1/p'); do
  valve=$(sqlite3 -readonly "$FDI_DATA/runs.db" \
    "select valve_id from run where id = '$run' and origin = 'recorded'")
  [ -n "$valve" ] || continue
  start_ns=$(sqlite3 -readonly "$FDI_DATA/runs.db" \
    "select start_ns from run where id = '$run'")
  while read -r from to; do
    missing=$((missing + to - from - 1))
    [ $((to - from)) -gt 3 ] || continue  # Counted, but no gap.
    covered=$(sqlite3 -readonly "$FDI_DATA/history.db" "
      select count(*) from data_gap where valve_id = '$valve'
      and from_ns <= $start_ns + $from * 1000000000
      and to_ns >= $start_ns + $to * 1000000000")
    [ "$covered" -ge 1 ] || fail "$valve lacks $from..$to s without a gap"
  done < <("$bin/fdi-store" runs export "$run" |
    awk -F, 'NR > 1 {t = int($1 + .5); if (NR > 2 && t > last + 1) print last, t; last = t}')
done
echo "link_cut: cut for $cut s; stale after $stale_ms ms, samples again after" \
  "$back_ms ms, on a new interface after $anew_ms ms, $missing of $((sent_s * valves)) samples missing, all in gaps"
