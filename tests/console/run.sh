#!/usr/bin/env bash
# Tests of the live page in Chromium; 77 where there is none, or no node, or
# where the packages that drive it were not fetched.
# Usage: run.sh PROGRAMS NODE_MODULES [--pictures FOLDER]
# The first two are folders of the build. With --pictures no test runs: the
# pictures of the documents are made anew (docs/images).
set -euo pipefail
[ "${3:-}" != --pictures ] || pictures=$(realpath "$4")
set -- "$(realpath "$1")" "$(realpath "$2")"
cd "$(dirname "$0")"
FDI_CHROMIUM=$(command -v chromium) || {
  echo "skipped: chromium is not found (Debian: apt install chromium)"
  exit 77
}
command -v node >/dev/null || {
  echo "skipped: node is not found (Debian: apt install nodejs)"
  exit 77
}
PATH=$PATH:/usr/sbin
command -v nginx >/dev/null || {
  echo "skipped: nginx is not found (Debian: apt install nginx)"
  exit 77
}
[ -d "$2/playwright-core" ] || {
  echo "skipped: npm has not fetched what drives the browser (see the build)"
  exit 77
}
source ../domain.sh
export FDI_DOMAIN=$domain
export FDI_CHROMIUM FDI_BIN=$1 FDI_NODE_MODULES=$2
export FDI_CAMPAIGN=$PWD/../survival/quick.toml
[ -z "${pictures:-}" ] || exec node pictures.mjs "$pictures"
# Those without a browser together, then one after the other: the load is
# measured alone.
node --test csv.test.mjs route.test.mjs stream.test.mjs \
  trend_data.test.mjs
for file in console load roles views; do
  node --test "$file.test.mjs"
done
