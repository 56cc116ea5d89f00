# Isolation time against intensity, from the CSV of fdi-study evaluate.
# Variables: data, picture.
set terminal pngcairo size 900,640
set output picture
set datafile separator ','
set xlabel 'strength (developing: at the end)'
set ylabel 'isolated alone [s after the start]'
set logscale y
set yrange [10:2000]
set grid
set key outside right
faults = 'f1 f3 f6 f7 f19'
names = 'F1 F2 F3 F4 F5'
kind(k) = k == 0 ? 'abrupt' : 'incipient'
column_of(f, k) = sprintf("< grep '^%s:%s' %s", f, kind(k), data)
plot for [k = 0:1] for [i = 1:5] column_of(word(faults, i), k) \
  using 3:($18 > 0 ? $18 : 1 / 0) with linespoints lw 2 dt k + 1 pt 4 + i lc i \
  title word(names, i) . ' ' . kind(k)
