#!/usr/bin/env bash
# A pair of monitors in three network namespaces: one monitor in each of two,
# valves and a subscriber in the third, which is a switch between the others.
# The leader is killed, stopped, cut off (what it sends; all), the link between
# the two is cut for 60 s (both lead), its disk takes 2 s for each sync during 10 s,
# FDI_PAIR_ROUNDS times each (default 3, long form 50). The clock of the second
# host is 2 s ahead. Says how late the next vector of every valve came, and fails if it
# was later than 0.5 s (median) or 1 s (worst), if a sample never got its
# vector, a transition came twice, or an episode has two ids.
# Usage: pair.sh BIN_DIRECTORY PAIR_ROUNDS [KIND...]
#        77 where namespaces are not permitted.
# FDI_PAIR_VALVES (1000), FDI_PAIR_FAULTY (20), FDI_PAIR_SPLIT_SECONDS (60)
set -euo pipefail
bin=$1 plant=$2
shift 2
[ $# -gt 0 ] || set -- kill stop cut-out cut split slow-disk term
rounds=${FDI_PAIR_ROUNDS:-3}
valves=${FDI_PAIR_VALVES:-1000} faulty=${FDI_PAIR_FAULTY:-20}
split=${FDI_PAIR_SPLIT_SECONDS:-60}
tag=$$
out=$(mktemp -d)
bad_host=$(realpath "$(dirname "$plant")/libfdi_bad_host.so")
hub=fdi-p-$tag
space() { echo "fdi-m$1-$tag"; }
device() { echo "m$1"; }

finish() {
  exec 3>&- 2>/dev/null || true
  for pid in "${monitor[@]:-}" "${plant_pid:-}"; do
    [ -z "$pid" ] || kill -9 "$pid" 2>/dev/null || true
  done
  for name in "$hub" "$(space 1)" "$(space 2)"; do
    ip netns del "$name" 2>/dev/null || true
  done
  [ -n "${FDI_PAIR_KEEP:-}" ] && cp -r "$out" "$FDI_PAIR_KEEP"
  rm -rf "$out"
}
fail() {
  echo "pair: $*" >&2
  for log in "$out"/*.log; do
    echo "== $log" >&2
    grep -v fault_event "$log" | tail -20 >&2
  done
  exit 1
}

declare -a monitor
trap finish EXIT
# In a chroot a namespace can be made but not entered.
if ! command -v ip >/dev/null || ! ip netns add "$hub" 2>/dev/null ||
  ! ip netns exec "$hub" true 2>/dev/null; then
  echo "pair: skipped, network namespaces are not permitted here"
  exit 77
fi
ip -n "$hub" link set lo up
ip -n "$hub" link add br0 type bridge mcast_snooping 0
ip -n "$hub" addr add 10.78.0.3/24 dev br0
ip -n "$hub" link set br0 up
ip -n "$hub" route add 224.0.0.0/4 dev br0
for i in 1 2; do
  ip netns add "$(space $i)"
  ip link add "$(device $i)" netns "$hub" type veth peer name eth0 \
    netns "$(space $i)"
  ip -n "$hub" link set "$(device $i)" master br0 up
  ip -n "$(space $i)" link set lo up
  ip -n "$(space $i)" addr add 10.78.0.$i/24 dev eth0
  ip -n "$(space $i)" link set eth0 up
  ip -n "$(space $i)" route add 224.0.0.0/4 dev eth0
  mkdir "$out/data$i"
  "$plant" prepare "$out/data$i"
done

start() {  # MONITOR
  ip netns exec "$(space "$1")" env "LD_PRELOAD=$bad_host" \
    "FDI_SLOW_DISK=$out/slow$1" "FDI_CLOCK_AHEAD_S=$((2 * ($1 - 1)))" \
    "$bin/fdi-monitor" --interface "10.78.0.$1" \
    --data "$out/data$1" run --pair long --rank "$1" 2>>"$out/monitor$1.log" &
  monitor[$1]=$!
}
mkfifo "$out/to" "$out/from"
ip netns exec "$hub" "$plant" run 10.78.0.3 0 "$valves" "$faulty" \
  <"$out/to" >"$out/from" 2>"$out/plant.log" &
plant_pid=$!
exec 3>"$out/to" 4<"$out/from"
ask() {
  echo "$*" >&3
  read -r answer <&4
}
start 1
start 2

cut() {  # MONITOR: what it sends.
  tc -n "$(space "$1")" qdisc replace dev eth0 root blackhole
}
cut_back() {  # MONITOR: what is sent to it.
  tc -n "$hub" qdisc replace dev "$(device "$1")" root blackhole
}
heal() {  # MONITOR
  tc -n "$(space "$1")" qdisc del dev eth0 root
  tc -n "$hub" qdisc del dev "$(device "$1")" root 2>/dev/null || true
}
isolate() {  # on|off: the two do not hear each other, the plant hears both.
  for i in 1 2; do
    ip -n "$hub" link set "$(device $i)" type bridge_slave isolated "$1"
  done
}
leader=0
find_leader() {
  ask ready 120
  for i in 1 2; do
    [ "${monitor[$i]}" != "$answer" ] || leader=$i
  done
  [ "$answer" != 0 ] || fail "the pair did not settle"
}

find_leader
ask faulty
[ "$answer" = "$faulty" ] || fail "only $answer of $faulty faults were isolated"
for kind in "$@"; do
  for ((round = 1; round <= rounds; ++round)); do
    find_leader
    pid=${monitor[$leader]}
    sleep "0.$((RANDOM % 10))"  # Valves speak once a second.
    ask mark
    case $kind in
      kill | term)
        kill "$([ $kind = kill ] && echo -9 || echo -TERM)" "$pid"
        ask late
        wait "$pid" 2>/dev/null || [ $kind = kill ] || fail "it ended with $?"
        start $leader
        ;;
      stop)
        kill -STOP "$pid"
        ask late
        sleep 1
        kill -CONT "$pid"
        ;;
      cut | cut-out)
        [ $kind = cut-out ] || cut_back $leader
        cut $leader
        ask late
        sleep 1
        heal $leader
        ;;
      split)
        isolate on
        sleep "$split"
        ask mark
        isolate off
        ask late
        ;;
      slow-disk)
        touch "$out/slow$leader"
        ask late
        sleep 10
        rm "$out/slow$leader"
        ;;
      *) fail "there is no kind $kind" ;;
    esac
    read -r median worst silent <<<"$answer"
    echo "$kind $round: next vectors after $median ms (median)," \
      "$worst ms (worst), $silent valves silent"
    echo "$kind $median $worst" >>"$out/delays"
    [ "$silent" = 0 ] || fail "$silent valves are silent"
    awk "BEGIN {exit !($median <= 500 && $worst <= 1000)}" || fail "too late"
  done
done
find_leader
sleep 4
ask totals
sqlite3 "$out/data1/history.db" "ATTACH '$out/data2/history.db' AS other;
  SELECT count(DISTINCT episode_id) FROM
  (SELECT episode_id FROM fault_history UNION ALL
   SELECT episode_id FROM other.fault_history)" >"$out/merged"
echo "pair: $answer, $(cat "$out/merged") episodes in the merged history"
awk '{n[$1]++; m[$1] += $2; if ($3 > w[$1]) w[$1] = $3}
  END {for (k in n) printf "pair: %s, %d rounds: next vectors after %.0f ms (mean of medians), %.0f ms (worst)\n", k, n[k], m[k] / n[k], w[k]}' \
  "$out/delays"
for wanted in "missing=0" "transitions_twice=0" "episodes=$faulty"; do
  [[ " $answer " == *" $wanted "* ]] || fail "expected $wanted"
done
[ "$(cat "$out/merged")" = "$faulty" ] || fail "an episode has two ids"
