#!/usr/bin/env bash
# Counts what a user meets: verbs, their options, the options that one --help
# shows, and names that mean two things. Reads the help texts, so it counts what
# is there and not what is declared. Fails beyond the limits below, which are to
# be lowered when something goes.
# Usage: surface.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
bin=${1:?folder of the programs}
max_verbs=53
max_options=288
max_shown=22

# The placeholders that a name may have, wherever it occurs.
meanings='
--valve GLOB|ID
'

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# walk PROGRAM [WORD...]: a line "PROGRAM WORDS|OPTION|PLACEHOLDER" for each
# option of each verb, and "PROGRAM WORDS||" for the verb itself.
walk() {
  local text verbs
  text=$("$bin/$1" "${@:2}" --help)
  verbs=$(sed -n '/^Verbs:/,/^$/s/^  \([a-z][a-z-]*\).*/\1/p' <<<"$text")
  if [ -n "$verbs" ]; then
    for verb in $verbs; do walk "$@" "$verb"; done
    return
  fi
  echo "$*||"
  # An option that is wider than its column stands in a line of its own.
  sed -nE 's/^  (-[a-zA-Z], ?)?(--[a-z][a-z0-9-]*)( ([^ ]+))?.*/\2|\4/p' \
    <<<"$text" | grep -v '^--help' | sed "s/^/$*|/" || true
}

for program in fdi-store fdi-trainer fdi-monitor fdi-simulator fdi-gateway; do
  walk "$program"
done >"$folder/surface"

verbs=$(grep -c '||$' "$folder/surface")
options=$(grep -vc '||$' "$folder/surface")
names=$(grep -v '||$' "$folder/surface" | cut -d'|' -f2 | sort -u | wc -l)
shown=$(grep -v '||$' "$folder/surface" | cut -d'|' -f1 | uniq -c | sort -rn |
  head -1)
echo "$verbs verbs, $options options under $names names;" \
  "most in one help:$(sed 's/^ */ /' <<<"$shown")"

failed=0
refuse() {
  echo "surface: $*"
  failed=1
}
[ "$verbs" -le "$max_verbs" ] || refuse "$verbs verbs, at most $max_verbs"
[ "$options" -le "$max_options" ] ||
  refuse "$options options, at most $max_options"
[ "$(awk '{ print $1 }' <<<"$shown")" -le "$max_shown" ] ||
  refuse "more than $max_shown options in the help of:$shown"
awk -F'|' -v meanings="$meanings" '
  BEGIN {
    n = split(meanings, line, "\n")
    for (i = 1; i <= n; ++i)
      if (split(line[i], word, " ") == 2) takes[word[1]] = word[2]
  }
  $2 in takes {
    allowed = takes[$2] == "-" ? "^$" : "^(" takes[$2] ")$"
    if ($3 !~ allowed)
      print "  " $2 " of " $1 " takes " ($3 == "" ? "nothing" : $3) \
        ", elsewhere " (takes[$2] == "-" ? "nothing" : takes[$2])
  }' "$folder/surface" >"$folder/clashes"
if [ -s "$folder/clashes" ]; then
  refuse "a name that means two things:"
  cat "$folder/clashes"
fi
exit $failed
