#!/usr/bin/env bash
# Installs a package in a fresh Debian of the release that it was built on, where
# programs, pages and the service have to work, and removes it again. Needs root,
# debootstrap and the network.
# Usage: package_chroot.sh FILE.deb
set -euo pipefail
package=$(realpath "$1")
root=$(mktemp -d)
finish() {
  for place in proc dev; do
    ! mountpoint -q "$root/$place" || umount "$root/$place"
  done
  rm -rf --one-file-system "$root"
}
trap finish EXIT
fail() {
  echo "package_chroot: $*" >&2
  exit 1
}
within() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 \
  HOME=/root DEBIAN_FRONTEND=noninteractive "$@"; }
quietly() {
  "$@" >"$root/log" 2>&1 || fail "$* failed: $(tail -20 "$root/log")"
}

suite=$(. /etc/os-release && echo "$VERSION_CODENAME")
mirror=${FDI_DEBIAN_MIRROR:-http://deb.debian.org/debian}
debootstrap --variant=minbase "$suite" "$root" "$mirror" >/dev/null
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
cp "$package" "$root/fdi.deb"
mkdir "$root/empty"

quietly within apt-get install -y -q /fdi.deb man-db bash
within getent passwd fdi >/dev/null || fail "no user fdi"
[ ! -e "$root/etc/systemd/system/multi-user.target.wants/fdi-monitor.service" ] ||
  fail "the service is enabled"
for program in fdi-monitor fdi-simulator fdi-store fdi-trainer; do
  within $program --version
  quietly within man $program
done

# As a new user: from an empty directory to an episode.
quietly within sh -ec 'cd /empty
  fdi-trainer train --campaign /usr/share/fdi/campaigns/paper.toml
  fdi-monitor run --model-set paper --console=127.0.0.1:0 2>monitor.log &
  monitor=$!
  timeout 60 sh -c "until grep -q monitor_ready monitor.log; do sleep 0.1; done"
  fdi-simulator run --valve FV-101 --parameters paper-operating-point \
    --duration 600 --speed max --set excitation.amplitude_pct=12 \
    --set excitation.period_s=60 --fault f19:abrupt@120:strength=0.5
  kill $monitor
  wait $monitor
  fdi-store history list --fault f19
  fdi-store history plot last --output episode.png
  test -s episode.png
  grep console_listening monitor.log'
within sh -c 'cd /empty && fdi-store history list --fault f19 --json' |
  grep -q '"fault": "f19"' || fail "no episode of f19"

# What the administrator changed stays; so do data.
echo 'FDI_MONITOR_OPTIONS=--record' >"$root/etc/default/fdi-monitor"
install -d "$root/var/lib/fdi"
quietly within apt-get install -y -q --reinstall /fdi.deb
grep -q -- --record "$root/etc/default/fdi-monitor" || fail "conffile was replaced"
quietly within apt-get remove -y -q fdi
[ ! -e "$root/usr/bin/fdi-store" ] || fail "programs were left behind"
quietly within dpkg --purge fdi
grep -q 'left in place' "$root/log" || fail "purge does not say what it leaves"
[ -d "$root/var/lib/fdi" ] || fail "purge removed the data"
[ ! -e "$root/etc/default/fdi-monitor" ] || fail "purge left the conffile"
[ -z "$(within dpkg-query -W -f '${Status}' fdi 2>/dev/null)" ] ||
  fail "still known to dpkg"
echo "package_chroot: $suite: installed, used, reinstalled, removed and purged"
