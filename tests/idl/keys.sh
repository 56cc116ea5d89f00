#!/usr/bin/env bash
# Tests the script fdi-keys: openssl accepts what it makes, and it refuses what it
# must not do. The test security_test covers service to such a key.
# Usage: keys.sh FOLDER-OF-PROGRAMS
set -euo pipefail
keys=$(realpath "$1")/fdi-keys
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "keys: $*" >&2
  exit 1
}
refused() {  # STATUS TEXT ARGUMENTS...
  local status=$1 text=$2 got=0
  shift 2
  "$keys" "$@" >out 2>err || got=$?
  [ $got = "$status" ] || fail "$* ended with $got: $(cat err)"
  grep -qF -- "$text" err || fail "$* said: $(cat err)"
}
mode() { stat -c %a "$1"; }
days_left() {  # CERTIFICATE
  local end
  end=$(openssl x509 -in "$1" -noout -enddate)
  echo $(((86399 + $(date -d "${end#*=}" +%s) - $(date +%s)) / 86400))
}
nothing_beside() {  # FOLDER
  [ -z "$(find "$1" -name '.?*' -o -name '*.new')" ] || fail "$1: $(ls -A "$1")"
}

"$keys" init keys --days 100 >out
grep -q 'an authority, no key yet' out || fail "init said: $(cat out)"
"$keys" list keys | grep -q 'no key yet' || fail 'a list without keys'
"$keys" add keys monitor-1 --role monitor --days 10 >out
grep -q '^monitor-1  *monitor  *-  *20' out || fail "add said: $(cat out)"
"$keys" add keys gateway-1 --role=gateway --partition=hall-1,hall-2 >out
"$keys" add keys late --role reader --days 1000 >out

# The files that it makes are sound.
[ "$(mode keys/ca.key) $(mode keys/late/key.pem)" = '600 600' ] ||
  fail 'a private key is open to others'
[ "$(mode keys/ca.pem) $(mode keys/late/cert.pem)" = '644 644' ] ||
  fail 'a certificate is not for all'
for key in monitor-1 gateway-1 late; do
  openssl verify -CAfile keys/ca.pem -purpose sslclient "keys/$key/cert.pem" >out
  for document in governance permissions; do
    openssl smime -verify -text -in "keys/$key/$document.p7s" -CAfile keys/ca.pem \
      -out "$key.$document" 2>err || fail "$key/$document: $(cat err)"
  done
  cmp keys/ca.pem "keys/$key/ca.pem"
done
grep -q '<partition>hall-1</partition><partition>hall-2</partition>' \
  gateway-1.permissions || fail 'the partitions are not granted'
grep -q '<default>DENY</default>' late.permissions || fail 'no default'
! grep -q '<publish>' late.permissions || fail 'a reader may publish'
[ "$(days_left keys/monitor-1/cert.pem)" = 10 ] || fail 'not ten days'
[ "$(days_left keys/late/cert.pem)" = 100 ] ||
  fail 'a key outlasts its authority'
! openssl smime -verify -text -in <(openssl smime -sign -text \
  -in late.permissions -signer keys/late/cert.pem -inkey keys/late/key.pem) \
  -CAfile keys/ca.pem >out 2>err || fail 'a key can sign permissions'
[ "$("$keys" list keys | awk '{print $1}' | paste -sd ' ')" = \
  'KEY gateway-1 late monitor-1' ] || fail "the list: $("$keys" list keys)"

# A renewed key is another one with the same rights, whatever is beside it.
cp keys/gateway-1/key.pem before
rm keys/monitor-1/key.pem
mkdir keys/lost+found
"$keys" renew keys gateway-1 --days 20 >out
grep -q '^gateway-1  *gateway  *hall-1,hall-2 ' out || fail "renew: $(cat out)"
! cmp -s before keys/gateway-1/key.pem || fail 'the key is the old one'
[ "$(days_left keys/gateway-1/cert.pem)" = 20 ] || fail 'not twenty days'
nothing_beside keys
refused 2 'monitor-1/key.pem: cannot be read' renew keys monitor-1
rm -r keys/lost+found keys/monitor-1
"$keys" add keys monitor-1 --role monitor >out

# One that was killed between its two renames is completed by the next call.
mv keys/late keys/.late.old
cp -r keys/gateway-1 keys/.late.new
"$keys" renew keys late >out
grep -q '^late  *reader ' out || fail "after a kill: $(cat out)"
nothing_beside keys

# Nothing is replaced unasked, and no private key stays beside.
refused 2 'has an authority already' init keys
refused 2 'monitor-1 is there; fdi-keys renew' add keys monitor-1 --role reader
refused 5 "no key 'nobody'" renew keys nobody
refused 2 'has no authority; fdi-keys init' add . a --role reader
refused 2 'has no authority; fdi-keys init' list .
mkdir other
ln -s nowhere other/ca.key
refused 3 'other/ca.key: exists' init other
[ -L other/ca.key ] || fail "the link is gone"
nothing_beside other

# An interrupted authority is completed with the key that it has.
written=()
for next in ca.key governance.p7s ca.pem; do
  rm -rf half
  mkdir half
  for file in "${written[@]}"; do cp -p "keys/$file" half; done
  echo '-----BEGIN' >"half/$next.new"
  "$keys" init half >out
  "$keys" add half monitor-1 --role monitor >out
  [ ${#written[@]} = 0 ] || cmp keys/ca.key half/ca.key
  nothing_beside half
  written+=("$next")
done

for name in '' .hidden a/b 'a b' $'a\n' ä "$(printf 'a%.0s' {1..65})"; do
  refused 2 'expected 1 to 64 letters' add keys "$name" --role reader
done
for days in 0 -1 36501 x; do
  refused 2 'accepted are 1 to 36500' add keys a --role reader --days "$days"
  refused 2 'accepted are 1 to 36500' init fresh --days "$days"
done
refused 2 'accepted are gateway, monitor or reader' add keys a --role boss
refused 2 'is for keys of gateways' add keys a --role reader --partition p
refused 2 'at most 8 names' add keys a --role gateway --partition 'a*'
refused 2 'expected FOLDER NAME' add keys --role reader
refused 2 'unknown option --for' list keys --for x
refused 2 'expected init, add, renew or list' show keys

# The list names the file of a key that is not as it was made.
chmod 644 keys/late/key.pem
refused 2 'late/key.pem: others can read' list keys
chmod 600 keys/late/key.pem
sed -i 's/ValveSample/ValveSampl*/' keys/gateway-1/permissions.p7s
refused 2 'gateway-1/permissions.p7s: its signature does not hold' list keys
for file in cert.pem key.pem governance.p7s permissions.p7s ca.pem; do
  rm -rf mixed
  cp -rp half mixed
  cp keys/late/$file mixed/monitor-1
  chmod 600 mixed/monitor-1/key.pem
  refused 2 "mixed/monitor-1/" list mixed
done
echo 'keys: ok'
