#!/usr/bin/env bash
# Completes command lines as bash does: sources the installed script and looks
# at COMPREPLY. Usage: completion.sh BIN_DIRECTORY
set -euo pipefail
bin=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
export FDI_DATA=$folder/data
PATH=$bin:$PATH

# shellcheck disable=SC1091
source "$(dirname "$0")/../cmake/package/completion.bash"
compopt() { :; }  # Works within a completion only.

# The candidates for the last word, in one line.
candidates() {
  COMP_WORDS=("$@")
  COMP_CWORD=$(($# - 1))
  set +eu  # As in an interactive shell.
  _fdi_complete "$1"
  set -eu
  echo "${COMPREPLY[*]}"
}
failed=0
expect() {  # "CANDIDATES" WORDS...
  local expected=$1 got
  shift
  got=$(candidates "$@")
  [ "$got" = "$expected" ] || {
    echo "completion: '$*' gives '$got' and not '$expected'"
    failed=1
  }
}

expect 'history' fdi-store hist
expect 'list label' fdi-store history l
expect 'list' "$bin/fdi-store" history lis
expect '--domain' fdi-monitor run --dom
expect '--model-set' fdi-monitor run --model
expect '--plant' fdi-trainer onboard --pl
expect '--plant' fdi-store valves add --pl
expect 'udp' fdi-monitor --transport u
expect 'paper' fdi-trainer train --preset p
expect 'shm' fdi-monitor --transport = s
expect 'lossless' fdi-monitor run --record l
expect 'f19' fdi-store history list --fault f19
expect 'rtn_unack' fdi-store history list --state r
expect 'unacked unack' fdi-store history ack --state un
expect 'lublin-actuator-3 lublin-actuator-3-refit' \
  fdi-simulator run --parameters lub
expect 'level-loop' fdi-simulator run --excitation le
expect 'true t1' fdi-store history label last t
expect 'f19:' fdi-simulator run --fault f19
expect 'incipient@' fdi-simulator run --fault f19 : inc
expect 'abrupt@ incipient@' fdi-simulator run --fault f19 :

"$bin/fdi-simulator" run --no-publish --record --duration 60 --valve FV-7 \
  --log-level error >/dev/null
"$bin/fdi-simulator" run --no-publish --record --duration 60 --valve GV-8 \
  --log-level error >/dev/null
runs=$("$bin/fdi-store" runs list --json |
  sed -n 's/.*"run_id": "\(.*\)".*/\1/p' | sort)
first=$(head -1 <<<"$runs")
last=$(tail -1 <<<"$runs")
expect 'FV-7' fdi-store history list --valve F
expect "$first" fdi-store runs show "${first:0:8}"
expect "$first,$last" fdi-trainer train --runs "$first,${last:0:8}"
# Names are offered as the shell has to read them, and never executed.
"$bin/fdi-simulator" run --no-publish --record --duration 60 \
  --valve "\$(touch $folder/executed) 1" --log-level error >/dev/null
expect "\\\$\\(touch\\ $folder/executed\\)\\ 1" \
  fdi-store history list --valve '\$'
[ ! -e "$folder/executed" ] || {
  echo "completion: the name of a valve is executed"
  failed=1
}
expect '' fdi-store --data "$folder/none" runs show "${first:0:8}"
expect 'last' fdi-store history ack la
exit $failed
