#!/usr/bin/env bash
# Checks that each third-party library stays where it belongs. Our own layers are
# enforced by the compiler, see cmake/FdiTargets.cmake.
set -u
cd "$(dirname "$0")/.."
failed=0
[ -n "$(git ls-files '*.cpp')" ] || {
  echo "include_rules: git knows no sources here"
  exit 1
}

forbid() {  # WHERE(regex of file) WHAT(regex of include) WHY
  local hits
  hits=$(git ls-files '*.h' '*.cpp' | grep -E "$1" |
    xargs -r grep -nE "#include [<\"]$2")
  if [ -n "$hits" ]; then
    printf '%s:\n%s\n' "$3" "$hits"
    failed=1
  fi
}

forbid '^(diagnosis|storage|cli|simulator|trainer|monitor)/' '(fastdds|fastrtps|fastcdr)/' \
  'Fast DDS belongs to idl'
forbid '^(diagnosis|idl|cli|simulator|trainer|monitor)/' '(sqlite3\.h|SQLiteCpp/)' \
  'SQLite belongs to storage'
forbid '^(diagnosis|idl|cli|simulator|trainer|monitor|storage/(app|database|history|models|runs))/' 'libpq' \
  'PostgreSQL belongs to storage/plant'
forbid '^(diagnosis|idl|cli|storage|trainer|monitor)/' '(cvode|nvector|sun[a-z]+)/' \
  'SUNDIALS belongs to simulator'
forbid '^((diagnosis|idl|simulator|trainer|monitor)/[^/]+$|storage/(database|runs|models|history|plant)/)' '(CLI/|toml\+\+|spdlog/|nlohmann/)' \
  'command line, TOML, logging and JSON belong to the programs'
forbid '^(diagnosis|idl|cli|simulator|trainer|storage)/' 'httplib\.h' \
  'HTTP belongs to the monitor'
exit "$failed"
