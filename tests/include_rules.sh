#!/usr/bin/env bash
# Checks that includes only point down the layers of docs/architecture.md and
# that each third-party library stays where it belongs.
set -u
cd "$(dirname "$0")/.."
failed=0

forbid() {  # WHERE(regex of file) WHAT(regex of include) WHY
  local hits
  hits=$(git ls-files '*.h' '*.cpp' | grep -E "$1" |
    xargs -r grep -nE "#include [<\"]$2")
  if [ -n "$hits" ]; then
    printf '%s:\n%s\n' "$3" "$hits"
    failed=1
  fi
}

forbid '^diagnosis/' '(idl|storage|simulator|trainer|monitor)/' \
  'diagnosis is the bottom layer'
forbid '^(simulator|trainer|monitor)/[^/]+$' '(idl|storage)/' \
  'a domain library includes no adapter'
forbid '^trainer/(onboarding|baselines)/' '(idl|storage|monitor)/' \
  'a domain library includes no adapter'
forbid '^simulator/[^/]+$' '(trainer|monitor)/' 'domains stay apart'
forbid '^trainer/[^/]+$' '(simulator|monitor)/' 'domains stay apart'
forbid '^monitor/[^/]+$' '(simulator|trainer)/' 'domains stay apart'
forbid '^idl/' '(storage|simulator|trainer|monitor)/' \
  'idl knows the vocabulary only'
forbid '^storage/[^/]+$' '(idl|simulator|trainer|monitor)/' \
  'storage knows the vocabulary only'
forbid '^(diagnosis|storage|simulator|trainer|monitor)/' '(fastdds|fastrtps|fastcdr)/' \
  'Fast DDS belongs to idl'
forbid '^(diagnosis|idl|simulator|trainer|monitor)/' '(sqlite3\.h|SQLiteCpp/)' \
  'SQLite belongs to storage'
forbid '^(diagnosis|idl|storage|trainer|monitor)/' '(cvode|nvector|sun[a-z]+)/' \
  'SUNDIALS belongs to simulator'
forbid '^(diagnosis|idl|simulator|trainer|monitor|storage)/[^/]+$' '(CLI/|toml\+\+|spdlog/|nlohmann/)' \
  'command line, TOML, logging and JSON belong to the programs'
forbid '^monitor/(console|http)/' '(idl|simulator|trainer)/' \
  'the console knows monitor and storage only'
forbid '^(diagnosis|idl|simulator|trainer|storage)/' 'httplib\.h' \
  'HTTP belongs to the monitor'
exit "$failed"
