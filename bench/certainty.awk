# Counts the answers of each certainty, and how many of them hold the fault, in
# lines of `fdi-study evaluate --csv` whose sets are joined by bars (FDI_RUNS of
# set_calibration.sh and untrained.sh). A catalogue's look-alike that
# the set does not know stands beside a single name that is called "one of".
#
#     awk -F, -f bench/certainty.awk RUNS
function Beside(name, fault) {
  return name == "f6" && fault == "f18" || name == "f18" && fault == "f6" ||
    (name == "f2" || name == "f19") && fault == "f5" ||
    name == "f2" && fault == "f19" ||
    (name == "f10" || name == "f11") && fault == "f12"
}
# A line of set_calibration.sh begins with the valve.
{ fault = $(NF - 21); name = $(NF - 6); certainty = $(NF - 5) }
certainty == "" || certainty == "-" { silent++; next }
{
  answers[certainty]++
  right[certainty] += index("|" name "|", "|" fault "|") > 0 ||
    certainty == "one of" && Beside(name, fault)
}
END {
  for (certainty in answers)
    print certainty ": " right[certainty] + 0 " of " answers[certainty]
  print "no alarm: " silent + 0
}
