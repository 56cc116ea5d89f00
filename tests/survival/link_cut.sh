#!/usr/bin/env bash
# Two hosts as network namespaces joined by veth: the monitor in one, publishers
# in the other, the link cut for FDI_CUT_SECONDS (default 5, long form 60). The
# valves are reported stale within 3 periods; what was published is diagnosed
# when the link is back, or is a data gap; nothing hangs. Then the interfaces of
# both hosts are removed and made anew under their addresses.
# Usage: link_cut.sh BIN_DIRECTORY      77 where namespaces are not permitted.
set -euo pipefail
bin=$1
cut=${FDI_CUT_SECONDS:-5}
valves=5
tag=$$
near=fdi-a-$tag far=fdi-b-$tag
out=$(mktemp -d)
export FDI_DATA=$out/data
mkdir "$FDI_DATA"

finish() {
  kill "${monitor:-}" "${publisher:-}" 2>/dev/null || true
  ip netns del "$near" 2>/dev/null || true
  ip netns del "$far" 2>/dev/null || true
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
join() {  # NAMESPACE DEVICE ADDRESS
  ip -n "$1" addr add "$3/24" dev "$2"
  ip -n "$1" link set lo up
  ip -n "$1" link set "$2" up
  ip -n "$1" route add 224.0.0.0/4 dev "$2"
}
plug() {
  ip link add "fa$tag" netns "$near" type veth peer name "fb$tag" netns "$far"
  join "$near" "fa$tag" 10.77.0.1
  join "$far" "fb$tag" 10.77.0.2
}
plug

"$bin/fdi-trainer" train --campaign "$(dirname "$0")/quick.toml" \
  --activate >/dev/null
ip netns exec "$near" "$bin/fdi-monitor" --interface 10.77.0.1 \
  run --record --model-set quick >"$out/monitor.out" 2>"$out/monitor.log" &
monitor=$!
ip netns exec "$far" "$bin/fdi-simulator" --interface 10.77.0.2 \
  run --valves $valves --keep-alive \
  --duration $((cut + 30)) --parameters paper-operating-point \
  >"$out/publisher.out" 2>"$out/publisher.log" &
publisher=$!

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
await 30 some || fail "nothing was received"

ip -n "$far" link set "fb$tag" down
cut_ms=$(now_ms)
await 10 stale || fail "no valve was reported stale"
stale_ms=$(($(now_ms) - cut_ms))
sleep "$(awk "BEGIN {left = $cut - $stale_ms / 1000; print (left > 0 ? left : 0)}")"
ip -n "$far" link set "fb$tag" up
ip -n "$far" route replace 224.0.0.0/4 dev "fb$tag"
before=$(received)
up_ms=$(now_ms)
more() { [ "$(received)" -ge $((before + 2 * valves)) ]; }
await 20 more || fail "nothing was received after the cut"
back_ms=$(($(now_ms) - up_ms))

said() { grep -q "$1" "$out/monitor.log"; }
ip -n "$near" link del "fa$tag"  # The other end goes, too.
await 5 said "interface_missing address=10.77.0.1" ||
  fail "nothing was said of the interface that is gone"
plug
up_ms=$(now_ms)
# Earlier samples may still be on their way into the store.
await 15 said "interface_renewed address=10.77.0.1" ||
  fail "interface_renewed is missing"
before=$(received)
await 15 more || fail "nothing was received on the interface made anew"
anew_ms=$(($(now_ms) - up_ms))

wait "$publisher" || fail "the publisher ended with $?"
sleep 1.5
kill -TERM "$monitor"
wait "$monitor" || fail "the monitor ended with $?"
monitor=
publisher=

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
  "$back_ms ms, on new interfaces after $anew_ms ms, $missing of $(((cut + 30) * valves)) samples missing, all in gaps"
[ "$stale_ms" -le 4500 ] || fail "stale only after $stale_ms ms"
