#!/usr/bin/env bash
# Draws our folders and what each includes, then our targets and what each
# links, from the sources and the build, in an order in which every arrow points
# down; what is reached through another one is left out. With --check compares
# with the drawings in docs/architecture.md. Fails where an arrow would point up,
# and where the folders have more than 24 arrows.
# Usage: layers.sh [--check]
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# draw ARROWS: each line "FROM TO" of the file becomes part of a drawing.
draw() {
  # tsort fails on a loop: with one, some arrow would point up.
  tsort "$1" >"$folder/order"
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
        printf "    %-19s %s\n", target, text == "" ? "" : "-> " text
      }
    }' "$1" | sed 's/ *$//'
}

git ls-files '*.h' '*.cpp' | grep -vE '^(tests|bench|docs)/' |
  xargs grep -oE '^#include "[a-z]+/' |
  sed -E 's|^([a-z]+)/[^:]*:#include "([a-z]+)/|\1 \2|' |
  awk '$1 != $2' | sort -u >"$folder/includes"
draw "$folder/includes" >"$folder/folders"
arrows=$(grep -oE '[a-z]+(,|$)' "$folder/folders" | wc -l)
arrows=$((arrows - $(grep -vc -e '->' "$folder/folders" || true)))
[ "$arrows" -le 24 ] || {
  cat "$folder/folders"
  echo "layers: $arrows arrows among the folders, 24 at most"
  exit 1
}

cmake --preset release -B "$folder/build" -DBUILD_TESTING=OFF \
  --graphviz="$folder/targets" >"$folder/log" 2>&1 || {
  cat "$folder/log"
  exit 1
}
grep -oE '// fdi[-_a-z]+ -> fdi[-_a-z]+' "$folder/targets" |
  sed 's|^// ||; s| -> | |' | grep -v fdi_idl_types | sort -u >"$folder/arrows"
draw "$folder/arrows" >"$folder/targets_drawn"
{
  cat "$folder/folders"
  echo
  cat "$folder/targets_drawn"
} >"$folder/drawing"

if [ "${1:-}" != --check ]; then
  cat "$folder/drawing"
  exit 0
fi
sed -n '/<!-- layers -->/,/<!-- end -->/p' docs/architecture.md |
  grep '^    ' | diff <(grep . "$folder/drawing") - || {
  echo "docs/architecture.md: the layers are not those of the build;" \
    "tests/layers.sh prints them"
  exit 1
}
