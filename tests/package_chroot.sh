#!/usr/bin/env bash
# Installs a package in a fresh Debian of the release that it was built on, where
# programs, pages and the service have to work, and removes it again. Says how
# long the first steps of a new user take. Needs root, debootstrap and the network.
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

taken() {  # SINCE WHAT
  times+="; $2 $(awk "BEGIN {printf \"%.1f\", $(date +%s.%N) - $1}") s"
}
times=
begin=$(date +%s.%N)
quietly within apt-get install -y -q /fdi.deb
taken "$begin" "package with what it needs"
quietly within apt-get install -y -q man-db bash
within getent passwd fdi >/dev/null || fail "no user fdi"
[ ! -e "$root/etc/systemd/system/multi-user.target.wants/fdi-monitor.service" ] ||
  fail "the service is enabled"
for program in fdi-monitor fdi-simulator fdi-store fdi-trainer fdi-gateway; do
  within $program --version
  quietly within man $program
done

# As a new user: from an empty directory to a fault that has a name, and from a
# file of one's own, of half an hour, to its models.
begin=$(date +%s.%N)
quietly within sh -ec 'cd /empty
  ln -s /usr/share/fdi/campaigns .
  fdi-trainer train --campaign campaigns/paper.toml
  fdi-monitor run --model-set paper --console=127.0.0.1:0 2>monitor.log &
  echo $! >monitor.pid
  timeout 60 sh -c "until grep -q monitor_ready monitor.log; do sleep 0.1; done"
  fdi-simulator run --valve FV-101 --parameters paper-operating-point \
    --duration 600 --speed 20 --set excitation.amplitude_pct=12 \
    --set excitation.period_s=60 --fault f19:abrupt@120:strength=0.5 &
  echo $! >simulator.pid
  timeout 60 sh -c "until fdi-store history list --json | grep f19; do sleep 0.2; done"'
taken "$begin" "to the named fault"
quietly within sh -ec 'cd /empty
  kill $(cat simulator.pid monitor.pid)
  while kill -0 $(cat monitor.pid) 2>/dev/null; do sleep 0.1; done
  fdi-store history plot last --output episode.png
  test -s episode.png
  grep console_listening monitor.log
  fdi-simulator run --excitation sine --duration 1800 --speed max --no-publish \
    -o own.csv'
begin=$(date +%s.%N)
quietly within sh -ec 'cd /empty
  fdi-store runs sniff own.csv -o tags.toml
  fdi-trainer onboard --valve OWN --file own.csv --map tags.toml'
taken "$begin" "own file to its models"

# The administrator's changes stay; so do data.
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
echo "package_chroot: $suite: installed, used, reinstalled, removed and purged$times"
