#!/usr/bin/env bash
# Measures the cost of fdi-gateway in for 300 valves of 6 tags: by lines, each tag
# once a second, then 10 000 readings a second, and as fast as a pipe gives them;
# by MQTT, where mosquitto is, by topics and by Sparkplug B; and, with NODE_MODULES, by OPC UA, from a server
# with 1800 nodes through client.mjs. Beside a monitor that records nothing and
# has no models; what it received is counted. Then three things that go wrong at one
# of the 300 valves each: one tag of 1800 falls silent, a source's clock leaps by
# 90 s, a device takes its tags away; how soon that is said, and which valves lack
# signals. With a WAY, only that one.
# Usage: gateway.sh FOLDER-OF-PROGRAMS [SECONDS [NODE_MODULES [lines|mqtt|sparkplug|opcua|wrong]]]
set -euo pipefail
PATH=$PATH:/usr/sbin
seconds=${2:-30}
modules=${3:+$(realpath "$3")}
valves=300
tree=$(cd "$(dirname "$0")/.." && pwd)
source "$(dirname "$0")/../tests/system/programs.sh" "$1"
gateway= client= server= broker=
port=$((16000 + domain))
finish() {
  exec 2>/dev/null
  kill -9 $gateway $client $server $broker ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT

{
  printf '[defaults]\nop = "{loop}.OP"\nx = "{loop}.ZT"\nf = "{loop}.FT"\n'
  printf 'f_unit = "m3/h"\np1 = "{loop}.P1"\np2 = "{loop}.P2"\nt1 = "{loop}.T1"\n'
  printf 'topic = "plant/{loop}"\nvalue = "{signal}"\n'
  for i in $(seq $valves); do printf '[[loop]]\nname = "FV-%d"\n' $((100 + i)); done
} >plant.toml
# READINGS a second for SECONDS; 0: as fast as they are taken, stamps a second
# apart for 1800 readings. With a PORT to the broker there, a message for each
# valve, by topics or as the Sparkplug node BENCH of the group PLANT; else lines.
cat >feed.pl <<'END'
use strict;
use IO::Socket::INET;
use Time::HiRes qw(time sleep);
my ($rate, $seconds, $valves, $port, $wrong, $sparkplug) = @ARGV;
my $out = \*STDOUT;
# A packet of MQTT 3.1.1: type, length in groups of 7 bits, body.
sub packet {
  my ($type, $body) = @_;
  my ($n, $length) = (length $body, "");
  do { $length .= chr($n % 128 | ($n > 127 ? 128 : 0)); $n >>= 7 } while $n;
  return chr($type) . $length . $body;
}
# Protocol Buffers, as far as gateway/sparkplug.proto takes them here.
sub varint {
  my ($n, $text) = (shift, "");
  do { $text .= chr($n % 128 | ($n > 127 ? 128 : 0)); $n >>= 7 } while $n;
  return $text;
}
my $seq = 0;
sub metric {  # ALIAS VALUE [NAME]: a Double.
  my $body = "\x10" . varint($_[0]) . "\x20\x0a\x69" . pack("d<", $_[1]);
  $body = "\x0a" . varint(length $_[2]) . $_[2] . $body if $_[2];
  return "\x12" . varint(length $body) . $body;
}
sub payload {  # TYPE[/DEVICE] METRICS
  my ($type, $device) = split "/", $_[0];
  return packet(0x30, pack("n/a*", "spBv1.0/PLANT/$type/BENCH" . ($device ? "/$device" : "")) .
    "\x08" . varint(int(time * 1000)) . $_[1] . "\x18" . varint($seq++ % 256));
}
if ($port) {
  $out = IO::Socket::INET->new("127.0.0.1:$port") or die "no broker";
  print $out packet(0x10, pack("n/a*CCn n/a*", "MQTT", 4, 2, 0, "feed"));
}
$out->autoflush(1);
my @tags = map { my $v = 100 + $_; map { "FV-$v.$_" } qw(OP ZT FT P1 P2 T1) } 1 .. $valves;
my @names = qw(OP ZT FT P1 P2 T1);
sub of_valve {  # VALUE [VALVE]: six metrics; in a birth with their names.
  my ($v, $valve) = @_;
  return join "", map { metric($_ + 1, $v, $valve && "$valve.$names[$_]") } 0 .. 5;
}
if ($sparkplug) {
  print $out payload("NBIRTH", "");
  print $out payload("DBIRTH/FV-$_", of_valve(50, "FV-$_")) for 101 .. 100 + $valves;
}
my $begin = time;
my $start = int($begin) - ($rate ? 0 : 86400);
my $total = ($rate || 20000) * $seconds;
printf STDERR "wrong from %.1f to %.1f\n", $begin + $seconds / 3, $begin + 2 * $seconds / 3 if $wrong;
for (my $n = 0; $n < $total;) {
  my $text = "";
  my $part = $rate ? $rate / 20 : 1800;
  for (my $i = 0; $i < $part; ++$i, ++$n) {
    my $t = $rate ? time : $start + int($n / 1800);
    if ($port) {
      my $v = 50 + $n % 37;
      if ($sparkplug) {
        $text .= payload("DDATA/FV-" . (101 + $n / 6 % $valves), of_valve($v));
        $n += 5, $i += 5;
        next;
      }
      $text .= packet(0x30, pack("n/a*", "plant/FV-" . (101 + $n / 6 % $valves)) .
        sprintf('{"op":%d,"x":%d,"f":%d,"p1":%d,"p2":%d,"t1":%d,"t":%.3f}', ($v) x 6, $t));
      $n += 5, $i += 5;
      next;
    }
    my ($tag, $quality) = ($tags[$n % @tags], "good");
    my $source = "";
    if ($wrong) {  # For the second third of the time.
      my $now = $n > $total / 3 && $n <= 2 * $total / 3;
      next if $now && $tag eq "FV-150.P1";
      $quality = "bad" if $now && $tag =~ /^FV-250/;
      ($t, $source) = ($t + ($now ? 90 : 0), ",\"source\":\"plc\"") if $tag =~ /^FV-200/;
    }
    $text .= sprintf("{\"tag\":\"%s\",\"t\":%.3f,\"v\":%.3f,\"q\":\"%s\"%s}\n",
      $tag, $t, 50 + $n % 37, $quality, $source);
  }
  print $out $text;
  if ($rate) {
    my $ahead = $begin + $n / $rate - time;
    sleep($ahead) if $ahead > 0;
  }
}
END
ticks() { awk '{ print $14 + $15 }' "/proc/$1/stat"; }
peak_mb() { awk '/VmHWM/ { print int($2 / 1024) }' "/proc/$1/status"; }
share() {  # TICKS BEGIN END: % of a core
  awk -v t="$1" -v hz="$(getconf CLK_TCK)" -v s="$2" -v e="$3" \
    'BEGIN { printf "%.1f %% of a core", 100 * t / hz / (e - s) }'
}
await() { timeout 60 sh -c 'until grep -q "$0" "$1"; do sleep 0.1; done' "$1" "$2" || fail "no $1"; }
begin_gateway() {  # OPTIONS
  "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml "$@" --json \
    >totals.json 2>gateway.log &
  gateway=$!
}
# Ends the gateway, and says what came of WHAT from $begin to $end.
report() {  # WHAT
  local used hwm
  used=$(($(ticks $gateway) - before))
  hwm=$(peak_mb $gateway)
  exec 3>&-
  [[ $1 != MQTT* ]] || kill $gateway
  wait $gateway
  gateway=
  stop
  echo "$1: $(awk '{ gsub(/[",:]/, " ") }
    $1 ~ /^(readings|samples|late|not_sent)$/ { printf "%s %d, ", $1, $2 }' totals.json
  )received $(sed -n 's/.*monitor_status.*received=\([0-9]*\).*/\1/p' monitor.log |
    tail -n 1), gateway $(share $used $begin $end), $hwm MB"
}
by_lines() {  # READINGS a second
  start
  mkfifo -m 600 pipe
  begin_gateway --lines pipe
  exec 3>pipe
  before=0 begin=$(date +%s.%N)
  perl feed.pl "$1" "$seconds" $valves >&3
  sleep 0.2
  end=$(date +%s.%N)
  report "lines, ${1/#0/as many as go} readings/s for $(awk "BEGIN { printf \"%.1f\", $end - $begin }") s"
  rm pipe
}
by_mqtt() {  # READINGS a second [OPTIONS]
  printf 'listener %s 127.0.0.1\nallow_anonymous true\nuser %s\nmax_queued_messages 0\n' \
    $port "$(id -un)" >broker.conf
  mosquitto -c broker.conf >mosquitto.log 2>&1 &
  broker=$!
  start
  begin_gateway --mqtt "mqtt://127.0.0.1:$port" "${@:2}"
  await broker_connected gateway.log
  sleep 1
  before=$(ticks $gateway) begin=$(date +%s.%N)
  perl feed.pl "$1" "$seconds" $valves $port ${2:+"" "$2"}
  sleep 1
  end=$(date +%s.%N)
  report "MQTT${2:+ $2}, $1 readings/s for $seconds s"
  kill $broker
  wait $broker || true
  broker=
}
by_opcua() {
  local used lag
  cp "$tree/gateway/opcua/client.mjs" "$tree/tests/gateway/plant_server.mjs" .
  ln -s "$modules" node_modules
  "$bin/fdi-simulator" run --no-publish --duration $((seconds + 120)) -o plant.csv \
    --log-level error >/dev/null
  node plant_server.mjs $port $valves 1 plant.csv 2>server.log &
  server=$!
  await ready server.log
  start
  mkfifo -m 600 pipe copy
  begin_gateway --lines pipe
  # Prints the age of each reading at the moment the client prints it.
  perl -MTime::HiRes=time -MTime::Local -ne '
    next unless /"t":"(\d+)-(\d+)-(\d+)T(\d+):(\d+):([\d.]+)Z","v"/ && $. > 3600;
    my $lag = time - timegm(0, $5, $4, $3, $2 - 1, $1) - $6;
    $sum += $lag; ++$n; $most = $lag if $lag > $most;
    END { printf "%.2f s, at most %.2f s", $sum / $n, $most }' <copy >lag.txt &
  lag=$!
  FDI_GATEWAY=$bin/fdi-gateway node client.mjs plant.toml \
    --endpoint "opc.tcp://127.0.0.1:$port" 2>client.log > >(exec tee copy >pipe) &
  client=$!
  await "$((6 * valves)) of" client.log
  before=$(ticks $gateway) used=$(ticks $client) begin=$(date +%s.%N)
  sleep "$seconds"
  end=$(date +%s.%N)
  used="$(share $(($(ticks $client) - used)) "$begin" "$end"), $(peak_mb $client) MB"
  kill $client
  wait $client || true
  client=
  wait $lag || true
  report "OPC UA, $((6 * valves)) nodes at 1 Hz for $seconds s"
  echo "  client $used; a reading is printed after $(cat lag.txt)"
  kill $server
  server=
  rm pipe copy
}
wrong() {
  start --record
  mkfifo -m 600 pipe
  sed 's/^topic.*/report = "periodic"/' plant.toml >periodic.toml
  "$bin/fdi-gateway" --domain "$domain" in --plant periodic.toml --lines pipe \
    >totals.txt 2>gateway.log &
  gateway=$!
  perl feed.pl 1800 "$seconds" $valves 0 1 >pipe 2>wrong.txt
  wait $gateway
  gateway=
  stop
  echo "one thing wrong at each of three valves, $(cat wrong.txt)"
  grep -E ' (tag|source)_' gateway.log
  echo "valves of which samples or signals are missing:"
  sqlite3 -readonly "$FDI_DATA/runs.db" ".load $bin/../lib/fdi_samples" "
    with valve as (select valve_id, count(*) samples, sum(p1 is null) p1, sum(x is null) x
      from sample group by 1)
    select valve_id, samples || ' of ' || max(samples) over () || ' samples',
      p1 || ' without P1', x || ' without X' from valve order by samples + 0" |
    awk -F"|" '$3 + 0 || $4 + 0 || split($2, n, " ") && n[1] < n[3] - 1'
  rm pipe
}
way=${4:-}
case ${way:-lines} in lines) for rate in 1800 10000 0; do by_lines $rate; done ;; esac
case ${way:-mqtt} in
mqtt) ! command -v mosquitto >/dev/null || for rate in 1800 10000; do by_mqtt $rate; done ;;
esac
case ${way:-sparkplug} in
sparkplug)
  ! command -v mosquitto >/dev/null ||
    for rate in 1800 10000; do by_mqtt $rate --sparkplug PLANT; done
  ;;
esac
[ -z "$modules" ] || case ${way:-opcua} in opcua) by_opcua ;; esac
case ${way:-wrong} in wrong) wrong ;; esac
