# For the scripts beside it, which run the built programs over DDS:
#
#     source programs.sh FOLDER-OF-PROGRAMS
#
# Goes to an empty folder, with a data directory and a domain of its own.
bin=$(cd "$1" && pwd)
work=$(mktemp -d)
export FDI_DATA=$work/data
source "$(dirname "${BASH_SOURCE[0]}")/../domain.sh"
monitor=
trap '[ -z "$monitor" ] || kill -9 "$monitor" 2>/dev/null; rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "$(basename "$0" .sh): $*" >&2
  cat ./*.log >&2
  exit 1
}
await() {  # SECONDS COMMAND...
  local end=$((SECONDS + $1))
  until "${@:2}" >/dev/null 2>&1; do
    [ $SECONDS -lt $end ] || fail "not within $1 s: ${*:2}"
    sleep 0.2
  done
}
history() { sqlite3 -readonly "$FDI_DATA/history.db" "$1"; }
start() {  # OPTIONS
  : >monitor.log
  "$bin/fdi-monitor" --domain "$domain" run "$@" 2>monitor.log &
  monitor=$!
  timeout 30 sh -c 'until grep -q monitor_ready monitor.log; do sleep 0.05; done' ||
    fail "the monitor does not start"
}
stop() {
  kill -TERM "$monitor"
  wait "$monitor" || fail "the monitor ended with $?"
  monitor=
}
