#!/usr/bin/env bash
# Checks a built unit file: known keys only, a limit of memory, and an exposure
# of at most 2 of 10. Usage: service_unit.sh UNIT PROGRAM [INSTANCE]
# 77 without systemd-analyze.
set -euo pipefail
unit=$1
program=$2
command -v systemd-analyze >/dev/null || exit 77

folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
name=$(basename "$unit")
checked=$folder/${name/@./@${3:-}.}
sed "s#^ExecStart=[^ ]*#ExecStart=$program#" "$unit" >"$checked"

complaints=$(systemd-analyze verify --man=no "$checked" 2>&1 |
  grep "${name%%[@.]*}" || true)
if [ -n "$complaints" ]; then
  echo "$complaints"
  exit 1
fi
grep -q '^MemoryMax=[0-9]' "$checked"
systemd-analyze security --offline=true --threshold=20 --no-pager "$checked" |
  tail -1
