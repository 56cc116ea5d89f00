# For scripts: `domain`, a domain in 60..99 that no other test on this machine
# has as long as this shell and what it starts live. As TestDomain in
# tests/idl/test_domain.h, whose locks may be another user's: they are read only.
domain=
for id in $(seq 60 99); do
  lock=/tmp/fdi-test-domain-$id.lock
  [ -e "$lock" ] || : 2>/dev/null >"$lock" || true
  if { exec 9<"$lock"; } 2>/dev/null && flock -n 9; then
    domain=$id
    break
  fi
done
[ -n "$domain" ] || {
  echo "no free test domain" >&2
  exit 1
}
