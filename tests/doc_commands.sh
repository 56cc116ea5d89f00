#!/usr/bin/env bash
# Every command that a document shows exists: the verb is one of the program's,
# and each option is one of the verb's or of the program's. Reads code blocks
# and code in the text of README.md and docs/, and the help of the programs.
# Usage: doc_commands.sh FOLDER_OF_THE_PROGRAMS
set -euo pipefail
bin=$(cd "${1:?folder of the programs}" && pwd)
cd "$(dirname "$0")/.."

exec perl - "$bin" $(git ls-files README.md CONTRIBUTING.md 'docs/*.md' \
  '*/README.md') <<'PERL'
use strict;
use warnings;

my $bin = shift @ARGV;
my (%options, %verbs);

# Options by name: whether a value follows. A verb may hide some of them.
sub walk {
  my @words = @_;
  my ($program, @rest) = @words;
  my $text = '';
  for my $help ('--help', '--help-all') {
    $text .= qx{"$bin/$program" @rest $help 2>/dev/null};
  }
  my %own;
  $own{$2} = defined $3 && $3 ne ''
    while $text =~ /^  (-[a-zA-Z], ?)?(--[a-z][a-z0-9-]*)(?: (\S+))?/mg;
  # Short forms are those of long ones.
  $own{$1} = defined $3 while $text =~ /^  (-[a-zA-Z]), ?(--[a-z-]+)(?: (\S+))?/mg;
  $options{"@words"} = \%own;
  my ($list) = $text =~ /^Verbs:\n(.*?)(?:\n\n|\z)/ms;
  for my $verb (($list // '') =~ /^  ([a-z][a-z-]*)/mg) {
    $verbs{"@words"}{$verb} = 1;
    walk(@words, $verb);
  }
}
my @programs = grep { -x "$bin/$_" }
  qw(fdi-store fdi-trainer fdi-monitor fdi-simulator fdi-gateway fdi-study);
walk($_) for @programs;
my $program = join '|', @programs;

my ($complaints, $commands) = (0, 0);

# One command: words after the name of the program.
sub check {
  my ($where, $name, $text) = @_;
  $text =~ s/"[^"]*"|'[^']*'/QUOTED/g;
  $text =~ s/[\[\]]/ /g;
  my @words = split ' ', $text;
  my $path = $name;
  my @given;
  while (@words) {
    my $word = shift @words;
    last if $word =~ /^(?:--?$|-+>|#|\||;|&|>|<|\.\.\.)/;
    $word =~ s/[.,;:)]+$//;
    if ($word =~ /^(--?[a-zA-Z][a-z0-9-]*)(=?)/) {
      my ($option, $equals) = ($1, $2);
      push @given, $option;
      my $takes = $options{$path}{$option} // $options{$name}{$option};
      shift @words if $takes && !$equals && @words && $words[0] !~ /^-/;
    } elsif ($verbs{$path}) {
      # "list|show" stands for both.
      my ($verb) = $word =~ /^([a-z][a-z-]*)/;
      if (!defined $verb || !$verbs{$path}{$verb}) {
        last if $word !~ /^[a-z-]+$/;    # VERB, ..., a sentence that goes on
        print "doc_commands: $where: $path has no verb $word\n";
        ++$complaints;
        return;
      }
      $path .= " $verb";
    }
  }
  ++$commands;
  for my $option (@given) {
    next if $option =~ /^--(?:help|help-all|version)$/;
    next if exists $options{$path}{$option} || exists $options{$name}{$option};
    # A noun without its verb, such as `fdi-store runs`, has those of all.
    next if grep { /^\Q$path\E / && exists $options{$_}{$option} } keys %options;
    print "doc_commands: $where: $path has no option $option\n";
    ++$complaints;
  }
}

for my $page (@ARGV) {
  open(my $in, '<', $page) or die "$page: $!";
  my ($fence, $joined, $first) = (0, '', 0);
  while (my $line = <$in>) {
    if ($line =~ /^\s*```/) {
      $fence = !$fence;
      next;
    }
    if ($fence || $line =~ /^ {4,}\S/) {
      chomp $line;
      $first = $. if $joined eq '';
      $joined .= $line;
      next if $joined =~ s/\\$/ /;
      $joined =~ s/(?:^|\s)#.*//;
      # Each command of a line; output that begins with a program is none.
      for my $part (split /\s(?:\||&&|;|&)\s|[;|]\s|\$\(|\)/, $joined) {
        check("$page:$first", $2, $3)
          if $part =~ /(^|[\s"\/])($program)((?:\s+\S.*)?)$/ &&
          $part !~ /^\s*\Q$2\E: /;
      }
      $joined = '';
      next;
    }
    while ($line =~ /`([^`]*)`/g) {
      my $code = $1;
      check("$page:$.", $1, $2) if $code =~ /^(?:\$ )?($program)(\s.*)$/;
    }
  }
}
print "doc_commands: $commands commands\n";
exit($complaints || $commands < 100 ? 1 : 0);
PERL
