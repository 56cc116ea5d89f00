#!/usr/bin/env bash
# Runs the commands of docs/tutorial.md, README.md or another page, as they stand
# there, in an empty directory: blocks `sh` one after the other, a block
# `sh service` in the background until the end, `sh long` with
# FDI_TUTORIAL_LONG=1, not `sh admin`. Every command has to succeed, and the
# story has to come out as told. 77 without the packages that connect.md takes.
# Usage: tutorial.sh BIN_DIRECTORY [tutorial|plant|README]
#        tutorial.sh BIN_DIRECTORY connect NODE_MODULES
set -euo pipefail
bin=$(cd "$1" && pwd)
page=${2:-tutorial}
tree=$(cd "$(dirname "$0")/.." && pwd)
text=$tree/docs/$page.md
[ "$page" != README ] || text=$tree/README.md
modules=$(realpath -m "${3:-.}")
[ "$page" != connect ] || [ -d "$modules/node-opcua-server" ] || {
  echo "connect: skipped, npm has not fetched node-opcua"
  exit 77
}
source "$tree/tests/domain.sh"
# Neither ephemeral ones, nor those of a test's domain.
port=$((15000 + domain)) plant_port=$((16000 + domain))
out=$(mktemp -d)
services=
finish() {
  exec 2>/dev/null
  for each in $services; do kill -- "-$each" || true; done
  rm -rf "$out"
}
trap finish EXIT
fail() {
  echo "$page: $*" >&2
  tail -n 5 "$out"/*.log >&2
  exit 1
}

# Adapts a new user's commands to this machine: where the campaigns are, ports
# that others may have, the domain, a plant whose seconds are shorter than the
# client's interval.
adapt() {
  sed -e "s#/usr/share/fdi/campaigns#$out/campaigns#g" \
    -e 's#=127\.0\.0\.1:8080#=127.0.0.1:0#' \
    -e 's#--console$#--console=127.0.0.1:0#' \
    -e "s#opc.tcp://HOST:4840#opc.tcp://127.0.0.1:$plant_port --interval 0#" \
    -e "s#^node server.mjs\(.*\) -- #node server.mjs --port $port\1 -- --domain $domain #" \
    -e "s#node alarm_client.mjs#& --endpoint opc.tcp://127.0.0.1:$port#" \
    -e "s#\(^\|| \)\(fdi-monitor\|fdi-simulator\|fdi-gateway\) #&--domain $domain #"
}
await() {  # SECONDS COMMAND...
  local end=$((SECONDS + $1))
  until "${@:2}"; do
    [ $SECONDS -lt $end ] || fail "not within $1 s: ${*:2}"
    sleep 0.2
  done
}
is_up() {  # LOG of the service that was started last.
  kill -0 "${services%% *}" || fail "a service has ended"
  grep -sqE 'monitor_ready|server: ready|of [0-9]+ tags' "$1"
}
# A plant of 20 valves; the flow transmitter of the first one fails. Models of a
# campaign stand in for those that `sh long` makes of 25 minutes of data.
prepare_connect() {
  local minutes=${FDI_TUTORIAL_LONG:+40}
  cp "$tree"/gateway/opcua/*.mjs "$tree/tests/gateway/plant_server.mjs" .
  ln -s "$modules" node_modules
  for fault in "" "--fault f19:abrupt@${FDI_TUTORIAL_LONG:+2}200:strength=0.5"; do
    fdi-simulator run --no-publish --parameters paper-operating-point --seed 7 \
      --set excitation.amplitude_pct=8 --set excitation.period_s=80 \
      --duration "${minutes:-20}m" $fault -o "$out/plant${fault:+-fault}.csv" >/dev/null
  done
  if [ -z "$minutes" ]; then
    fdi-trainer train --campaign "$tree/tests/survival/quick.toml" >"$out/train.log" 2>&1
    fdi-store valves assign FV-101 quick >/dev/null
  fi
}
# The lines for which a reader waits.
before_connect() {
  case $(<"$1") in
  *"client.mjs plant.toml"*)
    node plant_server.mjs $plant_port 20 20 "$out"/plant{-fault,}.csv 2>"$out/plant.log" &
    services="$! $services"
    await 60 grep -sq ready "$out/plant.log"
    ;;
  *onboard*) await 200 has_samples ;;
  *"alarm_client.mjs list"*) await 60 has_alarm ;;
  esac
}
has_samples() { fdi-store runs list --valve FV-101 | awk 'END { exit $4 < 1700 }'; }
has_alarm() { fdi-store history list | grep >/dev/null 'FV-101.*f19'; }
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
! declare -F "prepare_$page" >/dev/null || "prepare_$page"
set -m  # A service is a group of processes.
for block in "$out"/[0-9][0-9].*; do
  adapt <"$block" >"$out/block"
  [[ $block != *.long || -n ${FDI_TUTORIAL_LONG:-} ]] || continue
  ! declare -F "before_$page" >/dev/null || "before_$page" "$block"
  case $block in
  *.sh | *.long)
    # One shell's directory is the next one's, as in a terminal.
    echo 'pwd >"$OUT/directory"' >>"$out/block"
    OUT=$out timeout 600 bash -e "$out/block" >>"$out/commands.log" 2>&1 ||
      fail "$(cat "$block")"
    cd "$(cat "$out/directory")"
    ;;
  *.service)
    log=${block%.service}-service.log
    grep -q '|' "$out/block" || sed -i '1s/^/exec /' "$out/block"
    bash "$out/block" &>"$log" &
    services="$! $services"
    await 60 is_up "$log"
    ;;
  esac
done

# The page of the service answers.
if [ "$page" != connect ]; then
  port=$(sed -n 's/.*console_listening address=127.0.0.1:\([0-9]*\).*/\1/p' \
    "$out"/*-service.log)
  exec 3<>"/dev/tcp/127.0.0.1/${port:?}"
  printf 'GET / HTTP/1.0\r\nHost: 127.0.0.1:%s\r\n\r\n' "$port" >&3
  head -n 1 <&3 | grep >/dev/null ' 200 ' || fail "the page does not answer"
fi
for each in $services; do
  kill -- "-$each"
  status=0
  wait "$each" || status=$?
  # The shell of a pipe ends by the signal.
  [ $status -eq 0 ] || [ "$page $status" = "connect 143" ] ||
    fail "a service ended with $status"
done
services=
# Checks the output that README shows.
check_README() {
  fdi-store history list | grep >/dev/null 'f19 *Flow transmitter wrong *sure' ||
    fail "the history is not as README shows it"
  fdi-store worklist | grep >/dev/null '^1. FV-101 ' ||
    fail "the work list is not as README shows it"
}
# The cells of docs/notebook.md, on the data of the tutorial.
check_notebook() {
  local python=/usr/bin/python3 answer
  $python -c 'import pandas, matplotlib' 2>/dev/null || {
    echo "notebook: skipped (Debian: apt install python3-pandas python3-matplotlib)"
    return
  }
  sed -n '/^```python/,/^```$/{/^```/!p}' "$tree/docs/notebook.md" |
    sed "s#/usr/lib/fdi#$bin/../lib#" >"$out/notebook.py"
  answer=$($python "$out/notebook.py" 2>>"$out/notebook.log") || fail "the notebook"
  for line in ' FV-102 Flow transmitter wrong .* f19 ' '^0\.\(49\|5[0-2]\) of the flow'; do
    grep -q "$line" <<<"$answer" || fail "the notebook prints $answer"
  done
  [ -s samples.png ] || fail "no picture of the notebook"
}
check_tutorial() {
  found=$(fdi-store history list --json)
  grep -q '"fault": "f19"' <<<"$found" || fail "no f19 in the history: $found"
  grep -q '"label": "f19"' <<<"$found" || fail "no label in the history: $found"
  [ "$(grep -c '"episode_id"' <<<"$found")" -eq 1 ] || fail "not one episode: $found"
  [ -s episode.png ] || fail "no picture"
  fdi-store models list | grep >/dev/null '^paper@2 *yes' || fail "paper@2 is not active"
  check_notebook
}
check_plant() {
  local list worst
  list=$(fdi-store valves list)
  grep -q 'FIC103 .*no_response' <<<"$list" || fail "FIC103 answers: $list"
  grep -q 'FIC101 .*undetermined' <<<"$list" || fail "FIC101: $list"
  # A finding of onboarding is on the list before anything else has judged it.
  fdi-store worklist | grep >/dev/null 'FIC103 ' || fail "nothing of FIC103"
  worst=$(fdi-store worklist --audit-windows 3 --csv | sed -n 2p)
  grep -q 'FIC103.*no_response' <<<"$worst" || fail "not the worst: $worst"
  [ -s FIC103.png ] && [ -s worklist.html ] || fail "no picture or no page"
}
check_connect() {
  grep -q '^FV-120.FT$' "$out/commands.log" || fail "not the tags of all valves"
  grep -q '120 of 120 tags' "$out"/*-service.log || fail "not all tags are read"
  grep -q '^FV-101.*Active/Unacknowledged' "$out/commands.log" || fail "no alarm"
  found=$(fdi-store history list --json)
  grep -q '"acked_by": "anna"' <<<"$found" || fail "not acknowledged: $found"
  grep -q '"ack_comment": "fitter is on the way"' <<<"$found" || fail "$found"
}
"check_$page"
echo "$page: $(ls "$out"/*.sh | wc -l) blocks in $SECONDS s"
