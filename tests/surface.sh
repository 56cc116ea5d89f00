#!/usr/bin/env bash
# Counts what a user meets: verbs, their options (--help-all), the options that
# one --help shows, names that mean two things, and advised commands that are
# not there. Reads the help texts, so it counts what is there and not what is
# declared. Fails beyond the limits below, which are to be lowered when something
# goes.
# Usage: surface.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
bin=$(realpath "${1:?folder of the programs}")
# The 47 of the list of names, and the two of the gateway.
max_verbs=49
max_options=257
max_shown=12

# The placeholders that a name may have, wherever it occurs; "-" is none.
meanings='
--by TEXT
--comment TEXT
--count N
--csv -
--db URL
--dry-run -
--file FILE.*
--from TIME
--jobs N
--limit NAME=VALUE
--map FILE.toml
--monitor NAME
--output FILE.*
--rows N
--to TIME
--valve GLOB|ID
'

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# options TEXT: a line "OPTION|PLACEHOLDER" for each option of a help text.
options() {
  # An option that is wider than its column stands in a line of its own.
  sed -nE 's/^  (-[a-zA-Z], ?)?(--[a-z][a-z0-9-]*)( ([^ ]+))?.*/\2|\4/p' \
    <<<"$1" | grep -v '^--help' || true
}

# walk PROGRAM [WORD...]: a line "PROGRAM WORDS|OPTION|PLACEHOLDER" for each
# option of each verb, and "PROGRAM WORDS||NUMBER" for the verb itself, with
# the number of options that its --help shows.
walk() {
  local text verbs
  text=$("$bin/$1" "${@:2}" --help)
  verbs=$(sed -n '/^Verbs:/,/^$/s/^  \([a-z][a-z-]*\).*/\1/p' <<<"$text")
  if [ -n "$verbs" ]; then
    for verb in $verbs; do walk "$@" "$verb"; done
    return
  fi
  echo "$*||$(options "$text" | wc -l)"
  options "$("$bin/$1" "${@:2}" --help-all)" | sed "s/^/$*|/"
}

for program in fdi-store fdi-trainer fdi-monitor fdi-simulator fdi-gateway; do
  walk "$program"
done >"$folder/surface"

verbs=$(grep -c '||' "$folder/surface")
options=$(grep -vc '||' "$folder/surface")
names=$(grep -v '||' "$folder/surface" | cut -d'|' -f2 | sort -u | wc -l)
shown=$(sed -n 's/\(.*\)||\(.*\)/\2 \1/p' "$folder/surface" | sort -rn |
  head -1)
echo "$verbs verbs, $options options under $names names;" \
  "most in one help: $shown"

failed=0
refuse() {
  echo "surface: $*"
  failed=1
}
[ "$verbs" -le "$max_verbs" ] || refuse "$verbs verbs, at most $max_verbs"
[ "$options" -le "$max_options" ] ||
  refuse "$options options, at most $max_options"
[ "$(awk '{ print $1 }' <<<"$shown")" -le "$max_shown" ] ||
  refuse "more than $max_shown options in the help of: $shown"
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
for word in report faults; do
  [ "$(grep -cE " $word\|\|" "$folder/surface")" -le 1 ] ||
    refuse "'$word' is a verb twice"
done

# Commands that documents and messages advise are there, with their options.
cat >"$folder/advice.pl" <<'END'
use strict;
my (%verb, %group, %option);
open my $surface, '<', shift or die;
while (<$surface>) {
  my ($words, $name) = split /\|/;
  $verb{$words} = 1;
  $option{"$words $name"} = 1 if $name;
  $group{$words =~ s/ [^ ]+$//r} = 1;
}
my $global = qr/--(?:config|data|domain|help|help-all
  |interface|json|log-level|partition|qos|security|transport|utc
  |version)/x;
for my $file (@ARGV) {
  open my $stream, '<', $file or die "$file: $!";
  my $text = do { local $/; <$stream> };
  if ($file =~ /\.(cpp|h)$/) {
    $text =~ s{^\s*//.*}{}gm;
    $text =~ s/"\s*\n\s*"//g;  # Literals that the compiler joins.
  } elsif ($file =~ /\.md$/) {
    $text =~ s/ *\\\n */ /g;
    # Only code: indented, or within backticks.
    $text = join "\n", $text =~ /^    (.*)$/gm, $text =~ /`([^`\n]+)`/g;
  }
  while ($text =~ /\b(fdi-(?:store|trainer|monitor|simulator|gateway))
                   ((?:\ +$global(?:\ +[^-\s]\S*)?)*)\ +([a-z][a-z-]+)
                   (?:\ +([a-z][a-z-]+))?([^\n`;,()#|&]*)/gx) {
    my ($program, $word, $second, $rest) = ($1, $3, $4 // '', $5);
    # A user, a folder, a thread and a package are no verbs.
    next if $word =~ /^(?:anna|by|fdi-copy|intake|systemd)$/;
    my ($command) = grep { $verb{$_} }
      ("$program $word", "$program $word $second");
    if (!$command) {
      print "  $file: $program $word $second\n"
        unless $group{"$program $word"} && !$second;
      next;
    }
    for my $name ($rest =~ /(?:^|[ \[])(--[a-z][a-z-]*)/g) {
      print "  $file: $command $name\n"
        unless $option{"$command $name"} || $name =~ /^$global$/;
    }
  }
}
END
cd "$(dirname "$0")/.."
git ls-files '*.md' '*.cpp' '*.h' programs/store/examples.txt |
  grep -vE '^(tests|bench|CHANGELOG)|vendor|report/removed_words.cpp' |
  xargs perl "$folder/advice.pl" "$folder/surface" >"$folder/advice"
if [ -s "$folder/advice" ]; then
  refuse "commands that are not there are advised:"
  cat "$folder/advice"
fi
exit $failed
