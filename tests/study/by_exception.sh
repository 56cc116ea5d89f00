#!/usr/bin/env bash
# A loop by exception with a dead band of 0.5 %, as a file and as a row a second
# with what was told last, by a set of such data and by one of every reading: no
# episode in a healthy day, each fault is detected, and a rod that rests while
# nothing is told of it is friction.
# Usage: by_exception.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
bin=$(realpath "${1:?folder of the programs}")
out=$(KINDS="exception 0.5 0
held 0.5 0" "$(dirname "$0")/../../bench/by_exception.sh" "$bin" seed=6200)
fail() {
  printf '%s\n' "by_exception: $*" "$out"
  exit 1
}
[ "$(grep -c '^thin: .* rest on readings' <<<"$out")" = 2 ] || fail "not thin"
[ "$(grep -cE '^episodes without fault: +0 in 24' <<<"$out")" = 4 ] || fail "false episodes"
[ "$(grep -cE '^[a-z0-9.-]+/(leak|meter|stuck)\.csv .* yes ' <<<"$out")" = 12 ] || fail "not detected"
[ "$(grep -cE '/stuck\.csv .* f4 *$' <<<"$out")" = 4 ] || fail "the rod"
