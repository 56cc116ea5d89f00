#!/usr/bin/env bash
# Everything at once for FDI_MIXED_SECONDS (default 60, long form 600): monitors on
# two hosts (network namespaces) share 300 valves in five streams with faults that
# come and go, the history of each monitor is shipped to PostgreSQL by a shipper of
# its own. Every few seconds one of these: a monitor is killed or stopped for a
# while, its link is cut, its shipper is killed, PostgreSQL crashes. Afterwards the
# history of each monitor and the plant's have to hold the same episodes with the
# same ends, and subscribers have to have heard of each of them.
# Usage: mixed.sh BIN_DIRECTORY    77 without namespaces or PostgreSQL.
set -euo pipefail
bin=$1
seconds=${FDI_MIXED_SECONDS:-60}
seed=${FDI_MIXED_SEED:-1}
streams=5 valves=60
share=('' 'S[1-3]*' 'S[45]*')  # Streams S1 to S5, by monitor.
tag=$$
out=$(mktemp -d)
hub=fdi-h-$tag
space() { echo "fdi-n$1-$tag"; }
declare -a monitor shipper publisher
watcher=

kill_now() {
  kill -9 "$1" 2>/dev/null || true
  wait "$1" 2>/dev/null || true
}
finish() {
  for pid in "${monitor[@]:-}" "${shipper[@]:-}" "${publisher[@]:-}" "$watcher"; do
    [ -z "$pid" ] || kill_now "$pid"
  done
  [ ! -e "$out/cluster/postmaster.pid" ] ||
    postgres "$pg/pg_ctl" -D "$out/cluster" -m immediate stop >/dev/null || true
  for name in "$hub" "$(space 1)" "$(space 2)"; do
    ip netns del "$name" 2>/dev/null || true
  done
  [ -z "${FDI_MIXED_KEEP:-}" ] || cp -r "$out" "$FDI_MIXED_KEEP"
  rm -rf "$out"
}
fail() {
  echo "mixed: $*" >&2
  for log in "$out"/*.log; do
    echo "== $log" >&2
    grep -v fault_event "$log" | tail -15 >&2
  done
  exit 1
}
skip() {
  echo "mixed: skipped, $*"
  exit 77
}

trap finish EXIT
pg=$(find /usr/lib/postgresql -path '*/bin/initdb' 2>/dev/null | sort -V | tail -1)
pg=${pg%/initdb}
[ -n "$pg" ] || skip "PostgreSQL is not installed"
if ! command -v ip >/dev/null || ! ip netns add "$hub" 2>/dev/null ||
  ! ip netns exec "$hub" true 2>/dev/null; then
  skip "network namespaces are not permitted here"
fi

# PostgreSQL does not run as root.
postgres() {
  if [ "$(id -u)" -eq 0 ]; then
    (cd / && setpriv --reuid=postgres --regid=postgres --clear-groups "$@")
  else
    "$@"
  fi
}
start_postgres() {
  for _ in $(seq 100); do
    ! postgres "$pg/pg_ctl" -D "$out/cluster" -w -l "$out/cluster.log" start \
      >/dev/null 2>&1 || return 0
    sleep 0.1
  done
  fail "PostgreSQL does not start"
}
[ "$(id -u)" -ne 0 ] || chown postgres "$out"
chmod 755 "$out"
postgres "$pg/initdb" -D "$out/cluster" -U postgres -A trust -E UTF8 \
  --locale=C.UTF-8 --no-sync >/dev/null
echo "listen_addresses = ''
unix_socket_directories = '$out'" >>"$out/cluster/postgresql.conf"
start_postgres
url="postgresql://postgres@/postgres?host=$out"
"$bin/fdi-store" ship --init --db "$url" >/dev/null

ip -n "$hub" link set lo up
ip -n "$hub" link add br0 type bridge mcast_snooping 0
ip -n "$hub" addr add 10.79.0.3/24 dev br0
ip -n "$hub" link set br0 up
ip -n "$hub" route add 224.0.0.0/4 dev br0
for i in 1 2; do
  ip netns add "$(space $i)"
  ip link add "m$i" netns "$hub" type veth peer name eth0 netns "$(space $i)"
  ip -n "$hub" link set "m$i" master br0 up
  ip -n "$(space $i)" link set lo up
  ip -n "$(space $i)" addr add "10.79.0.$i/24" dev eth0
  ip -n "$(space $i)" link set eth0 up
  ip -n "$(space $i)" route add 224.0.0.0/4 dev eth0
  mkdir "$out/data$i"
done
FDI_DATA=$out/data1 "$bin/fdi-trainer" train \
  --campaign "$(dirname "$0")/quick.toml" --activate >/dev/null 2>&1
rm "$out"/data1/runs.db*
cp "$out"/data1/* "$out/data2"

start_monitor() {  # MONITOR
  ip netns exec "$(space "$1")" "$bin/fdi-monitor" --interface "10.79.0.$1" \
    --data "$out/data$1" run --model-set quick --valve "${share[$1]}" \
    2>>"$out/monitor$1.log" &
  monitor[$1]=$!
}
start_shipper() {  # MONITOR
  "$bin/fdi-store" ship --data "$out/data$1" --db "$url" --monitor "m$1" \
    --every 1s >/dev/null 2>>"$out/shipper$1.log" &
  shipper[$1]=$!
}
ip netns exec "$hub" "$bin/fdi-monitor" --interface 10.79.0.3 \
  watch --lossless --events --json >"$out/bus" 2>"$out/watch.log" &
watcher=$!
for i in 1 2; do
  start_monitor $i
  until [ -e "$out/data$i/history.db" ]; do sleep 0.1; done
  start_shipper $i
done
# Each stream has a fault of 20 s every two minutes; 90 s end an episode.
for ((s = 1; s <= streams; ++s)); do
  faults=()
  for ((at = 20 + 4 * s; at + 20 < seconds; at += 120)); do
    faults+=(--fault "f19:abrupt@$at:strength=0.5:until=$((at + 20))")
  done
  ip netns exec "$hub" "$bin/fdi-simulator" --interface 10.79.0.3 \
    run --valve "S$s" --count $valves --keep-alive --seed "$s" \
    --duration $((seconds + 90)) --parameters paper-operating-point \
    "${faults[@]}" >/dev/null 2>"$out/publisher$s.log" &
  publisher[s]=$!
done

RANDOM=$seed
declare -A strikes
end=$((SECONDS + seconds))
while [ $SECONDS -lt $end ]; do
  sleep "$((2 + RANDOM % 5)).$((RANDOM % 10))"
  i=$((1 + RANDOM % 2))
  kinds=(kill stop cut ship crash)
  kind=${kinds[RANDOM % 5]}
  strikes[$kind]=$((${strikes[$kind]:-0} + 1))
  case $kind in
    kill)
      kill_now "${monitor[$i]}"
      start_monitor $i
      ;;
    stop)
      kill -STOP "${monitor[$i]}"
      sleep "$((RANDOM % 4)).$((RANDOM % 10))"
      kill -CONT "${monitor[$i]}"
      ;;
    cut)
      ip -n "$hub" link set "m$i" down
      sleep "$((RANDOM % 6)).$((RANDOM % 10))"
      ip -n "$hub" link set "m$i" up
      ;;
    ship)
      kill_now "${shipper[$i]}"
      start_shipper $i
      ;;
    crash)
      kill -9 "$(head -1 "$out/cluster/postmaster.pid")"
      sleep "$((RANDOM % 4))"
      start_postgres
      ;;
  esac
done

for pid in "${publisher[@]}"; do
  wait "$pid" || fail "a publisher ended with $?"
done
sleep 5
for i in 1 2; do
  kill -TERM "${monitor[$i]}"
  wait "${monitor[$i]}" || fail "monitor $i ended with $?"
  monitor[$i]=
done
for i in 1 2; do
  kill_now "${shipper[$i]}"
  shipper[$i]=
  "$bin/fdi-store" ship --data "$out/data$i" --db "$url" --monitor "m$i" \
    >/dev/null || fail "the last rows of m$i were not shipped"
done
kill -TERM "$watcher"
wait "$watcher" || true
watcher=

columns="episode_id || ' ' || coalesce(ended_ns, 0) || ' ' || coalesce(end_reason, '')"
for i in 1 2; do
  sqlite3 -readonly "$out/data$i/history.db" \
    "SELECT $columns FROM episode" | sort >"$out/history$i.txt"
  psql "$url" -At -c "SELECT $columns FROM fdi.episode JOIN fdi.monitor m
    USING (monitor_id) WHERE m.monitor = 'm$i'" | sort >"$out/plant$i.txt"
done
closed() { grep -c ' ' "$1" || true; }
jq_id='s/.*"episode_id": *"\([^"]*\)".*/\1/p'
sed -n "$jq_id" "$out/bus" | sort -u >"$out/heard.txt"
for i in 1 2; do
  "$bin/fdi-store" --data "$out/data$i" history list --state any --json 2>/dev/null
done | sed -n "$jq_id" | sort -u >"$out/listed.txt"
echo "mixed: $seconds s, seed $seed, strikes:" \
  "$(for kind in "${!strikes[@]}"; do echo -n "$kind ${strikes[$kind]} "; done)"
echo "mixed: $(wc -l <"$out/heard.txt") episodes on the bus," \
  "$(closed "$out/history1.txt") and $(closed "$out/history2.txt") in the" \
  "histories, $(closed "$out/plant1.txt") and $(closed "$out/plant2.txt") in" \
  "the plant's; open $(grep -c ' 0 ' "$out/history1.txt" || true)"
for i in 1 2; do
  cmp "$out/history$i.txt" "$out/plant$i.txt" || fail "the plant's m$i differs"
done
# A fault that falls into a restart or a cut of its monitor is missed.
[ "$(cat "$out"/history?.txt | wc -l)" -ge $((streams * valves / 2)) ] ||
  fail "too few episodes"
missing=$(comm -13 "$out/heard.txt" "$out/listed.txt" | wc -l)
unknown=$(comm -23 "$out/heard.txt" "$out/listed.txt" | wc -l)
[ "$missing" = 0 ] || fail "$missing episodes were never heard of"
[ "$unknown" = 0 ] || fail "$unknown episodes were heard of and are not stored"
