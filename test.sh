#!/usr/bin/env bash
# Installs what is missing, builds Release and passes the tests.
set -euo pipefail
cd "$(dirname "$0")"
cmake/prepare.sh tests
# Many tests wait for others, and only those that measure delays run alone.
ctest --preset release -j$(($(nproc) + 1))
