#!/usr/bin/env bash
# A simulated server on loopback, a client of it that prints readings, and
# `fdi-gateway in --lines -` feed a monitor. The server is gone for 40 samples, has readings that are bad
# and a time in manual; the monitor has to find the fault, and the gateway to
# count what was lost. The OPC UA server lacks one tag, has another of a wrong type,
# and numbers its namespaces otherwise when it is back.
# Usage: gateway.sh PROGRAMS opcua NODE_MODULES | PROGRAMS modbus
# 77 without what it takes.
set -euo pipefail
way=$2
modules=${3:+$(realpath "$3")}
tests=$(cd "$(dirname "$0")/.." && pwd)
modbus=$tests/../docs/examples/modbus_gateway
opcua=$tests/../gateway/opcua
skip() {
  echo "gateway: skipped, $*"
  exit 77
}
if [ "$way" = opcua ]; then
  command -v node >/dev/null || skip "no node (Debian: apt install nodejs)"
  [ -d "$modules/node-opcua-server" ] || skip "npm has not fetched node-opcua"
else
  pkg-config --exists libmodbus || skip "no libmodbus-dev"
fi
source "$tests/system/programs.sh" "$1"
finish() {
  exec 2>/dev/null
  kill -9 ${gateway:-} ${server:-} ${monitor:-} || true
  rm -rf "$work"
}
trap finish EXIT
await() {  # WORD FILE
  timeout 30 sh -c 'until grep -q "$0" "$1"; do sleep 0.05; done' "$1" "$2" ||
    fail "no $1 in $2 within 30 s"
}

count=420
port=$((16000 + domain))  # No ephemeral one, nor one of a test's domain.
"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" \
  >/dev/null 2>train.log
"$bin/fdi-store" valves assign FV-101 quick >/dev/null
"$bin/fdi-simulator" run --no-publish --duration $count --seed 7 \
  --parameters paper-operating-point --fault f19:abrupt@200:strength=0.5 \
  --set excitation.amplitude_pct=8 --set excitation.period_s=80 \
  -o valve.csv --log-level error >/dev/null
start --record --model-set quick

if [ "$way" = opcua ]; then
  cp "$opcua/client.mjs" "$tests/gateways/opcua_server.mjs" .
  ln -s "$modules" node_modules
  cat >plant.toml <<'END'
[[loop]]
name = "FV-101"
op = "FIC101.OP"
x = "ZT101.PV"
mode = "FIC101.MODE"
auto = "1"
manual = "0"
sense = "opening"
p1 = "PT101.PV"
p1_unit = "bar g"
p2 = "PT102.PV"
p2_unit = "bar g"
t1 = "TT101.PV"
f = "FT101.PV"
f_unit = "l/s"
pv = "GONE.PV"
sp = "NOTE.SP"
END
  export FDI_GATEWAY=$bin/fdi-gateway
  run=(node client.mjs plant.toml --endpoint "opc.tcp://127.0.0.1:$port"
    --interval 0 --node 'nsu=urn:plant;s={tag}')
  # A server that nobody has trusted, one whose certificate has expired, and another.
  certify() {  # OPTION...
    openssl req -newkey rsa:2048 -nodes -keyout plant.key -out plant.csr \
      -subj /CN=plant -addext "subjectAltName=URI:urn:$(hostname):NodeOPCUA-Server,IP:127.0.0.1" \
      -addext keyUsage=digitalSignature,nonRepudiation,keyEncipherment,dataEncipherment \
      -addext extendedKeyUsage=serverAuth,clientAuth 2>/dev/null
    openssl x509 -req -in plant.csr -signkey plant.key -copy_extensions copy "$@" \
      -out plant.pem 2>/dev/null
  }
  # OpenSSL 3.4 and later refuse an end before the start, and take both as dates.
  expired=(-days -1)
  ! openssl x509 -help 2>&1 | grep -q -- -not_after ||
    expired=(-not_before 20200101000000Z -not_after 20200102000000Z)
  trust() { mv "$FDI_DATA"/opcua-client/rejected/* "$FDI_DATA/opcua-client/trusted/certs"; }
  serve() {
    node opcua_server.mjs valve.csv $port "$@" 2>server.log &
    server=$!
    await ready server.log
  }
  end_server() {
    kill -9 $server
    wait $server 2>/dev/null || true
  }
  certify "${expired[@]}"
  serve plant.pem plant.key
  # An error that no promise catches is but the end of a connection. It comes a
  # second after the client can take it, however long that takes.
  echo "const timer = setInterval(() => {
    if (process.listenerCount('uncaughtException') === 0) return;
    clearInterval(timer);
    setTimeout(() => { throw Error('thrown'); }, 1000);
  }, 100);" >thrown.mjs
  node --import ./thrown.mjs "${run[@]:1}" --security Basic256Sha256 >>secure.txt 2>>secure.log &
  gateway=$!
  await BadCertificateUntrusted secure.log
  trust
  await BadCertificateTimeInvalid secure.log
  [ ! -s secure.txt ] || fail "readings of a server that is not trusted"
  end_server
  certify -days 1
  : >secure.log
  serve plant.pem plant.key
  await BadCertificateUntrusted secure.log
  trust
  await '"q":"good"' secure.txt
  kill -9 $gateway
  wait $gateway 2>/dev/null || true
  end_server
  serve
  sleep 3  # The clock of the server is behind, which the tag that it lacks must not hide.
else
  sed 's/^name = .*/name = "FV-101"/; s/"{loop}/"FIC101/' \
    "$modbus/plant.toml" >plant.toml
  cmake -S "$modbus" -B build >cmake.log
  cmake --build build >build.log 2>&1 || fail "does not build"
  ! grep warning: build.log || fail "warnings"
  cc -Wall -Wextra -Werror -o modbus_plc "$tests/gateways/modbus_plc.c" \
    $(pkg-config --cflags --libs libmodbus) -lm
  ./modbus_plc valve.csv $port 2>server.log &
  server=$!
  run=(build/modbus_gateway 127.0.0.1 $port 1 0.005 clock=0:u32 FIC101.MODE=2
    FIC101.OP=3 FIC101.ZT=4 TT101=5:i16:-32768:0.1 PT101=6:f32 PT102=8:f32
    FT101=10:f32)
fi
touch rows.txt
await ready server.log
began=$(grep -o 'ready [0-9]*' server.log | cut -d' ' -f2)
last=$((began + count - 1))
[ "$way" = modbus ] || last=$(date -u -d "@$last" +%FT%T)

"${run[@]}" 2>gateway.log > >(
  tee rows.txt | "$bin/fdi-gateway" --domain "$domain" in --plant plant.toml \
    --lines - >in.txt 2>in.log; echo "ended $?" >>in.txt) &
gateway=$!
await "$last" rows.txt
kill -TERM "$gateway"
wait "$gateway" || fail "the gateway ended with $?"
gateway=
await "^ended" in.txt
grep -q "^ended 0" in.txt || fail "$(cat in.txt in.log)"
stop

if [ "$way" = opcua ]; then
  grep -q "tag GONE.PV: BadNodeIdUnknown" gateway.log || fail "GONE.PV: $(cat gateway.log)"
  grep -q "reading_refused tag=NOTE.SP .*'ask the operator' is neither a number" in.log ||
    fail "NOTE.SP: $(cat in.log)"
fi
number() { sed -n "s/^$1: *//p" in.txt; }
runs() {  # COLUMNS, of what was recorded
  sqlite3 -readonly "$FDI_DATA/runs.db" \
    "select $1 from run where valve_id = 'FV-101'"
}
recorded=$(runs "sum(samples)")
first=$(runs "min(first_stamp_ns) / 1000000000")
lost=$((began + count - first - recorded))
[ "$recorded" -eq "$(number samples)" ] ||
  fail "$recorded of $(number samples) samples are recorded"
# Down for 40 rows; the first three are said to lack all signals.
[ "$lost" -ge 35 ] && [ "$lost" -le 42 ] || fail "$lost lost"
[ "$way" = opcua ] || grep -q "connected again" gateway.log ||
  fail "no reconnection"

# The readings are what the valve had, in its units, but for what a register
# rounds; the flow in t/h became m3/h again.
manual=0 without_x=0 without_f=0
for run in $(runs "id || ',' || (first_stamp_ns / 1000000000)"); do
  "$bin/fdi-store" runs export "${run%,*}" >run.csv
  awk -F, -v offset=$((${run#*,} - began)) '
    function same(a, b, off) { return a == "" || (a - b) ^ 2 <= off ^ 2 }
    NR == FNR { for (i = 2; i <= 7; ++i) true[FNR - 2, i] = $i; next }
    FNR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; next }
    { t = offset + $at["t_s"] }
    !(same($at["CV_pct"], true[t, 2], 0.006) &&
      same($at["P1_kPa"], true[t, 3], 0.01) &&
      same($at["P2_kPa"], true[t, 4], 0.01) &&
      same($at["T1_degC"], true[t, 5], 0.06) &&
      same($at["X_pct"], true[t, 6], 0.006) &&
      same($at["F_m3_h"], true[t, 7], 0.2)) { print "at " t ": " $0; exit 1 }
  ' valve.csv run.csv || fail "not what the valve had"
  manual=$((manual + $(grep -c MANUAL run.csv || true)))
  without() {  # COLUMN, of rows that have the command
    awk -F, -v column="$1" '
      NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i; next }
      $at["CV_pct"] != "" && (!at[column] || $at[column] == "") { ++n }
      END { print n + 0 }' run.csv
  }
  without_x=$((without_x + $(without X_pct)))
  without_f=$((without_f + $(without F_m3_h)))
done
[ $manual -eq 10 ] || fail "$manual of 10 rows in manual"
# Bad readings are missing, and no others.
if [ "$way" = opcua ]; then
  [ $without_x -eq 5 ] && [ $without_f -eq 0 ] ||
    fail "$without_x rows without X, $without_f without F"
else
  [ $without_x -eq 0 ] && [ $without_f -eq 4 ] ||
    fail "$without_x rows without X, $without_f without F"
fi
found=$(history "select ifnull(fault, 'unknown') from fault_history
  where valve_id = 'FV-101'")
[ "$found" = f19 ] || fail "episodes: $found"
echo "gateway: $(number readings) readings, $recorded samples, $lost lost; $found"
