#!/usr/bin/env bash
# Sees the test of each rule (diagnosis/decision/rules.h) pass with all rules and
# fail with this one left out. A rule without a test is passed over.
#
#     rules.sh FDI_STUDY SWITCHED_TEST [--find]
# --find: lists the tests that fail without each rule, of all.
set -euo pipefail
list=$("$1" ablate --list --csv | tr -d '"' | tail -n +2)
failed=0
while IFS=, read -r rule test; do
  [ -n "$rule" ] || continue
  if [ "${3:-}" = --find ]; then
    echo "$rule: $(FDI_RULE_OFF=$rule "$2" 2>/dev/null |
      sed -nE 's/^\[  FAILED  \] ([A-Za-z]+\.[A-Za-z]+) \(.*/\1/p' | xargs)"
    continue
  fi
  [ -n "$test" ] || continue
  if [[ $("$2" --gtest_filter="$test" 2>&1) != *"[  PASSED  ] 1 test."* ]]; then
    echo "$rule: its test \"$test\" does not pass"
    failed=1
  elif FDI_RULE_OFF=$rule "$2" --gtest_filter="$test" >/dev/null 2>&1; then
    echo "$rule: $test passes without it"
    failed=1
  fi
done <<<"$list"
exit "$failed"
