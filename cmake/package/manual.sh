#!/usr/bin/env bash
# Writes the manual pages of a program, its groups and its verbs from their
# --help-all: PROGRAM.1, PROGRAM-VERB.1 ... Usage: manual.sh PROGRAM VERSION FOLDER
set -euo pipefail
program=$(realpath "$1") version=$2 folder=$3
name=$(basename "$program")
wrapped=$(mktemp -d)
trap 'rm -rf "$wrapped"' EXIT

pages() {  # VERB...: writes the page of the verb and those below it
  local page=$name help verb verbs see=()
  for verb in "$@"; do page+=-$verb; done
  help=$("$program" "$@" --help)
  mapfile -t verbs < <(
    sed -n '/^Verbs:/,/^$/ s/^  \([a-z][a-z-]*\) .*/\1/p' <<<"$help")

  # help2man wants one word to call, which also names the page.
  printf '#!/bin/sh\nexec "%s" %s "$@"\n' "$program" "$*" >"$wrapped/$page"
  chmod +x "$wrapped/$page"
  for verb in "${verbs[@]}"; do see+=("$page-$verb"); done
  if [ $# -gt 0 ]; then
    see+=("${page%-"${!#}"}")
  else
    for verb in fdi-monitor fdi-simulator fdi-store fdi-trainer fdi-gateway; do
      [ "$verb" = "$name" ] || see+=("$verb")
    done
  fi
  {
    if [ $# -gt 0 ]; then
      printf '[>options]\n.PP\nOptions of every verb, such as \\fB\\-\\-data\\fR and '
      printf '\\fB\\-\\-json\\fR, are in \\fB%s\\fR(1).\n\n' "$name"
    fi
    cat <<'END'
[exit status]
0: success. 1: failure. 2: wrong usage or configuration. 3: data, database or
permission. 4: DDS. 5: not found.

[files]
The data directory holds the SQLite databases \fIruns.db\fR (recorded and
imported samples), \fImodels.db\fR (model sets and valves) and \fIhistory.db\fR
(fault episodes with their evidence).

[see also]
END
    printf '\\fB%s\\fR(1)\n' "${see[@]}" | sed '$!s/$/,/'
  } >"$wrapped/include"
  help2man --help-option=--help-all --no-info --section=1 --name="$(head -1 <<<"$help")" \
    --source="fdi $version" --version-string="$version" --manual="fdi manual" \
    --include="$wrapped/include" --output="$folder/$page.1" "$wrapped/$page"
  # The lines of the examples stay as they are.
  sed -i -e '/^\.SH EXAMPLES/a .nf' -e '/^\.SH "SEE ALSO"/i .fi' \
    "$folder/$page.1"

  for verb in "${verbs[@]}"; do pages "$@" "$verb"; done
}

mkdir -p "$folder"
pages
