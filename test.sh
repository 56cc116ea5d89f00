#!/usr/bin/env bash
# Installs what is missing, builds Release and passes the tests.
set -euo pipefail
cd "$(dirname "$0")"
cmake/prepare.sh tests
ctest --preset release -j2
