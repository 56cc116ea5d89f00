#!/usr/bin/env python3
"""Scores records that others made: one line each, failures included.

    bench/real_data.py BIN DIR

Prints a table in Markdown. FDI_REFERENCE_DATA is the folder of the records;
none of them is part of this project, so each line says where its record comes
from. A record that is not there is skipped by name. DIR keeps the models.
"""

import csv
import json
import math
import os
import subprocess
import sys

PLANT = "plant/lublin_actuator3_2001-10-11_first40min.csv"
LUBLIN, LOOPS, PAIRS, AHU, TEP = "Lublin", "refinery", "plant", "AHU", "TEP"
ORIGINS = {
    LUBLIN: "actuator 3 of the sugar factory, 1 Hz; files of the DAMADICS benchmark, "
            "Warsaw University of Technology",
    PAIRS: "seven days at a sample a minute; "
           "nPoKhappy/control-valve-stiction-implementation, MIT",
    LOOPS: "10 s, labels by experts of the plant; TerenceXue-tech/StictionGPT, "
           "Apache-2.0",
    AHU: "cooling valve of an air handler, a day at 60 s; LBNL and ORNL, Granderson et "
         "al. 2020, doi 10.1038/s41597-020-0398-6, CC BY 4.0",
    TEP: "Tennessee Eastman process, of a simulator that is not ours; columns OP, PV",
}
MODEL = "the benchmark's own model errs by 1.956 % and 2.039 t/h on all 40 minutes"


class Missing(Exception):
    """A record is not there."""


class Study:
    def __init__(self, binaries, folder):
        self.binaries = binaries
        self.folder = folder
        self.data = os.environ["FDI_REFERENCE_DATA"]
        os.makedirs(folder, exist_ok=True)
        os.environ["FDI_DATA"] = os.path.join(folder, "data")

    def path(self, name):
        """The record; `name` may end with a stretch, as @0:1200."""
        if not os.path.exists(os.path.join(self.data, name.split("@")[0])):
            raise Missing(name)
        return os.path.join(self.data, name)

    def run(self, program, *words):
        done = subprocess.run([os.path.join(self.binaries, program), *words],
                              capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"real_data: {program} {' '.join(words)}: {done.stderr}")
        return done.stdout

    def rows(self, program, *words):
        return list(csv.DictReader(self.run(program, *words).splitlines()))

    def onboard(self, valve, name, *options):
        """Fits a valve once."""
        mark = os.path.join(self.folder, valve)
        if not os.path.exists(mark):
            self.run("fdi-trainer", "onboard", "--valve", valve,
                     "--no-coverage", "--file", self.path(name), *options)
            with open(mark, "w", encoding="ascii"):
                pass

    def half(self, fitted, scored):
        """RMSE and episodes of one half by the models of the other."""
        valve = "half" + fitted.split(":")[0]
        self.onboard(valve, f"{PLANT}@{fitted}")
        vectors = os.path.join(self.folder, valve + ".csv")
        row = self.rows("fdi-study", "evaluate", "--valve", valve, "--csv",
                        "--assume-normal", "--vectors", vectors, "--file",
                        self.path(f"{PLANT}@{scored}"))[0]
        errors = {"r_X": [], "r_F": []}
        with open(vectors, newline="", encoding="ascii") as file:
            for verdict in csv.DictReader(file):
                if verdict["quality"] == "LIVE":
                    for name, values in errors.items():
                        values.append(float.fromhex(verdict[name]))
        return int(row["episodes"]), *(
            math.sqrt(sum(e * e for e in v) / len(v)) for v in errors.values())

    def halves(self):
        first = self.half("0:1200", "1200:")
        second = self.half("1200:2400", "0:1200")
        found = "; ".join(
            f"X {x:.2f} %, F {f:.2f} t/h, {n} episode{'' if n == 1 else 's'}"
            for n, x, f in (first, second))
        return (found, f"{MODEL}; 20 minutes are fewer than onboarding asks for"
                + ("" if first[0] + second[0] == 0 else
                   "; an episode without a fault"))

    def event(self, name, truth):
        self.onboard("A3", PLANT)
        row = self.rows("fdi-study", "evaluate", "--valve", "A3", "--csv",
                        "--file", self.path(name))[0]
        if not truth:
            count = int(row["episodes"])
            return f"{count} episodes", "false alarm" if count else ""
        names = row["final_set"].replace(",", ", ") or "no name"
        if row["detected"] != "true":
            return f"an alarm that did not last; {names}", "not detected to the end"
        return (f"detected after {float(row['t_dt']):.0f} s: {names}",
                "" if row["final_set"] == truth else f"not {truth} alone")

    def slow_loop(self, name, days, changed):
        path = self.path(name)
        tags = os.path.join(self.folder, os.path.basename(name) + ".toml")
        self.run("fdi-store", "runs", "sniff", path, "-o", tags)
        valve = os.path.basename(name)[:-4]
        self.onboard(valve, f"{name}@0:{days * 86400}", "--map", tags)
        row = self.rows("fdi-study", "evaluate", "--valve", valve, "--map", tags,
                        "--csv", "--assume-normal", "--file",
                        f"{path}@{days * 86400}:")[0]
        names = row["final_set"].replace(",", ", ")
        count = int(row["episodes"])
        found = f"{count} episode{'' if count == 1 else 's'}" + (
            f": {names} ({row['certainty']})" if names else "")
        if changed:
            return found, "" if names else "no name"
        return found, "false alarm" if count else ""

    def audit(self, names, *options):
        return self.rows("fdi-store", "audit", "--csv", "--zone", "UTC", *options,
                         *map(self.path, names))

    def windows(self):
        """Verdicts of labelled windows, and of loops of which they are parts."""
        with open(self.path("loops/labels.csv"), newline="",
                  encoding="utf-8") as file:
            labels = list(csv.DictReader(file))
        said = {}
        for row in self.audit(["loops/" + one["file"] for one in labels]):
            said.setdefault(os.path.basename(row["source"]), set()).add(
                row["verdict"])
        sticky = {"stiction", "no_response"}
        found = {one["file"]: bool(said.get(one["file"], set()) & sticky)
                 for one in labels}
        true = [found[one["file"]] for one in labels if one["stiction"] == "1"]
        false = [found[one["file"]] for one in labels if one["stiction"] == "0"]
        return (f"{sum(true)} of {len(true)} sticky windows called so, "
                f"{sum(false)} of {len(false)} others",
                "22 of the sticky windows are one loop; thresholds were set with "
                "these in view")

    def air_handler(self, name, stuck):
        options = ["--service", "T"]
        tags = os.path.join(self.folder, "ahu.toml")
        with open(tags, "w", encoding="ascii") as file:
            file.write('[time]\ndate = "m/d/y"\n')
        said = sorted(row["verdict"] for row in
                      self.audit([name], *options, "--map", tags))
        text = ", ".join(f"{said.count(one)} {one}" for one in sorted(set(said)))
        wrong = {"stiction", "no_response"} & set(said)
        if stuck:
            return text, "" if "no_response" in said else "not called no_response"
        return text, "false: " + ", ".join(sorted(wrong)) if wrong else ""

    def stiction(self, name):
        said = [row["verdict"] for row in
                self.audit([name], "--op", "OP", "--pv", "PV")]
        return ", ".join(said), "" if "stiction" in said else "not called sticky"


def lines(study):
    """Yields each question with its record and the function that answers it."""
    yield ("40 minutes, fitted on one half, scored on the other; then vice versa",
           LUBLIN, study.halves)
    for day, kind, truth in (("10-30", "healthy", ""), ("10-30", "other_valve", ""),
                             ("11-09", "f16", "f16"), ("11-17", "f16", "f16"),
                             ("11-20", "f18", "f18"), ("11-20", "f19", "f19")):
        name = f"real-faults/a3_2001-{day}_{kind}.csv"
        what = {"healthy": "healthy", "other_valve": "fault of another valve"}
        yield (f"{day}: {what.get(kind, 'event ' + kind)}, models of the 40 minutes",
               LUBLIN, lambda name=name, truth=truth: study.event(name, truth))
    yield ("LIC-106, CV and F: four days fitted, three scored, healthy", PAIRS,
           lambda: study.slow_loop("plant-loops/LIC-106.csv", 4, False))
    yield ("FIC-211, CV and F: the same; a meter or a pressure changed", PAIRS,
           lambda: study.slow_loop("plant-loops/FIC-211.csv", 4, True))
    yield "43 windows of loops, which stick?", LOOPS, study.windows
    for name, stuck in (("0311_cooling_stuck_closed", True),
                        ("20080819_healthy", False), ("20090503_healthy", False)):
        path = f"cases-4/p11_ahu_{name}_TIC1C.csv"
        yield (f"loop {name}", AHU,
               lambda path=path, stuck=stuck: study.air_handler(path, stuck))
    for number in (14, 15):
        yield (f"IDV {number}: does the valve stick?", TEP,
               lambda number=number: study.stiction(f"tep/idv{number}.csv"))


def main():
    if len(sys.argv) != 3:
        sys.exit("real_data.py BIN DIR")
    print("| record | question | came out | what fails |")
    print("|---|---|---|---|")
    for what, origin, answer in lines(Study(*sys.argv[1:])):
        try:
            found, fails = answer()
        except Missing as missing:
            found, fails = f"skipped: {missing} is not there", ""
        print(f"| {origin} | {what} | {found} | {fails} |", flush=True)
    print()
    for origin, text in ORIGINS.items():
        print(f"- {origin}: {text}.")


if __name__ == "__main__":
    main()
