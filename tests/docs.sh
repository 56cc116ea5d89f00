#!/usr/bin/env bash
# What the sources log and the documents explain must be the same: every log id
# stands in docs/errors.md and docs/troubleshooting.md, every event that warns
# in the latter, and no id there is one that nothing logs. Links between
# documents lead somewhere.
set -u
cd "$(dirname "$0")/.."
failed=0
complain() {
  echo "docs: $*"
  failed=1
}
sources=$(git ls-files '*.cpp' '*.h' | grep -vE '^(tests|bench)/')

ids=$(sed -nE 's/^  k[A-Za-z]+ = ([0-9]{3}),.*/M\1/p' monitor/throttled_log.h |
  sort -u)
[ -n "$ids" ] || complain "found no log id in the sources"
for id in $ids; do
  grep -qE "^\| $id \|" docs/troubleshooting.md ||
    complain "docs/troubleshooting.md lacks $id"
done
# Ranges there, as "M101 .. M104".
explained=$(sed -n 's/^| \(M[0-9].*\)/\1/p' docs/errors.md | cut -d'|' -f1 |
  sed -E 's/M([0-9]+) \.\. M([0-9]+)/$(seq -f M%g \1 \2)/; s/,/ /g' |
  while read -r line; do eval "printf '%s\n' $line"; done)
for id in $ids; do
  grep -qx "$id" <<<"$explained" || complain "docs/errors.md lacks $id"
done
for id in $(grep -hoE '^\| M[0-9]{3}' docs/troubleshooting.md | tr -d '| '); do
  grep -qx "$id" <<<"$ids" || complain "$id is in the documents alone"
done

events=$(perl -0ne 'while (/Level::k(?:Warning|Error),\s*(?:std::string\(|EventLine\()?\s*"([a-z]+_[a-z_]+)/g) {
  print "$1\n"}
  while (/LogId::k\w+,\s*"([a-z]+_[a-z_]+)/g) { print "$1\n" }' $sources | sort -u)
[ "$(wc -l <<<"$events")" -gt 15 ] || complain "found few events in the sources"
for event in $events; do
  grep -q "\`$event[\` ]" docs/troubleshooting.md ||
    complain "docs/troubleshooting.md lacks $event"
done

for document in README.md docs/*.md docs/examples/*/README.md; do
  for link in $(grep -oE '\]\([^)#:]+\)' "$document" | tr -d ']()'); do
    [ -e "$(dirname "$document")/$link" ] ||
      complain "$document links to $link, which is not there"
  done
done
exit $failed
