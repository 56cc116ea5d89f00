#!/usr/bin/env bash
# Installs what is missing, builds Release and passes the tests.
set -euo pipefail
cd "$(dirname "$0")"
cmake/prepare.sh
if ! command -v chromium >/dev/null; then  # For the tests of the live page.
  as_root=()
  [ "$(id -u)" -eq 0 ] || as_root=(sudo)
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends chromium >/dev/null
fi
# A second chance for tests that a paused machine makes wait too long.
ctest --preset release -j2 --repeat until-pass:2
