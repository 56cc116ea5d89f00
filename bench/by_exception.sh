#!/usr/bin/env bash
# Readings by exception, compressed or held, in the kinds of by_exception.py:
# what a set sees that was made of such data, and one that was made of every
# reading.
#
#     [KINDS="held 0.5 0"] bench/by_exception.sh build/release/bin [KEY=VALUE...]
#
# For each kind, dead band and least time: what onboarding says, and for both sets
# episodes in a healthy day, and for each fault whether and when it is detected,
# how it is named at the end and how surely. Keys are those of by_exception.py.
set -euo pipefail
bin=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
export FDI_DATA=$work/data
kinds="exception 0.1 0
exception 0.25 5
exception 0.5 0
exception 0.5 25
exception 1 0
door 0.1 0
door 0.25 0
held 0.1 0
held 0.25 0
held 0.25 5
held 0.5 0
held 1 0"
# As the loop itself, for a set of every reading.
"$here/by_exception.py" every held 0 0 "${@:2}" >/dev/null
"$bin/fdi-trainer" onboard --valve every --no-coverage --file every/taught.csv \
  >report 2>log || cat log

score() {
  "$bin/fdi-trainer" evaluate "$@" --file "$dir/leak.csv" \
    --file "$dir/meter.csv" --file "$dir/stuck.csv" 2>log | sed -n '/^run/,/^$/p'
  "$bin/fdi-trainer" evaluate "$@" --assume-normal --file "$dir/day.csv" 2>log |
    grep -E '^(episodes without|LIVE|BAD_INPUT|UNCOVERED)'
}

while read -r kind band least; do
  dir=$kind-$band-$least
  map=()
  grid=()
  echo "== $kind, dead band $band %, at least $least s:" \
    "$("$here/by_exception.py" "$dir" "$kind" "$band" "$least" "${@:2}")"
  if [ "$kind" != held ]; then
    "$bin/fdi-store" runs sniff "$dir/taught.csv" -o "$dir/tags.toml" >/dev/null
    map=(--map "$dir/tags.toml")
    # Between the vertices that a swinging door leaves, its values are on lines.
    grid=(--resample "1s:$([ "$kind" = door ] && echo linear || echo hold):11min")
  fi
  echo "-- a set of every reading"
  score --model-set every "${map[@]}" "${grid[@]}"
  echo "-- a set of such readings"
  if ! "$bin/fdi-trainer" onboard --valve "$dir" --no-coverage "${map[@]}" \
    --file "$dir/taught.csv" >report 2>log; then
    grep -h 'error:' log || cat log
    continue
  fi
  grep -E '^(usable|thin|X |F )' report
  score --model-set "$dir" "${map[@]}"
done <<<"${KINDS:-$kinds}"
