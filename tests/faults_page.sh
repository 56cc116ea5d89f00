#!/usr/bin/env bash
# Writes docs/faults.md from the catalogue of what people read
# (monitor/catalogue/faults.toml), the catalogue of the faults themselves
# (diagnosis/model/fault_catalogue.h: look-alikes), what the simulator makes of
# them (simulator/fault_effects.h: where a fault shows) and the measured table "From which strength on" of docs/results/closed-loop.md.
# With --check it only compares, and fails if the page is not what it would
# write.
set -euo pipefail
cd "$(dirname "$0")/.."

page() {
  perl - monitor/catalogue/faults.toml diagnosis/model/fault_catalogue.h \
    docs/results/closed-loop.md simulator/fault_effects.h <<'PERL'
use strict;
use warnings;

sub slurp {
  open(my $in, '<', $_[0]) or die "$_[0]: $!";
  local $/;
  return scalar <$in>;
}
my ($catalogue, $header, $measured, $effects) = map { slurp($_) } @ARGV;

my (@codes, %entry);
for my $block (split /^\[/m, $catalogue) {
  next unless $block =~ /^([a-z0-9_]+)\]/;
  my $code = $1;
  push @codes, $code;
  $entry{$code}{$1} = $2 while $block =~ /^(\w+) = "(.*)"$/mg;
}

# One item for each fault; its number is its position, from 1 on.
my (@faults, %alike);
my ($items) = $header =~ /kFaultCatalogue\[\] = \{(.*?)\n\};/s
  or die "no kFaultCatalogue";
for my $item (split /^    \{/m, $items) {
  my ($code) = $item =~ /name = "([a-z0-9]+)"/ or next;
  push @faults, $code;
  push @{$alike{$code}}, $1 while $item =~ /\{(\d+), Alike::/g;
}
@faults >= 22 or die "found only @faults";
my %is_fault = map { $_ => 1 } @faults;

# Where the fields that a fault changes are seen.
my (%seen_in, %places);
$seen_in{$1} = $2
  while $effects =~ /\{&FaultEffects::(\w+),\s*SeenIn::k(\w+)/g;
my ($changes) = $effects =~ /kEffects\[\] = \{(.*?)\n\};/s or die "no kEffects";
my ($none, %change) = split m{/\* (\w+) \*/}, $changes;
for my $code (@faults) {
  my $text = $change{$code} // die "no effect of $code";
  $text =~ s/kLeakOfAir/e.air_leak/g;
  $places{$code}{$seen_in{$1} // die "no place of $1"} = 1
    while $text =~ /\be\.(\w+)/g;
  die "no effect of $code" unless $places{$code};
}

# "f8 to f12" counts each of them.
my (@sets, %seen);
for my $row ($measured =~ /^\| (CV [^\n]*) \|$/mg) {
  my ($signals, @cells) = split / \| /, $row;
  next unless @cells == 4 && $signals =~ /^CV[ A-Z0-9]*$/;
  next if $cells[0] !~ /f\d/;
  push @sets, $signals;
  my @from = ('10 %', '25 %', '50 % or more', 'not');
  for my $i (0 .. 3) {
    $cells[$i] =~ s/f(\d+) to f(\d+)/join ' ', map { "f$_" } $1 .. $2/ge;
    $seen{$signals}{$_} = $from[$i] for $cells[$i] =~ /\b([ftp]\d+)\b/g;
  }
}
@sets == 4 or die "expected four sets of signals, found @sets";

sub looks {
  my %in = %{$places{$_[0]}};
  my ($reading) = $change{$_[0]} =~ /\be\.(\w+)_reading_(?:factor|step)/;
  my %signal = (
    flow => 'F', temperature => 'T1', inlet => 'P1', outlet => 'P2');
  return "Only the reading of $signal{$reading} changes."
    if $reading && $signal{$reading};
  return 'Nothing changes in these signals.' if $in{None};
  return 'X answers CV differently, and F (or another reading) at a given X changes.'
    if $in{Both} || ($in{Rod} && $in{Behind});
  return 'X no longer answers CV as it did; F at a given X is as usual.' if $in{Rod};
  return 'X answers CV as usual; F at a given X, or another reading, changes.';
}

sub named {
  my $code = $_[0];
  return "$entry{$code}{name} ($code)";
}

print <<'TEXT';
# Faults: what each code means, how it looks and what to check

Made by `tests/faults_page.sh` from the catalogue that the programs show (`fdi-store faults`); change that, not this page.

**Seen with which signals**: the smallest strength at which a fault is detected, as a share of its full size, in the one loop where it was measured
([how](results/closed-loop.md)). Your valve may differ: `fdi-trainer onboard` prints its own table. "not" means not at any strength, "-" that it was not measured. Without P1,
P2 and T1 few faults are told apart: expect a set of two to four.

TEXT
print '| code | name | ', join(' | ', @sets), " |\n";
print '|---|---|', '---|' x @sets, "\n";
for my $code (@faults) {
  print "| [$code](#$code) | $entry{$code}{name} | ",
    join(' | ', map { $seen{$_}{$code} // ($code eq 'f14' ? 'not' : '-') } @sets), " |\n";
}
print <<'TEXT';

CV is the command, X the position, F the flow, P1 and P2 the pressures upstream and downstream, T1 the temperature. CV and X are in % of closing: 100 % is shut.

TEXT
for my $code (@codes) {
  if ($code eq 'travel_deviation') {
    print "## Findings\nA finding says that something is wrong, not why: by wide ",
      "limits, which always hold, by the audit of a loop, or by a slow ",
      "drift. Its code is its name.\n\n";
  }
  my $e = $entry{$code};
  print '<a id="', $code, '"></a>', "\n";
  print $is_fault{$code} ? '## ' : '### ', "$e->{name} ($code)\n";
  print '- How it looks: ', looks($code), "\n" if $is_fault{$code};
  print "- What to check: $e->{check}\n";
  # Those that the programs know to mix up, then those that the check names.
  my (@alike, %have);
  if ($is_fault{$code}) {
    for my $other ((map { $faults[$_ - 1] } @{$alike{$code} // []}),
      $e->{check} =~ /\b([ftp]\d+)\b/g) {
      push @alike, $other unless $have{$other}++ || $other eq $code;
    }
  }
  print '- Look-alikes: ', join('; ', map { named($_) } @alike), ".\n" if @alike;
  print "- Goes to: $e->{discipline}; NAMUR NE 107: $e->{namur}.\n\n";
}
PERL
}

if [ "${1:-}" = --check ]; then
  diff <(page) docs/faults.md >/dev/null || {
    echo "docs/faults.md is not what tests/faults_page.sh writes; run it"
    exit 1
  }
else
  page >docs/faults.md
fi
