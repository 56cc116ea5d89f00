#!/usr/bin/env bash
# The line with GNU parallel of docs/plant.md on a small table, as it stands
# there; the parts have to make together what one run makes.
#
#     tests/plant_parallel.sh build/release/bin
set -euo pipefail
bin=$(realpath "$1")
root=$(cd "$(dirname "$0")/.." && pwd)
if ! command -v parallel >/dev/null; then
  echo "skipped: GNU parallel is not found (Debian: apt install parallel)"
  exit 77
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export HOME=$work PATH=$bin:$PATH
unset FDI_DATA

line=$(grep -E '^ +parallel fdi-trainer ' "$root/docs/plant.md")
{
  echo 'name,file,op,pv'
  for loop in 1 2 3 4 5; do
    echo "FIC$loop,FIC$loop.csv,OP,PV"
    awk -v k="$loop" 'BEGIN {
      srand(k)
      print "t_s,OP,PV"
      for (t = 0; t < 2000; t += 10)
        print t "," 50 + 5 * sin(t / 300) + rand() "," 80 + 3 * cos(t / 300)
    }' >"FIC$loop.csv"
  done
} >plant.csv
# The page has a TOML table.
eval "${line/plant.toml/plant.csv}" >parallel.txt
fdi-trainer --data whole onboard --plant plant.csv >/dev/null
watched() {
  fdi-store "$@" valves list --json | grep -vE '_utc|_ns' | sort
}
watched --data whole >whole.txt
grep -q FIC5 whole.txt
watched | diff whole.txt -
