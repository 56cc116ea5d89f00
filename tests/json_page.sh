#!/usr/bin/env bash
# Writes docs/json.md from docs/json.toml, the list of all keys. With --check it
# only compares, and fails if the page is not what it would write.
set -euo pipefail
cd "$(dirname "$0")/.."

page() {
  perl - docs/json.toml <<'PERL'
use strict;
use warnings;
use utf8;
use open qw(:std :encoding(UTF-8));

print <<'TEXT';
# Documents of `--json`

Made by `tests/json_page.sh` from docs/json.toml, which a test compares with what the programs print; change that, not this page.

With `--json`, a verb prints one JSON object and nothing else. Later versions may add keys, but never change one. A record of one kind has the same keys wherever it is printed.

- A line is a key, its type and its meaning. Types: text (not said), time (RFC 3339 in UTC, not said: such keys end in `_utc`), int, num, bool, any, `[kind]` (a list), `{*: num}` (an
  object whose keys are names), or a kind below. With a `?` it may be null: does not exist, is not known, is no finite number. Never 0, NaN or a missing key, unless said.
- Units are in brackets, where the key does not end in them: `_s`, `_h`, `_ns`, `_pct`. `unit` is that of the quantity concerned; a number without one has none. Strengths are signed.
- Keys without a meaning of their own are listed first. Hashes and 64-bit ids are 16 hexadecimal digits.

TEXT

# Text of at most 110 columns, further lines of it indented by the first's width.
sub wrapped {
  my ($first, $text) = @_;
  my $width = 110 - length $first;
  my @lines = ('');
  for my $word (split ' ', $text) {
    if ($lines[-1] ne '' && length("$lines[-1] $word") > $width) {
      push @lines, '';
    }
    $lines[-1] .= ($lines[-1] eq '' ? '' : ' ') . $word;
  }
  my $blank = ' ' x length $first;
  return join '', map { (my $line = ($_ ? $blank : $first) . $lines[$_]) =~ s/\s+$//; "$line\n" } 0 .. $#lines;
}

my ($kind, $notes, @bare, @rows) = ('', '');
sub flush_kind {
  return if $kind eq '';
  print $notes, $notes ? "\n" : '', "```\n";
  print wrapped('', join ', ', @bare) if @bare;
  my ($keys, $types) = (0, 0);
  for (@rows) {
    $keys = length $$_[0] if length $$_[0] > $keys;
    $types = length $$_[1] if length $$_[1] > $types;
  }
  print wrapped(sprintf("%-*s  %-*s", $keys, $$_[0], $types, $$_[1]) . ($types ? '  ' : ''), $$_[2]) for @rows;
  print "```\n\n";
  ($kind, $notes, @bare, @rows) = ('', '');
  @bare = @rows = ();
}

open(my $in, '<', $ARGV[0]) or die "$ARGV[0]: $!";
while (<$in>) {
  chomp;
  if (/^## (.*)/) {
    flush_kind();
    print "## $1\n";
  } elsif (/^\[(\w+)\]/) {
    flush_kind();
    $kind = $1;
    print $kind eq 'verbs' ? "## Verbs\n"
      : $kind eq 'common' ? "## Keys of many kinds\nThey mean the same everywhere; a kind adds what is special.\n\n"
      : "### `$kind`\n";
    $notes = "`fdi-monitor watch` prints one object a line for each message: a `decision`, `transition`, `valve_state`, `status` or `model_set_info`. With `--table` a line is\n"
      . "`{as_of_utc: time, monitor: text?, valves: [live_valve]}`, where `monitor` is the health of the monitors heard from in the last 5 s.\n" if $kind eq 'verbs';
  } elsif (/^# (.*)/) {
    $notes .= "$1\n" if $kind ne '';
  } elsif (my ($key, $value) = /^"?([^"=]+?)"? = ["'](.*)["']$/) {
    my ($type, $meaning) = split /; /, $value, 2;
    if ($key eq '...') {
      push @bare, 'all keys of ' . join ' and ', split ' ', $value;
      next;
    }
    $meaning //= '';
    $type //= '';
    my $unit = $type =~ s/ \((.*)\)$// ? $1 : '';
    my ($suffix) = $key =~ /_(s|h|pct)$/;
    $suffix = '%' if ($suffix // '') eq 'pct';
    $key .= '?' if $type =~ s/\?$//;
    $type = '' if $type eq 'text' || ($type eq 'time' && $key =~ /_utc/);
    $type .= "[$unit]" if $unit ne '' && $unit ne ($suffix // '');
    if ($meaning eq '' && $kind ne 'verbs') {
      push @bare, $type eq '' ? $key : "$key $type";
    } else {
      push @rows, [$key, $type, $meaning];
    }
  } elsif (!/^(#|$)/) {
    die "$ARGV[0]:$.: neither a kind nor a key: $_\n";
  }
}
flush_kind();
PERL
}

if [ "${1:-}" = --check ]; then
  diff <(page) docs/json.md >/dev/null || {
    echo "docs/json.md is not what tests/json_page.sh writes; run it"
    exit 1
  }
else
  page >docs/json.md
fi
