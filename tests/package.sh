#!/usr/bin/env bash
# Makes the Debian package, looks at what is in it and runs the programs from
# where it unpacks. With FDI_PACKAGE_CHROOT=1 also installs, upgrades, removes
# and purges it in a fresh Debian (needs root, debootstrap and the network), and
# asks lintian where there is one.
# Usage: package.sh BUILD_DIRECTORY
set -euo pipefail
build=$(cd "$1" && pwd)
folder=$(mktemp -d)
trap 'rm -rf --one-file-system "$folder"' EXIT
fail() {
  echo "package: $*" >&2
  exit 1
}

# The umask of the one who builds is not that of the package.
(umask 077 && cpack --config "$build/CPackConfig.cmake" -B "$folder" \
  >"$folder/cpack.log" 2>&1) ||
  fail "$(cat "$folder/cpack.log")"
package=$(ls "$folder"/fdi_*.deb)
root=$folder/root
dpkg-deb --extract "$package" "$root"
dpkg-deb --control "$package" "$folder/control"

for field in Package Version Maintainer Depends Recommends Description; do
  [ -n "$(dpkg-deb --field "$package" $field)" ] || fail "no $field"
done
for needed in libfast openssl; do
  dpkg-deb --field "$package" Depends | grep >/dev/null "$needed" ||
    fail "no dependency on $needed"
done
for script in postinst prerm postrm; do
  sh -n "$folder/control/$script"
done
[ "$(cat "$folder/control/conffiles")" = /etc/default/fdi-monitor ] ||
  fail "conffiles: $(cat "$folder/control/conffiles")"
dpkg-deb --contents "$package" | awk '$2 != "root/root" {bad = 1; print}
  END {exit bad}' || fail "files that are not root's"
dpkg-deb --contents "$package" | awk '$1 !~ /^.rw.r..r../ {bad = 1; print}
  END {exit bad}' || fail "files that not everybody may read"

for file in etc/default/fdi-monitor usr/lib/systemd/system/fdi-monitor.service \
  usr/lib/sysusers.d/fdi.conf usr/share/fdi/campaigns/paper.toml \
  usr/share/fdi/faults.toml usr/share/fdi/idl/fdi_v{1,2}.idl \
  usr/share/doc/fdi/{copyright,changelog.gz,changelog.Debian.gz,README.md} \
  usr/bin/fdi-keys usr/share/man/man1/fdi-keys.1.gz \
  usr/share/doc/fdi/docs/tutorial.md usr/share/fdi/console/index.html \
  usr/share/fdi/nginx/fdi.conf usr/lib/fdi/fdi_samples.so \
  usr/lib/systemd/system/fdi-gateway@.service usr/share/fdi/opcua/client.mjs \
  usr/share/fdi/opcua/server.mjs; do
  [ -s "$root/$file" ] || fail "$file is missing"
done
grep -q '^ExecStart=/usr/bin/fdi-monitor run' \
  "$root/usr/lib/systemd/system/fdi-monitor.service" || fail "ExecStart"
grep -q '^EnvironmentFile=-/etc/default/fdi-monitor$' \
  "$root/usr/lib/systemd/system/fdi-monitor.service" || fail "EnvironmentFile"
# So it is for a prefix below the current directory.
(cd "$folder" && cmake -D CMAKE_INSTALL_PREFIX=other \
  -P "$build/monitor/systemd/install.cmake" >/dev/null)
grep -q "^ExecStart=$folder/other/bin/fdi-monitor run" \
  "$folder/other/lib/systemd/system/fdi-monitor.service" ||
  fail "ExecStart of a relative prefix"

# A page for the program, its groups and their verbs: every word that --help
# lists has one.
pages() {  # PROGRAM WORDS...
  local page name
  name=$(IFS=-; echo "$*")
  page=$root/usr/share/man/man1/$name.1.gz
  gzip -dc "$page" | grep >/dev/null '^\.SH SYNOPSIS' || fail "no page $name(1)"
  if [ $# -eq 1 ] && command -v man >/dev/null; then
    man --local-file "$page" >"$folder/page" 2>&1 || fail "$name(1) is no page"
  fi
  "$root/usr/bin/$1" "${@:2}" --help >"$folder/help"
  local verb
  for verb in $(sed -n '/^Verbs:/,/^$/ s/^  \([a-z][a-z-]*\).*/\1/p' \
    "$folder/help"); do
    pages "$@" "$verb"
  done
}
# Not grep -q: it ends before its input does, which pipefail takes for a failure.
gzip -dc "$root/usr/share/man/man1/fdi-monitor-run.1.gz" |
  sed -E 's/\\f[A-Z]|\\[,/]//g' | grep >/dev/null -F '[=[ADDRESS:]PORT]' || fail "fdi-monitor-run(1) cuts --http at a colon"
version=$(dpkg-deb --field "$package" Version)
for program in fdi-monitor fdi-simulator fdi-store fdi-trainer fdi-gateway; do
  "$root/usr/bin/$program" --version | grep >/dev/null "^$program ${version%-*}+" ||
    fail "$program has another version than $version"
  bash -n "$root/usr/share/bash-completion/completions/$program"
  pages "$program"
done
export FDI_DATA=$folder/data
"$root/usr/bin/fdi-store" faults >/dev/null
"$root/usr/bin/fdi-simulator" run --no-publish --record --duration 60 \
  --log-level error >/dev/null
"$root/usr/bin/fdi-store" runs list >/dev/null
[ -s "$root/usr/share/fdi/campaigns/paper.toml" ] || fail "a campaign is missing"

echo "package: $(basename "$package"), $(stat -c %s "$package") bytes," \
  "$(find "$root" -name '*.1.gz' | wc -l) manual pages"
[ -n "${FDI_PACKAGE_CHROOT:-}" ] || exit 0

if command -v lintian >/dev/null; then
  errors=$(lintian --fail-on none "$package" 2>/dev/null | grep '^E:' || true)
  [ -z "$errors" ] || fail "$errors"
fi
"$(dirname "$0")/package_chroot.sh" "$package"
