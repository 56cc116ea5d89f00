# t_s,CV,P1,P2,T1,X,F[,...] of a record (% of closing, kPa, degC, t/h) as its
# owners export them: -v form=spreadsheet|long|5s|10s|swinging-door. Local time,
# % of opening, bar gauge, m3/h of water at 100 degC.
BEGIN {
  FS = ","
  name[1] = "LC51_03CV"; name[2] = "P51_05"; name[3] = "P51_06"
  name[4] = "T51_01"; name[5] = "LC51_03X"; name[6] = "F51_01"
  unit[1] = unit[5] = "%"; unit[2] = unit[3] = "bar g"; unit[4] = "°C"
  unit[6] = "m³/h"
  digits[1] = digits[4] = digits[5] = 1; digits[2] = digits[3] = 3
  digits[6] = 2
  # Half a per cent of the spans.
  door[1] = door[5] = 0.5; door[2] = door[3] = 0.3; door[4] = 1; door[6] = 0.2
  tags = 6
  seed = 1
  if (form == "spreadsheet") {
    printf "\357\273\277Zeitstempel"
    for (i = 1; i <= tags; ++i) printf ";%s [%s]", name[i], unit[i]
    printf "\r\n"
  } else if (form == "long" || form == "swinging-door") {
    print "TagName,DateTime,Value,Status"
  } else {
    printf "Time"
    for (i = 1; i <= tags; ++i) printf ",%s [%s]", name[i], unit[i]
    print ""
  }
}
# The same numbers with every awk: 0..1.
function random() {
  seed = (seed * 16807) % 2147483647
  return seed / 2147483647
}
function clock(t,  ms, s) {
  ms = int(t * 1000 + 0.5)
  s = int(ms / 1000)
  return sprintf("2026-01-05T%02d:%02d:%02d.%03d", 10 + int(s / 3600),
                 int(s / 60) % 60, s % 60, ms % 1000)
}
function reading(i, t, value) {
  printf "%s,%s,%.*f,Good\n", name[i], clock(t), digits[i], value
}
# Swinging door: a reading is kept when no line from the last one kept passes
# all since within `door`; after 10 min at the latest.
function swing(i, t, value,  up, down) {
  if (!(i in kept_t)) {
    keep(i, t, value)
    return
  }
  up = (value + door[i] - kept[i]) / (t - kept_t[i])
  down = (value - door[i] - kept[i]) / (t - kept_t[i])
  if (up < most[i]) most[i] = up
  if (down > least[i]) least[i] = down
  if (least[i] > most[i] || t - kept_t[i] > 600) {
    keep(i, last_t[i], last[i])
    most[i] = (value + door[i] - kept[i]) / (t - kept_t[i])
    least[i] = (value - door[i] - kept[i]) / (t - kept_t[i])
  }
  last_t[i] = t
  last[i] = value
}
function keep(i, t, value) {
  reading(i, t, value)
  kept_t[i] = last_t[i] = t
  kept[i] = last[i] = value
  most[i] = 1e30
  least[i] = -1e30
}
NR == 1 || $2 == "" {next}
{
  t = $1
  v[1] = 100 - $2
  v[2] = ($3 - 101.325) / 100
  v[3] = ($4 - 101.325) / 100
  v[4] = $5
  v[5] = 100 - $6
  v[6] = $7 / 0.9584
}
form == "spreadsheet" {
  if ((t >= 700 && t < 730) || (t >= 1600 && t < 1650)) next
  line = clock(t + 0.2 * (2 * random() - 1) + 0.2)
  for (i = 1; i <= tags; ++i) {
    cell = random() < 0.02 ? "" : sprintf("%.*f", digits[i], v[i])
    sub(/\./, ",", cell)
    line = line ";" cell
  }
  printf "%s\r\n", line
}
form == "long" {
  for (i = 1; i <= tags; ++i) reading(i, t, v[i])
}
form == "swinging-door" {
  for (i = 1; i <= tags; ++i) swing(i, t, v[i])
}
(form == "5s" && t % 5 == 0) || (form == "10s" && t % 10 == 0) {
  line = clock(t)
  for (i = 1; i <= tags; ++i) line = line sprintf(",%.*f", digits[i], v[i])
  print line
}
END {
  if (form == "swinging-door")
    for (i = 1; i <= tags; ++i) if (last_t[i] > kept_t[i]) keep(i, last_t[i], last[i])
}
