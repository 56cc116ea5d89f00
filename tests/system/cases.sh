#!/usr/bin/env bash
# Exports in the style of other systems (FDI_REFERENCE_DATA/cases): whether
# sniffing, importing, onboarding and replaying each give what is right for it.
# Usage: cases.sh FOLDER-OF-PROGRAMS [all]
#   by default those of which onboarding says at once what is wrong; all takes
#   six minutes of processor time, and looks for false alarms, too
#   77 without the files
set -euo pipefail
[ -n "${FDI_REFERENCE_DATA:-}" ] || {
  echo "cases: skipped, FDI_REFERENCE_DATA is not set"
  exit 77
}
tests=$(cd "$(dirname "$0")" && pwd)
source "$tests/programs.sh" "$1"
all=${2:-}

# Name, zone, what onboarding says (thin, usable, or why not), samples, and how
# many of them have no X and no F (what is missing for less than ten samples is
# filled, as the map says); for a file that nobody can read, why.
cases() {
  cat <<'END'
a01_wincc_archive|Europe/Berlin|at most 390 samples in a row|720|30|0
a02_influx_annotated|UTC|thin|720|0|0
a03_influx1_ns|UTC|thin|720|0|0
a05_grafana_units|UTC|thin|720|0|0
a06_thousands|UTC|thin|720|0|0
a08_wide_quality|UTC|at most 400 samples in a row|720|0|60
a09_ip21_status|UTC|at most 500 samples in a row|720|0|20
a10_pi_states|UTC|thin|720|10|0
a11_s7_counts|UTC|at most 450 samples in a row|720|30|0
a12_dst_tag_major|Europe/Berlin|usable|1440|0|0
a13_date_time_summary|UTC|thin|720|0|0
a14_section_two_digit_year|UTC|thin|720|0|0
a15_filetime|UTC|thin|720|0|0
a16_epoch_us|UTC|thin|720|0|0
a17_etl_headerless|UTC|the first row holds values
a18_utf16_brackets|Europe/Berlin|thin|720|0|0
a19_quality_words_dcs|UTC|at most 90 samples in a row|630|0|0
b01_split_range|UTC|usable|1500|0|0
b03_gas_nm3h|UTC|thin|900|0|900
b04_level_loop|UTC|neither a position (X) nor a flow (F)
b05_no_position|UTC|usable|1800|1800|0
b06_on_off|UTC|this is an open/shut valve|1800|0|0
b07_low_flow_cutoff|UTC|usable|1800|0|0
b08_state_numbers|UTC|at most 390 samples in a row|900|40|0
b09_units_row|UTC|thin|720|0|0
b10_supply_lost|UTC|F ends while X is open|1800|0|0
b13_flow_95_t_h|UTC|usable|1501|0|0
END
}

# Checks the answer of verb $1, in $code and verb.out: an error that matches $2,
# or success with what the rest of the words finds.
judge() {
  local answer="wrong: $(tail -1 verb.out)"
  if [ "$code" -ne 0 ]; then
    [ -z "$2" ] || ! grep -q -e "$2" verb.out || answer="refused rightly"
  elif "${@:3}"; then
    answer=ok
  fi
  printf '  %-15s' "$answer" >>"$name.row"
  case $answer in wrong*) wrong+=("$name: $1") ;; esac
}
run() {  # PROGRAM WORDS
  code=0
  "$bin/$1" "${@:2}" >verb.out 2>&1 </dev/null || code=$?
}
# CV, X and F of all runs of the valve in the data directory $1.
readings() {
  sqlite3 -readonly "$1/runs.db" "select id from run where valve_id = '$name'
    order by first_stamp_ns" | while read -r id; do
    "$bin/fdi-store" --data "$1" runs export "$id" | awk -F, '
      function cell(name) {return name in column ? $column[name] : ""}
      NR == 1 {for (i = 1; i <= NF; ++i) column[substr($i, 1, 2)] = i; next}
      {print cell("CV") "," cell("X_") "," cell("F_")}'
  done
}
is_whole() {
  [ "$(readings imported | awk -F, '{x += $2 == ""; f += $3 == ""}
    END {printf "%d|%d|%d", NR, x, f}')" = "$samples|$no_x|$no_f" ]
}
is_as_imported() { cmp -s <(readings "$FDI_DATA") <(readings imported); }

wrong=()
if [ -n "$all" ]; then  # Needs the valve whose supply is lost later.
  "$bin/fdi-simulator" run --no-publish --seed 4101 -o healthy.csv \
    --scenario "$tests/../../campaigns/operation/normal.toml" >simulator.log 2>&1
  "$bin/fdi-trainer" onboard --valve b10_supply_lost --file healthy.csv \
    --signals CV,X,F --no-coverage >onboard.log 2>&1 ||
    fail "the healthy record is refused"
fi
cases | while IFS='|' read -r name zone onboards rest; do
  case $all$onboards in thin | usable) ;; *) echo "$name|$zone|$onboards|$rest" ;; esac
done >cases.txt

while IFS='|' read -r name zone onboards samples no_x no_f; do
  file=$FDI_REFERENCE_DATA/cases/$name.csv
  printf '%-28s' "$name" >"$name.row"
  refused=
  [ -n "$samples" ] || refused=$onboards
  run fdi-store runs sniff "$file" --zone "$zone" -o "$name.toml"
  judge sniff "$refused" [ -s "$name.toml" ]
  map=(--map "$name.toml")
  [ -s "$name.toml" ] || map=(--zone "$zone")
  run fdi-store --data imported runs import "$file" --valve "$name" "${map[@]}"
  judge import "$refused" is_whole
  run fdi-trainer onboard --valve "$name" --file "$file" "${map[@]}" \
    --signals CV,X,F --no-coverage
  judge onboard "$onboards" grep -q -e "^$onboards" verb.out
done <cases.txt

start --record  # With the sets of those that were onboarded.
while IFS='|' read -r name zone onboards samples no_x no_f; do
  map=(--map "$name.toml")
  [ -s "$name.toml" ] || map=(--zone "$zone")
  run fdi-simulator --domain "$domain" replay --valve "$name" --split-gaps \
    --file "$FDI_REFERENCE_DATA/cases/$name.csv" "${map[@]}" --speed max
  mv verb.out "$name.replay"
  echo $code >"$name.code"
done <cases.txt
stop

printf '%-28s  %-15s  %-15s  %-15s  %s\n' file sniff import onboard replay
while IFS='|' read -r name zone onboards samples no_x no_f; do
  refused=
  [ -n "$samples" ] || refused=$onboards
  cp "$name.replay" verb.out
  code=$(cat "$name.code")
  judge replay "$refused" is_as_imported
  cat "$name.row"
  echo
done <cases.txt
[ ${#wrong[@]} -eq 0 ] || fail "wrong: ${wrong[*]/%/,}"

# A real loop at a sample a minute, with a command and a flow alone: four days
# are onboarded, and the other three are silent.
loop=$FDI_REFERENCE_DATA/plant-loops/LIC-106.csv
slow() {  # PROGRAM WORDS
  run "$@"
  [ "$code" -eq 0 ] || fail "LIC-106, $2: $(tail -1 verb.out)"
}
slow fdi-store runs sniff "$loop" -o lic.toml
slow fdi-trainer onboard --valve LIC-106 --map lic.toml --file "$loop@0:345600" \
  --no-coverage
slow fdi-trainer evaluate --valve LIC-106 --map lic.toml --assume-normal \
  --file "$loop@345600:"
grep -q 'LIVE: *71' verb.out || fail "LIC-106 is not judged"
grep -Eq '^episodes without fault: *0 ' verb.out || fail "LIC-106 is not silent"
[ -n "$all" ] || exit 0

# All are healthy but one, and that one's transmitter is right.
found=$(history "select group_concat(valve_id || ' ' || coalesce(fault, '-'))
  from fault_history where valve_id not like 'b10%'")
[ -z "$found" ] || fail "false alarms: $found"
found=$(history "select group_concat(fault) from fault_history
  where valve_id like 'b10%'")
case $found in "" | f13) fail "the lost supply is '$found'" ;; esac
bad=$(history "select count(*) from coverage_hours
  where valve_id like 'b01%' and quality = 'BAD_INPUT'")
[ "$bad" -eq 0 ] || fail "standing fully open is bad input"
echo "cases: the lost supply is $found"
