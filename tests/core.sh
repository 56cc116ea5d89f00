#!/usr/bin/env bash
# Checks that the core does without its optional components: configures the tree
# with all of them OFF, and makes the programs that have parts of them from the
# libraries of BUILD_DIRECTORY, which compile as they do there. Then asks the
# programs for what they lack.
# Usage: core.sh BUILD_DIRECTORY
set -euo pipefail
build=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
core=$(mktemp -d)
trap 'rm -rf "$core"' EXIT
fail() {
  echo "core: $*"
  exit 1
}
cmake --preset release -B "$core" -DBUILD_TESTING=OFF -DFDI_PACKAGE=OFF \
  -DFDI_BENCH=OFF -DFDI_CONSOLE=OFF -DFDI_GATEWAY=OFF -DFDI_PLANNER=OFF -DFDI_PLANT=OFF >"$core/log" 2>&1 ||
  fail "$(cat "$core/log")"

mkdir -p "$core/bin"
make_program() {  # NAME
  local library
  ninja -C "$core" -t commands "bin/$1" | sed "s#$PWD/##g" >"$core/$1.sh"
  ! grep -E '(^| |/)(console|gateway|planner|plant)/' "$core/$1.sh" || fail "$1 needs these"
  for library in $(grep -oE '[a-z_/]+/libfdi_[a-z_]+\.a' "$core/$1.sh" | sort -u); do
    [[ $library == programs/* ]] || ln -sf "$build/$library" "$core/$library"
  done
  # Unoptimised, which takes half the time.
  ninja -C "$core" -t commands "bin/$1" | grep programs/ |
    sed 's/ -O[0-9] / -O0 /' >"$core/$1.sh"
  (cd "$core" && bash -e "$1.sh") || fail "$1 is not made"
  "$core/bin/$1" --check-examples
}
make_program fdi-store &
store=$!
make_program fdi-monitor
wait "$store"

refused() {  # OPTION PROGRAM ARGUMENT...
  local answer
  ! answer=$("$core/bin/$2" --data "$core/data" "${@:3}" 2>&1) ||
    fail "${*:2} is not refused"
  [[ $answer == *" is not in this build: it takes one that was made with -D$1=ON"* ]] ||
    fail "${*:2} answers: $answer"
}
refused FDI_PLANNER fdi-store worklist
refused FDI_PLANNER fdi-store health --valve V1
refused FDI_PLANT fdi-store ship --db postgresql:///plant
refused FDI_PLANT fdi-store history list --db postgresql:///plant
refused FDI_PLANNER fdi-monitor run --groups groups.toml
refused FDI_CONSOLE fdi-monitor run --console
refused FDI_PLANT fdi-monitor console --db postgresql:///plant
