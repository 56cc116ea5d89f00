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

forbid '^(base|diagnosis|storage|import|report|simulator|trainer|monitor|console|gateway|planner|plant|programs)/' '(fastdds|fastrtps|fastcdr)/' \
  'Fast DDS belongs to idl'
forbid '^(base|diagnosis|idl|import|report|simulator|trainer|monitor|console|gateway|planner|plant|programs)/' '(sqlite3\.h|SQLiteCpp/)' \
  'SQLite belongs to storage'
forbid '^(base|diagnosis|idl|import|report|simulator|trainer|monitor|console|gateway|planner|storage|programs)/' 'libpq' \
  'PostgreSQL belongs to plant'
forbid '^(base|diagnosis|idl|import|report|storage|trainer|monitor|console|gateway|planner|plant|programs)/' '(cvode|nvector|sun[a-z]+)/' \
  'SUNDIALS belongs to simulator'
forbid '^((diagnosis|idl|simulator|trainer|monitor)/[^/]+$|(base|plant|storage)/)' '(CLI/|spdlog/|nlohmann/)' \
  'command line, logging and JSON belong to the programs'
forbid '^(base|diagnosis|idl|import|report|simulator|storage|trainer|monitor|console|planner|plant|programs)/' '(mosquitto|google/protobuf|.*\.pb\.h)' \
  'MQTT and Protocol Buffers belong to gateway'
forbid '^(diagnosis|idl|import|simulator|storage|trainer|monitor|console|gateway|planner|plant|programs)/' 'toml\+\+' \
  'TOML belongs to base and to the options'
forbid '^(diagnosis|idl|import|report|simulator|storage|trainer|monitor|console|gateway|planner|plant|programs|bench)/' 'date/' \
  'time zones belong to base'
forbid '^((base|diagnosis|idl|import|report|simulator|trainer|storage|gateway|plant|programs)/|planner/(live/|[^/]+$))' 'httplib\.h' \
  'HTTP belongs to the monitor and to the page, with what planner/page adds to it'
forbid '^(diagnosis|idl|import|simulator|storage|trainer|monitor|console|gateway|planner|plant|programs|bench)/' '(shared_)?mutex>' \
  'mutexes are those of base/mutex.h, which clang checks'
exit "$failed"
