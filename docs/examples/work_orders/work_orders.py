#!/usr/bin/env python3
"""Rows for SAP PM or Maximo from the work list, or from one event.

    fdi-store worklist --rows 0 --csv | work_orders.py sap > notifications.csv
    fdi-monitor run --on-event "sh -c 'work_orders.py maximo >> requests.jsonl'"

sap writes the fields of a PM notification (BAPI_ALM_NOTIF_CREATE), one a line of
CSV; maximo writes service requests (object structure MXSR), one a line of JSON.
The id of the episode is the external reference: import each of them once. Rows
without an episode, such as a trend, are left out: they have no such id. So are
notices, until an alarm is made of one.
"""
import csv
import json
import sys

PRIORITIES = {"critical": 1, "high": 2, "medium": 3, "low": 4}


def findings(text):
    """The rows of a work list that stand, or the name of an event."""
    if not text.lstrip().startswith("{"):
        for row in csv.DictReader(text.splitlines()):
            # A row that is over or ordered already needs no further order.
            if (row["open"] == "true" and row["episode_id"]
                    and row["kind"] != "notice" and not row["in_work_utc"]):
                yield {**row, "utc": row["detected_utc"],
                       "location": row["about_location"],
                       "reference": row["episode_id"]}
        return
    event = json.loads(text)
    # RAISED: a notice became an alarm. It may have had its name before.
    if (event["kind"] not in ("ISOLATED", "RAISED") or not event["name"]
            or event["shelved"]):
        return
    about = event["about"] or {}
    yield {**event, "utc": event["stamp_utc"],
           "location": about.get("location") or "",
           "reference": event["episode_id"],
           "why": " or ".join([event["name"], *event["look_alikes"]])
                  + f", {event['certainty']}"}


def sap(row):
    day, _, time = row["utc"].partition("T")
    return {"NOTIF_TYPE": "M2", "FUNCT_LOC": row["valve_id"],
            "SHORT_TEXT": f"{row['valve_id']}: {row['name']}"[:40],
            "PRIORITY": PRIORITIES[row["severity"]],
            "STRMLFNDATE": day.replace("-", ""),
            "STRMLFNTIME": time[:8].replace(":", ""),
            "LONG_TEXT": f"{row['why']}. {row['check']}",
            "REFERENCE": row["reference"]}


def maximo(row):
    return {"description": f"{row['valve_id']}: {row['name']}"[:100],
            "description_longdescription": f"{row['why']}. {row['check']}",
            "assetnum": row["valve_id"], "location": row["location"],
            "reportedpriority": PRIORITIES[row["severity"]],
            "reportdate": row["utc"], "externalrecid": row["reference"]}


def main():
    form = {"sap": sap, "maximo": maximo}.get(" ".join(sys.argv[1:]))
    if form is None:
        sys.exit(__doc__)
    rows = [form(row) for row in findings(sys.stdin.read())]
    if form is maximo:
        for row in rows:
            print(json.dumps(row, ensure_ascii=False))
    elif rows:
        out = csv.DictWriter(sys.stdout, rows[0], lineterminator="\n")
        out.writeheader()
        out.writerows(rows)


main()
