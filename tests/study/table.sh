#!/usr/bin/env bash
# bench/table.sh on the paper's ten scenarios: it is killed once the first part
# is there, goes on without making that anew, and skips by name a method whose
# package is missing. Other seeds, another rate and another training join the
# page.
# Usage: table.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
bin=$(realpath "${1:?folder of the programs}")
cd "$(dirname "$0")/../.."
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export METHODS="ours early position forest arx-cusum"
# Python finds this one first.
mkdir -p "$work/python/sklearn"
echo 'raise ImportError' >"$work/python/sklearn/__init__.py"
export PYTHONPATH=$work/python
fail() {
  echo "table: $*"
  cat "$work/log" "$work/page.md" 2>/dev/null
  exit 1
}

# In a session of its own, so that its children end with it.
setsid bench/table.sh --quick -o "$work/page.md" "$bin" "$work/dir" paper \
  >"$work/log" 2>&1 &
first=$!
until [ -f "$work/dir/parts/paper/ours.csv" ]; do
  kill -0 $first 2>/dev/null || fail "ended before its first part was there"
  sleep 0.05
done
kill -KILL -- -$first
{ wait $first || :; } 2>/dev/null
made=$(stat -c %.Y "$work/dir/parts/paper/ours.csv")

bench/table.sh --quick -o "$work/page.md" "$bin" "$work/dir" paper \
  >"$work/log" 2>&1 || fail "did not go on"
[ "$(stat -c %.Y "$work/dir/parts/paper/ours.csv")" = "$made" ] ||
  fail "made a part anew"
grep -qE '^\| ours \| 10 \(72 to 100 %\) \| 0 \| 10 ' "$work/page.md" ||
  fail "ours are not ten of ten"
grep -q '^| without the early test | 10 ' "$work/page.md" ||
  fail "no row without the early test"
grep -q '^| random forest | skipped: python3-.* is missing' "$work/page.md" ||
  fail "no row says which package is missing"
grep -q '^| ARX with CUSUM | [0-9]' "$work/page.md" || fail "no row of ARX"
grep -q '^paper,ours,detected,10,' "$work/page.csv" || fail "no CSV"

METHODS="ours position" CURVES="position" bench/table.sh --quick \
  --retrainings 1 -o "$work/page.md" "$bin" "$work/dir" paper second curves \
  retrainings >"$work/log" 2>&1 || fail "no second seeds"
cmp -s "$work/dir/parts/paper/ours.csv" "$work/dir/parts/paper-second/ours.csv" &&
  fail "the second seeds are the first"
grep -q '^paper,ours,detected_second,' "$work/page.csv" ||
  fail "no row of the second seeds"
grep -q '^paper,ours,trainings,1,' "$work/page.csv" ||
  fail "no row of another training"
grep -q '^clustering_seed = 101$' "$work/dir/paper-training1.toml" ||
  fail "the other training began as the first"
[ "$(ls "$work/dir/parts" | grep -c '^paper-at')" -eq 3 ] ||
  fail "not three other rates"
! bench/table.sh "$bin" "$work/dir" paper >"$work/log" 2>&1 ||
  fail "mixed a quick folder with a whole run"
echo "table: killed, resumed, one method skipped by name, other seeds joined"
