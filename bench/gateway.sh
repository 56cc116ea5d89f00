#!/usr/bin/env bash
# Measures the cost of fdi-gateway in: 300 valves of 6 tags by lines, each tag once a
# second, then 10 000 readings a second; and where it ends, as fast as a pipe
# gives them. Beside a monitor that records nothing and has no models.
# Usage: gateway.sh FOLDER-OF-PROGRAMS [SECONDS]
set -euo pipefail
seconds=${2:-30}
valves=300
source "$(dirname "$0")/../tests/system/programs.sh" "$1"
gateway=
finish() {
  exec 2>/dev/null
  kill -9 ${gateway:-} ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT

{
  printf '[defaults]\nop = "{loop}.OP"\nx = "{loop}.ZT"\nf = "{loop}.FT"\n'
  printf 'f_unit = "m3/h"\np1 = "{loop}.P1"\np2 = "{loop}.P2"\nt1 = "{loop}.T1"\n'
  for i in $(seq $valves); do printf '[[loop]]\nname = "V%d"\n' "$i"; done
} >plant.toml
# READINGS a second for SECONDS; 0: as fast as they are taken, stamps a second
# apart for 1800 readings.
cat >feed.pl <<'END'
use strict;
use Time::HiRes qw(time sleep);
my ($rate, $seconds, $valves) = @ARGV;
$| = 1;
my @tags = map { my $v = $_; map { "V$v.$_" } qw(OP ZT FT P1 P2 T1) } 1 .. $valves;
my $begin = time;
my $start = int($begin) - ($rate ? 0 : 86400);
my $total = ($rate || 20000) * $seconds;
for (my $n = 0; $n < $total;) {
  my $text = "";
  my $part = $rate ? $rate / 20 : 1800;
  for (my $i = 0; $i < $part; ++$i, ++$n) {
    my $t = $rate ? time : $start + int($n / 1800);
    $text .= sprintf("{\"tag\":\"%s\",\"t\":%.3f,\"v\":%.3f,\"q\":\"good\"}\n",
      $tags[$n % @tags], $t, 50 + $n % 37);
  }
  print $text;
  if ($rate) {
    my $ahead = $begin + $n / $rate - time;
    sleep($ahead) if $ahead > 0;
  }
}
END
measure() {  # READINGS a second
  start
  mkfifo -m 600 pipe
  "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml --lines pipe \
    --json >totals.json 2>gateway.log &
  gateway=$!
  exec 3>pipe
  local begin end ticks hwm
  begin=$(date +%s.%N)
  perl feed.pl "$1" "$seconds" $valves >&3
  sleep 0.2
  ticks=$(awk '{ print $14 + $15 }' "/proc/$gateway/stat")
  hwm=$(awk '/VmHWM/ { print int($2 / 1024) }' "/proc/$gateway/status")
  end=$(date +%s.%N)
  exec 3>&-
  wait "$gateway"
  gateway=
  stop
  rm pipe
  awk -v rate="$1" -v ticks="$ticks" -v hz="$(getconf CLK_TCK)" -v b="$begin" \
    -v e="$end" -v hwm="$hwm" '
    { gsub(/[",:]/, " ") } $1 ~ /^(readings|samples|late|not_sent)$/ { n[$1] = $2 }
    END { s = e - b
      printf "%s readings/s asked: %d in %.1f s, %.1f %% of a core, %d MB, " \
        "%d samples, %d late, %d not sent\n", rate ? rate : "all", n["readings"],
        s, 100 * ticks / hz / s, hwm, n["samples"], n["late"], n["not_sent"] }
  ' totals.json
}
for rate in 1800 10000 0; do measure $rate; done
