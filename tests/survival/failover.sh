#!/usr/bin/env bash
# Another host takes over, as docs/operations.md sets it up: two hosts with Corosync
# and Pacemaker, the data folder of the active one copied to the other every
# FDI_COPY_SECONDS (default 10). The active host is killed and cut off while faults
# are open. Says for how long nobody diagnosed and what was lost; fails unless the
# other host goes on with the episodes that it has a copy of. Hosts are namespaces
# (network, mounts, processes, name), at a switch with the plant's publishers.
# Usage: failover.sh BIN_DIRECTORY     77 without namespaces, Pacemaker or rsync.
set -euo pipefail
bin=$1
period=${FDI_COPY_SECONDS:-10}
valves=20
tag=$$
out=$(mktemp -d)
plant=fdi-p-$tag
space() { echo "fdi-$1-$tag"; }
publishers=() hosts=('' '' '')

finish() {
  kill -9 "${publishers[@]}" "${watcher:-}" 2>/dev/null || true
  for i in 1 2; do
    [ -z "${hosts[i]}" ] || kill -9 "${hosts[i]}" 2>/dev/null || true
    ip netns del "$(space $i)" 2>/dev/null || true
  done
  ip netns del "$plant" 2>/dev/null || true
  sleep 0.5
  rm -rf "$out"
}
fail() {
  echo "failover: $*" >&2
  tail -n 20 "$out"/*/*.log >&2
  exit 1
}
skip() {
  echo "failover: skipped, $*"
  exit 77
}
now_ms() { date +%s%3N; }
await() {  # SECONDS CONDITION...
  local until=$(($(now_ms) + $1 * 1000))
  shift
  until "$@"; do
    [ "$(now_ms)" -lt $until ] || return 1
    sleep 0.2
  done
}

trap finish EXIT
for program in corosync pacemakerd cibadmin crm_resource rsync sqlite3; do
  command -v $program >/dev/null || skip "$program is not installed"
done
[ -e /usr/lib/ocf/resource.d/heartbeat/anything ] ||
  skip "resource-agents are not installed"
if ! command -v ip >/dev/null || ! ip netns add "$plant" 2>/dev/null ||
  ! ip netns exec "$plant" unshare -m -p -u -i -f true 2>/dev/null; then
  skip "namespaces are not permitted here"
fi

ip -n "$plant" link set lo up
ip -n "$plant" link add br0 type bridge mcast_snooping 0
ip -n "$plant" addr add 10.80.0.9/24 dev br0
ip -n "$plant" link set br0 up
ip -n "$plant" route add 224.0.0.0/4 dev br0

make_host() {  # NUMBER
  local host=$out/$1 name
  name=$(space "$1")
  ip netns add "$name"
  ip link add "h$1" netns "$plant" type veth peer name eth0 netns "$name"
  ip -n "$plant" link set "h$1" master br0 up
  ip -n "$name" link set lo up
  ip -n "$name" addr add "10.80.0.$1/24" dev eth0
  ip -n "$name" link set eth0 up
  ip -n "$name" route add 224.0.0.0/4 dev eth0
  mkdir -p "$host"/{corosync,lib/corosync,lib/pacemaker,log/corosync,log/pacemaker,fdi/copy}
  cp -a /var/lib/pacemaker/. "$host/lib/pacemaker/"
  chown hacluster:haclient "$host/log/pacemaker"
  cat >"$host/corosync/corosync.conf" <<CONF
totem {
  version: 2
  cluster_name: fdi
  transport: udpu
}
nodelist {
  node {
    ring0_addr: 10.80.0.1
    name: host1
    nodeid: 1
  }
  node {
    ring0_addr: 10.80.0.2
    name: host2
    nodeid: 2
  }
}
quorum {
  provider: corosync_votequorum
  two_node: 1
  wait_for_all: 0
}
logging {
  to_stderr: no
  to_syslog: no
  to_logfile: yes
  logfile: /var/log/corosync/corosync.log
}
CONF
  cat >"$host/rsyncd.conf" <<CONF
use chroot = no
[copy]
path = $host/fdi/copy
read only = no
uid = root
gid = root
CONF
  # The service: with a newer copy than its own data it begins with that.
  cat >"$host/serve" <<SERVE
#!/bin/sh
cd "$host/fdi" || exit 1
if [ -e copy/history.db ]; then
  rm -rf before && { [ ! -e data ] || mv data before; } && mv copy data &&
    mkdir copy
fi
exec "$bin/fdi-monitor" --data data --interface 10.80.0.$1 run --model-set quick
SERVE
  # Beside it: copies what it has to the other host.
  cat >"$host/send" <<SEND
#!/bin/sh
cd "$host/fdi" || exit 1
while sleep $period; do
  rm -rf spool
  at=\$(date +%s%3N)
  "$bin/fdi-store" --data data backup spool >/dev/null &&
    rsync -a --delete --delay-updates --timeout=5 spool/ \
      rsync://10.80.0.$((3 - $1)):8730/copy/ && echo "\$at" >>"$host/copied"
done
SEND
  cat >"$host/boot" <<BOOT
#!/bin/bash
hostname host$1
for name in corosync pacemaker; do
  mount --bind "$host/lib/\$name" /var/lib/\$name
  mount --bind "$host/log/\$name" /var/log/\$name
done
mount --bind "$host/corosync" /etc/corosync
mount -t tmpfs none /run
mount -t tmpfs none /dev/shm
mkdir -p /run/crm /run/lock /run/resource-agents
chown hacluster:haclient /run/crm
rsync --daemon --no-detach --port=8730 --config="$host/rsyncd.conf" &
corosync -f &
until corosync-cfgtool -s >/dev/null 2>&1; do sleep 0.1; done
pacemakerd &
wait
BOOT
  chmod +x "$host"/{serve,send,boot}
  start_host "$1"
}
start_host() {  # NUMBER
  ip netns exec "$(space "$1")" unshare -m -p -u -i -f --mount-proc \
    "$out/$1/boot" >>"$out/$1/boot.log" 2>&1 &
  local parent=$!
  hosts[$1]=
  await 10 pgrep -P $parent >/dev/null || fail "host $1 does not start"
  hosts[$1]=$(pgrep -P $parent)
}
on() {  # NUMBER COMMAND...
  local pid=${hosts[$1]}
  shift
  nsenter -t "$pid" -n -m -p -u -i "$@"
}

mkdir -p "$out/1/fdi/data"
FDI_DATA=$out/1/fdi/data "$bin/fdi-trainer" train \
  --campaign "$(dirname "$0")/quick.toml" --activate >/dev/null 2>&1
rm -f "$out"/1/fdi/data/runs.db*
make_host 1
make_host 2
up() { on 1 crm_mon -1 2>/dev/null | grep -q "Online: \[ host1 host2 \]"; }
await 120 up || fail "the cluster does not form"

primitive() {  # NAME
  echo "<primitive id='$1' class='ocf' provider='heartbeat' type='anything'>
    <instance_attributes id='$1-a'>
      <nvpair id='$1-b' name='binfile' value='/etc/corosync/$1'/>
      <nvpair id='$1-l' name='logfile' value='/var/log/corosync/$1.log'/>
    </instance_attributes>
    <operations><op id='$1-m' name='monitor' interval='5s' timeout='20s'/></operations>
  </primitive>"
}
# The same paths on both hosts.
for i in 1 2; do
  cp "$out/$i/serve" "$out/$i/corosync/serve"
  cp "$out/$i/send" "$out/$i/corosync/send"
done
on 1 cibadmin --modify --xml-text "<crm_config><cluster_property_set id='o'>
  <nvpair id='o-s' name='stonith-enabled' value='false'/>
  </cluster_property_set></crm_config>"
on 1 cibadmin --create --scope resources --xml-text "<group id='fdi'>
  <meta_attributes id='fdi-m'>
    <nvpair id='fdi-s' name='resource-stickiness' value='100'/>
  </meta_attributes>$(primitive serve)$(primitive send)</group>"
on 1 cibadmin --create --scope constraints --xml-text \
  "<rsc_location id='first' rsc='fdi' node='host1' score='50'/>"
ready() { grep -qs monitor_ready "$out/$1/log/corosync/serve.log"; }
await 60 ready 1 || fail "the monitor does not start on host 1"
! ready 2 || fail "it also started on host 2"

# When each vector of one valve came.
ip netns exec "$plant" "$bin/fdi-monitor" --interface 10.80.0.9 \
  watch --json --valve S 2>"$out/1/watch.log" > >(while read -r line; do
    case $line in *DecisionVector*) now_ms ;; esac
  done >"$out/vectors") &
watcher=$!
publish() {  # NAME VALVES FAULT-AT
  ip netns exec "$plant" "$bin/fdi-simulator" --interface 10.80.0.9 run \
    --valve "$1" --count "$2" --keep-alive --duration 900 \
    --parameters paper-operating-point \
    --fault "f19:abrupt@$3:strength=0.5" >/dev/null 2>"$out/1/$1.log" &
  publishers+=($!)
}
episodes() {  # FOLDER: ids of the open ones
  sqlite3 -readonly "$1/history.db" \
    "SELECT episode_id FROM episode WHERE ended_ns IS NULL" 2>/dev/null | sort
}
publish S 1 100000
publish A $valves 20
all_open() { [ "$(episodes "$out/1/fdi/data" | wc -l)" -ge $((valves * $1)) ]; }
await 180 all_open 1 || fail "the faults are not found"
copied() { [ "$(episodes "$out/2/fdi/copy" | wc -l)" -ge $valves ]; }
await 120 copied || fail "no copy has them"
# The last copy lacks what happens after it.
publish B $valves 5
await 180 all_open 2 || fail "the later faults are not found"
episodes "$out/1/fdi/data" >"$out/known"

ip -n "$plant" link set h1 down
kill -9 "${hosts[1]}"
killed_ms=$(now_ms)
copied_ms=$(tail -1 "$out/1/copied")
await 120 ready 2 || fail "host 2 does not take over"
ready_ms=$(now_ms)
after() { [ "$(tail -1 "$out/vectors")" -gt "$killed_ms" ]; }
await 120 after || fail "nobody diagnoses"
vector_ms=$(awk -v t="$killed_ms" '$1 > t {print $1; exit}' "$out/vectors")
last_ms=$(awk -v t="$killed_ms" '$1 <= t {last = $1} END {print last}' "$out/vectors")
episodes "$out/2/fdi/data" >"$out/taken"
resumed() {
  [ "$(sqlite3 -readonly "$out/2/fdi/data/history.db" \
    "SELECT count(DISTINCT episode_id) FROM episode_event WHERE kind = 'RESUMED'")" \
    -ge "$valves" ]
}
await 180 resumed || fail "the episodes do not go on"
found() { [ "$(episodes "$out/2/fdi/data" | wc -l)" -ge $((2 * valves)) ]; }
await 180 found || fail "the faults that the copy lacks are not found again"

# The dead host comes back as the standby.
ip -n "$plant" link set h1 up
mv "$out/1/log/corosync/serve.log" "$out/1/serve.before.log"
start_host 1
await 120 up || fail "host 1 does not come back"
back() { [ -e "$out/1/fdi/copy/history.db" ]; }
await 120 back || fail "host 1 gets no copy"
! ready 1 || fail "it started on host 1, too"

echo "failover: ready on the other host $((ready_ms - killed_ms)) ms after the" \
  "kill, no vector for $((vector_ms - last_ms)) ms; the copy was" \
  "$((killed_ms - copied_ms)) ms old and lacked" \
  "$(comm -23 "$out/known" "$out/taken" | wc -l) of $(wc -l <"$out/known")" \
  "open episodes, which were found again"
