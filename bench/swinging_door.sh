#!/usr/bin/env bash
# A day of a healthy valve as a historian keeps it: swinging door, 0.2 % of span,
# a reading of each tag at least every 2 min. A valve that was onboarded on two
# such hours takes it with the map that `sniff` writes, and with one that holds
# instead of drawing lines: how it is put onto a grid, from which change on a fault
# is seen, how long the day was judged, and how many false episodes it has.
# Usage: swinging_door.sh FOLDER-OF-PROGRAMS
set -euo pipefail
source "$(dirname "$0")/../tests/system/programs.sh" "$1"
cat >door.pl <<'END'
# Usage: door.pl TABLE SECONDS-SINCE-1970
use strict;
use POSIX qw(strftime);
my %span = (CV_pct => 100, X_pct => 100, F_t_h => 40, P1_kPa => 5000, P2_kPa => 5000, T1_degC => 200);
my ($share, $longest) = (0.002, 120);
open my $table, '<', $ARGV[0] or die;
chomp(my $head = <$table>);
my @names = split /,/, $head;
my (%kept, @out);
# A reading is kept when no line from the last one kept passes all since within
# the door.
sub keep {
  my ($name, $t, $v) = @_;
  push @out, [$t, $name, $v];
  return $kept{$name} = {t => $t, v => $v, up => 9e99, low => -9e99};
}
while (<$table>) {
  chomp;
  my ($t, @v) = split /,/;
  for my $i (0 .. $#v) {
    my $name = $names[$i + 1];
    my $door = ($span{$name} or next) * $share;
    my $k = $kept{$name};
    keep($name, $t, $v[$i]), next if !$k;
    my $slope = sub { ($v[$i] + $_[0] - $k->{v}) / ($t - $k->{t}) };
    my ($up, $low) = map { $slope->($_) } $door, -$door;
    $k->{up} = $up if $up < $k->{up};
    $k->{low} = $low if $low > $k->{low};
    if ($k->{low} > $k->{up} || $t - $k->{t} > $longest) {
      $k = keep($name, @$k{qw(last_t last_v)});
      @$k{qw(up low)} = map { $slope->($_) } $door, -$door;
    }
    @$k{qw(last_t last_v)} = ($t, $v[$i]);
  }
}
print "TagName,DateTime,Value,Status\n";
printf "FV.%s,%s.000Z,%s,Good\n", $_->[1],
  strftime("%Y-%m-%dT%H:%M:%S", gmtime($ARGV[1] + $_->[0])), $_->[2]
  for sort { $a->[0] <=> $b->[0] } @out;
END
compressed() {  # SECONDS SEED BEGIN
  "$bin/fdi-simulator" run --no-publish --duration "$1" --seed "$2" --excitation level-loop \
    -o table.csv --log-level error >/dev/null
  perl door.pl table.csv "$3"
}
compressed 7200 11 1767600000 >hours.csv
compressed 86400 12 1767700000 >day.csv
echo "$(($(wc -l <day.csv) - 1)) readings instead of $((6 * 86400))"
"$bin/fdi-store" runs sniff hours.csv -o tags.toml | grep -E '^(compressed|resample)'
for form in linear hold; do
  sed "s/linear/$form/" tags.toml >"$form.toml"
  echo "$form:"
  "$bin/fdi-trainer" onboard --valve "V-$form" --file hours.csv --map "$form.toml" --no-coverage 2>onboard.log |
    grep -E '^(usable:|channel|X|F|F\(CV\)|limits) ' || fail "not onboarded"
  "$bin/fdi-trainer" evaluate --model-set "V-$form" --file day.csv --map "$form.toml" 2>evaluate.log |
    sed -n '/^run/,/^$/p; /^time/,$p'
  grep -o 'resampled .*' evaluate.log
done
