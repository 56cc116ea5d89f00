#!/usr/bin/env bash
# The page answers as docs/openapi.yaml has it: status, kind and schema of
# each GET, and the refusal of each POST, which a page on loopback without a proxy
# in front answers with 403. 77 without python3-yaml or python3-jsonschema.
# Usage: openapi.sh FOLDER-OF-PROGRAMS
set -euo pipefail
tests=$(cd "$(dirname "$0")/.." && pwd)
/usr/bin/python3 -c 'import jsonschema, yaml' 2>/dev/null || {
  echo "openapi: skipped (Debian: apt install python3-yaml python3-jsonschema)"
  exit 77
}
source "$tests/system/programs.sh" "$1"
"$bin/fdi-trainer" train --campaign "$tests/survival/quick.toml" >/dev/null 2>train.log
start --model-set quick --console=127.0.0.1:0
"$bin/fdi-simulator" --domain "$domain" run --valve V1 --speed 100 --duration 400 \
  --seed 7 --parameters paper-operating-point --set excitation.amplitude_pct=8 \
  --set excitation.period_s=80 --fault f19:abrupt@100:strength=0.5 \
  >/dev/null 2>feed.log
address=$(sed -n 's/.*console_listening address=\([0-9.:]*\).*/\1/p' monitor.log)
timeout 30 bash -c "until [ \"\$(sqlite3 -readonly $FDI_DATA/history.db \
  'select count(*) from episode where ended_ns')\" = 1 ]; do sleep 0.1; done" ||
  fail "no episode"
/usr/bin/python3 - "$tests/../docs/openapi.yaml" "http://$address" <<'PY' || fail "not as described"
import json, sys, urllib.error, urllib.request
import jsonschema, yaml

api = yaml.safe_load(open(sys.argv[1]))
base = sys.argv[2] + api["servers"][0]["url"]

def described(where):  # Follows a reference.
    while "$ref" in where:
        name = where["$ref"]
        where = api
        for part in name[2:].split("/"):
            where = where[part]
    return where

def check(answer, content):
    kind = answer.headers.get_content_type()
    assert kind in content, kind
    if "schema" in content[kind]:
        schema = dict(content[kind]["schema"], components=api["components"])
        jsonschema.Draft202012Validator.check_schema(schema)
        jsonschema.Draft202012Validator(schema).validate(json.loads(answer.read()))

names, answers, refused = set(), 0, 0
for path, methods in api["paths"].items():
    for method, operation in methods.items():
        what = method + " " + path
        names.add(operation["operationId"])
        needed = {described(p)["name"] for p in operation.get("parameters", [])
                  if described(p)["in"] == "path"}
        assert needed == {p[1:p.index("}")] for p in path.split("/") if "{" in p}, what
        body = operation.get("requestBody")
        url = path.format(valve="V1", episode="last" if not body else "1", shelf=1)
        request = urllib.request.Request(base + url, method=method.upper(),
            data=b"{}" if body else None, headers={"Content-Type": "application/json"})
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                content = operation["responses"]["200"]["content"]
                check(answer, content)
                answers += 1
        except urllib.error.HTTPError as error:
            check(error, described(operation["responses"]["default"])["content"])
            # A picture takes gnuplot.
            assert error.code == 403 if body else error.code == 404 and path[-4:] in (".svg", ".png"), what
            refused += 1
        except Exception as error:
            raise SystemExit(f"{what}: {error}")
assert len(names) == answers + refused, "an operationId occurs twice"
print(f"openapi: {answers} answers, {refused} refusals as described")
PY
stop
