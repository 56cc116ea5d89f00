#!/usr/bin/env bash
# Draws our targets and what each links, from the build itself, in an order in
# which every arrow points down; what is reached through another one is left
# out. With --check compares with the drawing in docs/architecture.md.
# Usage: layers.sh [--check]
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cmake --preset release -B "$folder/build" -DBUILD_TESTING=OFF \
  --graphviz="$folder/targets" >"$folder/log" 2>&1 || {
  cat "$folder/log"
  exit 1
}
grep -oE '// fdi[-_a-z]+ -> fdi[-_a-z]+' "$folder/targets" |
  sed 's|^// ||; s| -> | |' | grep -v fdi_idl_types | sort -u >"$folder/arrows"
# tsort fails on a loop: with one, some arrow would point up.
tsort "$folder/arrows" >"$folder/order"

awk -v order="$folder/order" '
  { links[$1] = links[$1] " " $2; linked[$1, $2] = 1 }
  function reaches(from, to,   list, n, i) {
    n = split(links[from], list, " ")
    for (i = 1; i <= n; ++i)
      if (list[i] == to || reaches(list[i], to)) return 1
    return 0
  }
  END {
    while ((getline target < order) > 0) {
      text = ""
      n = split(links[target], list, " ")
      for (i = 1; i <= n; ++i) {
        direct = 1
        for (k = 1; k <= n; ++k)
          if (k != i && reaches(list[k], list[i])) direct = 0
        if (direct) text = text (text == "" ? "" : ", ") list[i]
      }
      printf "    %-18s %s\n", target, text == "" ? "" : "-> " text
    }
  }' "$folder/arrows" | sed 's/ *$//' >"$folder/drawing"

if [ "${1:-}" != --check ]; then
  cat "$folder/drawing"
  exit 0
fi
sed -n '/<!-- layers -->/,/<!-- end -->/p' docs/architecture.md |
  grep '^    ' | diff "$folder/drawing" - || {
  echo "docs/architecture.md: the layers are not those of the build;" \
    "tests/layers.sh prints them"
  exit 1
}
