#!/usr/bin/env bash
# The seconds of a newcomer's first hour that are the machine's: from the first
# command to an alarm on the page, from a file of a valve's own to its first
# judged sample, from a table of loops to a work list. It types what README,
# docs/onboarding.md and docs/plant.md show; the programs are those in PATH.
# Usage: first_hour.sh CAMPAIGNS [FILE.csv [VALVE]]
#   CAMPAIGNS  campaigns/, or /usr/share/fdi/campaigns of the package
#   FILE.csv   a record of normal operation (default: simulated, 25 minutes)
set -euo pipefail
campaigns=$(realpath "${1:?folder of the campaigns}")
file=${2:+$(realpath "$2")} valve=${3:-FV-201}
folder=$(mktemp -d) monitor= feed=
trap 'kill $monitor $feed 2>/dev/null; wait; rm -rf "$folder"' EXIT
cd "$folder"
export FDI_DATA=$folder/data

now() { date +%s.%N; }
took() { echo "$1: $(echo "$2 $(now)" | awk '{printf "%.1f s", $2 - $1}')"; }
# The answer of the page to GET $1.
page() {
  exec 3<>/dev/tcp/127.0.0.1/8080
  printf 'GET %s HTTP/1.0\r\nHost: localhost\r\n\r\n' "$1" >&3
  cat <&3
}
# Waits up to a minute until the page's answer to $1 holds the pattern $2.
until_page() {
  for ((i = 0; i < 600; i++)); do
    if page "$1" 2>/dev/null | grep -E "$2" >/dev/null; then return; fi
    sleep 0.1
  done
  { echo "first_hour: $1 has no $2" && tail -n 3 ./*.log; } >&2
  return 1
}
serve() {
  fdi-monitor run "$@" --console=127.0.0.1:8080 >monitor.log 2>&1 &
  monitor=$!
  until_page / 'HTTP/1.. 200'
}

start=$(now)
fdi-trainer train --campaign "$campaigns/paper.toml" >train.log 2>&1
serve --model-set paper
fdi-simulator run --valve FV-101 --parameters paper-operating-point \
  --duration 600 --speed 20 --set excitation.amplitude_pct=12 \
  --set excitation.period_s=60 --fault f19:abrupt@120:strength=0.5 \
  >simulate.log 2>&1 &
feed=$!
until_page /api/v1/alarms '"fault":"f19"'
took "first command to the named alarm on the page" "$start"
wait $feed

if [ -z "$file" ]; then
  file=$folder/DAY.csv
  fdi-simulator run --scenario "$campaigns/operation/normal.toml" \
    --valve "$valve" --duration 1500 --no-publish -o "$file" >/dev/null 2>&1
fi
start=$(now)
fdi-store runs sniff "$file" -o tags.toml >sniff.log 2>&1
fdi-trainer onboard --valve "$valve" --file "$file" --map tags.toml \
  >onboard.log 2>&1
fdi-simulator replay --valve "$valve" --file "$file" --map tags.toml \
  --speed 20 >replay.log 2>&1 &
feed=$!
until_page /api/v1/valves \
  "\"id\":\"$valve\",\"state\":\"[A-Z]*\",\"quality\":\"LIVE\""
took "a file of one's own to its first judged sample" "$start"

mkdir plant
cd plant
for loop in FIC101 FIC102 FIC103; do
  fault=$([ $loop != FIC103 ] || echo "--fault f1:abrupt@600")
  # shellcheck disable=SC2086
  fdi-simulator run --no-publish --valve $loop --excitation level-loop \
    --duration 3600 --seed ${loop#FIC} $fault -o $loop.csv >/dev/null 2>&1
done
printf '[defaults]\nfile = "{loop}.csv"\nop = "CV_pct"\npv = "F_t_h"\npv_unit = "t/h"\nx = "X_pct"\nservice = "F"\n' >plant.toml
printf '[[loop]]\nname = "%s"\n' FIC101 FIC102 FIC103 >>plant.toml
start=$(now)
fdi-store valves add --plant plant.toml >/dev/null 2>&1
fdi-trainer onboard --plant plant.toml >/dev/null 2>&1
for loop in FIC101 FIC102 FIC103; do
  fdi-store runs import $loop.csv --valve $loop >/dev/null 2>&1
done
fdi-store worklist --audit-windows 3 2>/dev/null | grep "^[0-9]*\. FIC103" >/dev/null
took "a table of three loops to its work list" "$start"
