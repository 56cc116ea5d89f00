#!/usr/bin/env bash
# The sources and the documents must agree: every log id and every event that warns
# stands in docs/troubleshooting.md, and no id there is one that nothing logs.
# Links between documents lead somewhere, each page is
# in one part of docs/README.md, README.md and docs/results.md keep their
# lengths, README.md's results are lines of docs/results/table.md, docs/method.md
# has a row for every rule of the decision, docs/openapi.yaml has the routes of the
# page, and docs/faults.md and docs/json.md are up to date.
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

# Links lead to a file, and what follows a # to a heading or an id in it.
documents=$(git ls-files README.md CONTRIBUTING.md 'docs/*.md' '*/README.md')
while read -r complaint; do complain "$complaint"; done < <(perl -e '
  use utf8;
  use open qw(:std :encoding(UTF-8));
  my %anchors;
  sub anchors {
    my $page = $_[0];
    return $anchors{$page} if $anchors{$page};
    my %found;
    open(my $in, "<", $page) or return {};
    while (<$in>) {
      $found{$1} = 1 while /<a id="([^"]+)"/g;
      next unless /^#+ (.*?)\s*$/;
      (my $slug = lc $1) =~ s/[^\w\- ]//g;
      $slug =~ tr/ /-/;
      $found{$slug} = 1;
    }
    return $anchors{$page} = \%found;
  }
  for my $page (@ARGV) {
    (my $folder = $page) =~ s{[^/]*$}{};
    open(my $in, "<", $page) or next;
    while (<$in>) {
      while (/\]\(([^)\s:]+)\)/g) {
        my ($file, $anchor) = split /#/, $1;
        my $target = $file eq "" ? $page : $folder . $file;
        if (!-e $target) {
          print "$page links to $file, which is not there\n";
        } elsif (defined $anchor && !anchors($target)->{$anchor}) {
          print "$page links to $1, a heading that is not there\n";
        }
      }
    }
  }' $documents)

words=$(wc -w <README.md)
[ "$words" -le 700 ] || complain "README.md has $words words, at most 700"
lines=$(wc -l <docs/results.md)
[ "$lines" -le 120 ] || complain "docs/results.md has $lines lines, at most 120"
# README's results are lines of the table of all methods, word for word.
results=$(sed -n '/^## What nobody else has/,/^## Where/p' README.md |
  grep '^| ' | tail -n +2)
[ "$(wc -l <<<"$results")" -ge 5 ] || complain "README.md has few results"
while read -r row; do
  grep -qxF -- "$row" docs/results/table.md ||
    complain "README.md says what docs/results/table.md does not: $row"
done <<<"$results"
tests/faults_page.sh --check || failed=1
tests/json_page.sh --check || failed=1

# docs/openapi.yaml has the routes that the page answers, and no others.
routes=$(git ls-files 'console/*_routes.cpp' 'planner/page/*_routes.cpp' | xargs perl -0ne '
  my $method = $ARGV =~ /action/ ? "post" : "get";
  while (m![{(]"/api/v1(/[^"]*)"!g) {
    my $path = $1;
    my @kinds = $path =~ s/\((svg\|png)\)$// ? split(/\|/, $1) : "";
    $path =~ s/\([^)]*\)/{}/g;
    $path =~ s/\\//g;
    print "$method $path$_\n" for @kinds;
  }' | sort)
described=$(perl -ne '$path = $1 if m{^  (/.*):$};
  print "$1 ", $path =~ s/\{\w+\}/{}/gr, "\n" if /^    (get|post):$/' \
  docs/openapi.yaml | sort)
[ "$(wc -l <<<"$routes")" -gt 20 ] || complain "found few routes in the sources"
diff <(echo "$routes") <(echo "$described") ||
  complain "docs/openapi.yaml has other routes (>) than the page (<)"

# docs/method.md explains every rule that can be left out, in the order in which
# they act.
rules=$(perl -0ne 'print "$1\n" while /\{Rule::k\w+, Stage::k\w+,\s*"(\w+)"/g' \
  diagnosis/decision/rules.h)
[ "$(wc -l <<<"$rules")" -gt 15 ] || complain "found few rules in rules.h"
explained=$(sed -n '/^### The rules/,/^## /s/^| `\([a-z_]*\)` |.*/\1/p' \
  docs/method.md)
diff <(echo "$rules") <(echo "$explained") ||
  complain "docs/method.md has other rules (>) than rules.h (<), or another order"

# Pages below a folder that the table names belong to its part.
part=
declare -A part_words part_of
while IFS='|' read -r _ name page _; do
  [[ $page == *']('* ]] || continue
  name=$(tr -d '*' <<<"$name" | sed 's/^ *//; s/ *$//')
  part=${name:-$part}
  page=$(sed -E 's/.*\]\(([^)]*)\).*/\1/' <<<"$page")
  for file in $(cd docs && git ls-files "$page" | grep '\.md$'); do
    [ -z "${part_of[$file]:-}" ] || complain "$file is in two parts"
    part_of[$file]=$part
    part_words[$part]=$((${part_words[$part]:-0} + $(wc -w <"docs/$file")))
  done
done <docs/README.md
for file in $(cd docs && git ls-files '*.md' | grep -vE '^(README|examples/)'); do
  [ -n "${part_of[$file]:-}" ] ||
    complain "docs/README.md does not name $file in one of its parts"
done
total=0
for part in Start Do 'Look up' Admin Why Evidence; do
  [ -n "${part_words[$part]:-}" ] || complain "docs/README.md has no part $part"
  echo "docs: $part ${part_words[$part]:-0} words"
  total=$((total + ${part_words[$part]:-0}))
done
echo "docs: all parts $total words"
exit $failed
