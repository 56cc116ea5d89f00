#!/usr/bin/env bash
# Every top-level folder has a README.md of at most 40 lines, and what it names
# in backquotes with a file's ending or a slash at its end is there.
set -euo pipefail
cd "$(dirname "$0")/.."
failed=0
for folder in $(git ls-files | grep / | cut -d/ -f1 | grep -v '^\.' | sort -u); do
  page=$folder/README.md
  if [ ! -f "$page" ]; then
    echo "$page is missing"
    failed=1
    continue
  fi
  lines=$(wc -l <"$page")
  [ "$lines" -le 40 ] || { echo "$page: $lines lines, at most 40"; failed=1; }
  for name in $(grep -oE '`[A-Za-z0-9_/.-]+(\.(h|cpp|sh|toml|idl|sql|cmake)|/)`' \
    "$page" | tr -d '`'); do
    [ -e "$folder/$name" ] || [ -e "$name" ] ||
      git ls-files "$folder/*/$name" | grep -q . ||
      { echo "$page names $name, which is not there"; failed=1; }
  done
done
exit $failed
