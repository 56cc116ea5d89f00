# For foreign_publisher.sh and foreign_subscriber.sh, behind programs.sh: the
# programs of docs/examples/cyclone in ./build, and the model set `quick`. Ends
# the test with 77 without Cyclone DDS.
command -v idlc >/dev/null && [ -e /usr/include/dds/dds.h ] || {
  echo "$(basename "$0" .sh): skipped, no cyclonedds-dev and cyclonedds-tools"
  exit 77
}
example=$tests/../docs/examples/cyclone
export CYCLONEDDS_URI=file://$example/loopback.xml
cmake -S "$example" -B build -DCMAKE_BUILD_TYPE=Release >cmake.log 2>&1 ||
  fail "does not configure"
cmake --build build >build.log 2>&1 || fail "does not build"
! grep warning: build.log || fail "warnings"
"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" \
  >/dev/null 2>train.log || fail "does not train"
