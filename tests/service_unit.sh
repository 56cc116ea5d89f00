#!/usr/bin/env bash
# Checks a built unit file: known keys only, a limit of memory, no call
# forbidden that the program makes, and an exposure of at most 2 of 10.
# Usage: service_unit.sh UNIT PROGRAM [INSTANCE]
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

# The calls of the groups that the unit takes away, and gives back after that.
mapfile -t groups < <(grep -oE '^SystemCallFilter=~.*' "$checked" |
  grep -oE '@[a-z-]+')
forbidden=$(systemd-analyze syscall-filter --no-pager "${groups[@]}" |
  grep -oE '^ +[a-z0-9_]+$' | tr -d ' ' | sort -u)
given=$(sed -nE 's/^SystemCallFilter=([a-z0-9_ ]+)$/\1/p' "$checked" |
  tr ' ' '\n')
made=$(nm -D --undefined-only "$program" | grep -oE '[a-z0-9_]+(@|$)' |
  tr -d '@' | sort -u | comm -12 - <(echo "$forbidden"))
for call in $made; do
  if ! grep -qx "$call" <<<"$given"; then
    echo "the program calls $call, which the unit forbids"
    exit 1
  fi
done
systemd-analyze security --offline=true --threshold=20 --no-pager "$checked" |
  tail -1
