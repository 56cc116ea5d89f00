#!/usr/bin/env bash
# Runs the commands of docs/tutorial.md, README.md or another page, as they stand
# there, in an empty directory: blocks `sh` one after the other, a block
# `sh service` in the background until the end, `sh long` with
# FDI_TUTORIAL_LONG=1, not `sh admin`. Every command has to succeed, and the
# story has to come out as told.
# Usage: tutorial.sh BIN_DIRECTORY [tutorial|plant|README]
set -euo pipefail
bin=$(cd "$1" && pwd)
page=${2:-tutorial}
tree=$(cd "$(dirname "$0")/.." && pwd)
text=$tree/docs/$page.md
[ "$page" != README ] || text=$tree/README.md
source "$tree/tests/domain.sh"
out=$(mktemp -d)
finish() {
  kill "${service:-}" 2>/dev/null || true
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "$page: $*" >&2
  tail -n 5 "$out"/*.log >&2
  exit 1
}

# What differs from a new user's machine: where the campaigns are, ports that
# others may have, the domain.
adapt() {
  sed -e "s#/usr/share/fdi/campaigns#$out/campaigns#g" \
    -e 's#=127\.0\.0\.1:8080#=127.0.0.1:0#' \
    -e 's#--console$#--console=127.0.0.1:0#' \
    -e "s#^\(fdi-monitor\|fdi-simulator\) #&--domain $domain #"
}
# A file for each block, in order: 01.sh, 02.service, 03.admin, ...
awk -v out="$out" '/^```sh/ {kind = $2 == "" ? "sh" : $2; ++n; next}
  /^```/ {kind = ""} kind != "" {print > sprintf("%s/%02d.%s", out, n, kind)}' \
  "$text"

unset FDI_DATA
export PATH=$bin:$PATH
mkdir "$out/home"
ln -s "$tree/campaigns" "$out/campaigns"  # A path without blanks.
ln -s "$tree/campaigns" "$out/home/campaigns"
cd "$out/home"
for block in "$out"/[0-9][0-9].*; do
  adapt <"$block" >"$out/block"
  [[ $block != *.long || -n ${FDI_TUTORIAL_LONG:-} ]] || continue
  case $block in
  *.sh | *.long)
    # One shell's directory is the next one's, as in a terminal.
    echo 'pwd >"$OUT/directory"' >>"$out/block"
    OUT=$out timeout 600 bash -e "$out/block" >>"$out/commands.log" 2>&1 ||
      fail "$(cat "$block")"
    cd "$(cat "$out/directory")"
    ;;
  *.service)
    sed -i '1s/^/exec /' "$out/block"
    bash "$out/block" >"$out/service.log" 2>&1 &
    service=$!
    for _ in $(seq 200); do
      ! grep -q monitor_ready "$out/service.log" || break
      kill -0 $service 2>/dev/null || fail "the service has ended"
      sleep 0.1
    done
    ;;
  esac
done

# The page of the service answers.
port=$(sed -n 's/.*console_listening address=127.0.0.1:\([0-9]*\).*/\1/p' \
  "$out/service.log")
exec 3<>"/dev/tcp/127.0.0.1/${port:?}"
printf 'GET / HTTP/1.0\r\nHost: 127.0.0.1:%s\r\n\r\n' "$port" >&3
head -n 1 <&3 | grep >/dev/null ' 200 ' || fail "the page does not answer"

kill -TERM "$service"
wait "$service" || fail "the monitor ended with $?"
service=
# Checks the output that README shows.
check_README() {
  fdi-store history list | grep >/dev/null 'f19 *Flow transmitter wrong *sure' ||
    fail "the history is not as README shows it"
  fdi-store worklist | grep >/dev/null '^1. FV-101 ' ||
    fail "the work list is not as README shows it"
}
check_tutorial() {
  found=$(fdi-store history list --json)
  grep -q '"fault": "f19"' <<<"$found" || fail "no f19 in the history: $found"
  grep -q '"label": "f19"' <<<"$found" || fail "no label in the history: $found"
  [ "$(grep -c '"episode_id"' <<<"$found")" -eq 1 ] || fail "not one episode: $found"
  [ -s episode.png ] || fail "no picture"
  fdi-store models list | grep >/dev/null '^paper@2 *yes' || fail "paper@2 is not active"
}
check_plant() {
  local list worst
  list=$(fdi-store valves list)
  grep -q 'FIC103 .*no_response' <<<"$list" || fail "FIC103 answers: $list"
  grep -q 'FIC101 .*undetermined' <<<"$list" || fail "FIC101: $list"
  worst=$(fdi-store worklist --audit-windows 3 --csv | sed -n 2p)
  grep -q 'FIC103.*no_response' <<<"$worst" || fail "not the worst: $worst"
  [ -s FIC103.png ] && [ -s worklist.html ] || fail "no picture or no page"
}
"check_$page"
echo "$page: $(ls "$out"/*.sh | wc -l) blocks in $SECONDS s"
