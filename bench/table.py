#!/usr/bin/env python3
"""Writes the table of bench/table.sh from the parts that it has made.

    bench/table.py DIR PAGE.md

Beside the page it writes the same as CSV, a line for each figure. Counts have
their 95 % interval [Wilson, 1927], rates that of a Poisson count, medians that
of their order statistics. Two methods are compared by McNemar's exact test on
the runs in which they differ.
"""

import csv
import math
import os
import re
import sys

METHODS = {
    "ours": "ours",
    "observers": "observers only",
    "looks": "without looks",
    "floor": "without floor and drift",
    "windows": "without windows",
    "early": "without the early test",
    "linear": "one linear rule instead of fuzzy",
    "position": "position alarm",
    "pca": "PCA, T2 and SPE",
    "forest": "random forest",
    "boosted": "boosted trees",
    "arx-cusum": "ARX with CUSUM",
    "signature-table": "signature table",
}
OURS = ("ours", "observers", "looks", "floor", "windows", "early", "linear")
DETECTS_ONLY = ("position", "pca", "arx-cusum")
DATA = {
    "paper": "The paper's ten scenarios",
    "benchmark": "The benchmark's 44 scenarios",
    "loop": "An independent model in its level loop, 17 faults",
    "own": "Our own level loop, 30 faults",
    "untrained": "Faults that the set of five does not know",
    "loop-hours": "Without fault: the independent model in its loop",
    "own-hours": "Without fault: our own level loop",
    "open-hours": "Without fault: our own simulator under the sine",
}
WORDS = ("sure", "likely", "one of")
Z = 1.959964


class Answer:
    """How a run ended."""

    def __init__(self, row):
        self.run = os.path.basename(row["run_id"])
        self.fault = "" if row["fault"] == "normal" else row["fault"]
        self.detected = row["detected"] == "true"
        self.set = sorted(filter(None, re.split(r"[|, ]+", row["final_set"])))
        self.certainty = row["certainty"]
        self.named = float(row["t_it_first"])
        self.alone = float(row["t_exact"])
        self.episodes = int(row["episodes"])
        self.early = float(row["r_fd"]) > 0
        self.way = int(row["wrong_isolations"])

    def holds(self):
        return self.detected and self.fault in self.set

    def exact(self):
        return self.detected and self.set == [self.fault]

    def wrong(self):
        return self.detected and len(self.set) == 1 and not self.holds()

    def unknown(self):
        return self.detected and not self.set


def wilson(count, total):
    if total == 0:
        return 0.0, 1.0
    share = count / total
    middle = share + Z * Z / (2 * total)
    half = Z * math.sqrt(share * (1 - share) / total + Z * Z / (4 * total ** 2))
    scale = 1 + Z * Z / total
    return max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale)


def poisson(count):
    """The means with which so many or more, so many or fewer, have 2.5 %."""

    def most(mean, number):  # P(N <= number)
        term = total = math.exp(-mean)
        for k in range(1, number + 1):
            term *= mean / k
            total += term
        return total

    def solve(above):
        low, high = 0.0, 10.0 + 4 * count
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if above(middle) else (low, middle)
        return low

    lower = (0.0 if count == 0 else
             solve(lambda mean: 1 - most(mean, count - 1) < 0.025))
    return lower, solve(lambda mean: most(mean, count) > 0.025)


def binomial(number, total):
    """P(N <= number) of so many tosses."""
    return sum(math.comb(total, k) for k in range(number + 1)) / 2 ** total


def mcnemar(ours, theirs):
    """The p value of equal shares, from the runs in which two differ."""
    more = sum(a and not b for a, b in zip(ours, theirs))
    fewer = sum(b and not a for a, b in zip(ours, theirs))
    return min(1.0, 2 * binomial(min(more, fewer), more + fewer))


def median(values):
    """The median, and the order statistics that hold it in 95 %."""
    if not values:
        return None
    values = sorted(values)
    count = len(values)
    rank = 0
    while rank < count // 2 and binomial(rank, count) <= 0.025:
        rank += 1
    rank = max(rank - 1, 0)
    middle = (values[(count - 1) // 2] + values[count // 2]) / 2
    return middle, values[rank], values[count - 1 - rank]


class Table:
    def __init__(self, folder):
        self.folder = folder
        self.lines = []
        self.figures = []
        self.answers = {}
        self.cpu = {}
        self.skipped = {}
        self.hours = {}
        for data in DATA:
            self.read(data)

    def read(self, data):
        folder = os.path.join(self.folder, "parts", data)
        for method in METHODS:
            path = os.path.join(folder, method + ".csv")
            if os.path.exists(path):
                with open(path, newline="", encoding="utf-8") as file:
                    self.answers[data, method] = [
                        Answer(row) for row in csv.DictReader(file)]
            elif os.path.exists(path + ".skipped"):
                with open(path + ".skipped", encoding="utf-8") as file:
                    self.skipped[data, method] = file.read().strip()
        if any(of == data for of, _ in self.answers):
            with open(os.path.join(folder, "rows"), encoding="ascii") as file:
                self.hours[data] = int(file.read()) / 3600

    def note(self, data, method, figure, value, low="", high=""):
        self.figures.append((data, method, figure, value, low, high))

    def count(self, data, method, figure, count, total):
        low, high = wilson(count, total)
        self.note(data, method, figure, count, f"{low:.3f}", f"{high:.3f}")
        return f"{count} ({100 * low:.0f} to {100 * high:.0f} %)"

    def seconds(self, data, method, figure, values):
        found = median([v for v in values if v >= 0])
        if found is None:
            return "-"
        self.note(data, method, figure, *(f"{v:g}" for v in found))
        return "{:.0f} ({:.0f} to {:.0f})".format(*found)

    def seconds_of(self, path):
        with open(path, encoding="ascii") as file:
            return sum(map(float, file.read().split()))

    def heads(self, *heads):
        self.lines += ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]

    def row(self, *cells):
        self.lines.append("| " + " | ".join(cells) + " |")

    def faults(self, data):
        ours = self.answers.get((data, "ours"))
        total = len(next(a for (d, _), a in self.answers.items() if d == data))
        untrained = data == "untrained"
        self.lines += ["", f"## {DATA[data]}: {total} runs", ""]
        self.heads("method", "detected", "alarm before the fault",
                   *([] if untrained else ["holds the fault",
                                           "is the fault"]),
                   "one wrong name", "unknown",
                   *([] if untrained else
                     ["mean size of a set", "s to the name", "s to it alone"]),
                   "p, detected", *([] if untrained else ["p, holds"]))
        for method, name in METHODS.items():
            if (data, method) in self.skipped:
                self.row(name, "skipped: " + self.skipped[data, method])
                continue
            runs = self.answers.get((data, method))
            if runs is None:
                continue
            cells = [self.count(data, method, "detected",
                                sum(r.detected for r in runs), total),
                     str(sum(r.early for r in runs))]
            self.note(data, method, "early", cells[-1])
            names = method not in DETECTS_ONLY
            answered = [r for r in runs if r.detected and r.set]
            if not untrained:
                cells += [self.count(data, method, key, sum(map(test, runs)),
                                     total) if names else "-"
                          for key, test in (("holds", Answer.holds),
                                            ("exact", Answer.exact))]
            cells += [self.count(data, method, key, sum(map(test, runs)), total)
                      if names else "-"
                      for key, test in (("wrong", Answer.wrong),
                                        ("unknown", Answer.unknown))]
            if not untrained:
                size = (sum(len(r.set) for r in answered) / len(answered)
                        if answered else 0)
                self.note(data, method, "size", f"{size:.2f}")
                cells += [f"{size:.2f}" if answered else "-",
                          self.seconds(data, method, "s_named",
                                       [r.named for r in runs]),
                          self.seconds(data, method, "s_alone",
                                       [r.alone for r in runs])]
            tests = [("p_detected", lambda r: r.detected)]
            if not untrained:
                tests.append(("p_holds", Answer.holds))
            for key, test in tests:
                if method == "ours" or not ours or (
                        key == "p_holds" and not names):
                    cells.append("-")
                    continue
                p = mcnemar(list(map(test, ours)), list(map(test, runs)))
                self.note(data, method, key, f"{p:.4f}")
                cells.append(f"{p:.2g}")
            same = method != "ours" and ours and (
                list(map(vars, runs)) == list(map(vars, ours)))
            self.row(name, *(["the same answers"] if same else cells))

    def false_alarms(self):
        hours = [d for d in DATA if d.endswith("-hours") and d in self.hours]
        if not hours:
            return
        self.lines += ["", "## False episodes", "",
                       "Per 1000 valve-hours without a fault; in brackets the "
                       "episodes.", ""]
        self.heads("method", *(f"{DATA[d].split(': ')[1]}, {self.hours[d]:.0f} h"
                               for d in hours), "CPU a sample [us]")
        for method, name in METHODS.items():
            cells = []
            for data in hours:
                runs = self.answers.get((data, method))
                if runs is None:
                    cells.append("-")
                    continue
                count = sum(r.episodes for r in runs)
                per = 1000 / self.hours[data]
                low, high = (per * bound for bound in poisson(count))
                texts = [f"{rate:.0f}" if rate >= 100 else f"{rate:.2g}"
                         for rate in (per * count, low, high)]
                self.note(data, method, "false_per_1000h", *texts)
                cells.append("{} ({} to {})".format(*texts) + f" [{count}]")
            if any(cell != "-" for cell in cells):
                self.row(name, *cells, self.cost(method, hours))

    def cost(self, method, hours):
        """Microseconds of the scoring of healthy hours, reading included."""
        samples = seconds = 0.0
        for data in hours:
            paths = [os.path.join(self.folder, kind) for kind in (
                f"verdicts/{data}-{method}.cpu", f"parts/{data}/{method}.csv.cpu")]
            path = next(filter(os.path.exists, paths), None)
            if path:
                samples += self.hours[data] * 3600
                seconds += self.seconds_of(path)
        if not samples:
            return "-"
        self.note("hours", method, "us_a_sample", f"{1e6 * seconds / samples:.2f}")
        return f"{1e6 * seconds / samples:.1f}"

    def reliability(self):
        self.lines += ["", "## Is an answer as right as it says?", "",
                       "Answers to runs with a taught fault that hold it, by "
                       "the word that stands with them; over the data that the row has "
                       "been scored on.", ""]
        self.heads("method", *WORDS)
        for method in OURS:
            runs = [r for (data, m), a in self.answers.items()
                    if m == method and data != "untrained" for r in a
                    if r.fault and r.detected and r.set]
            if not runs:
                continue
            cells = []
            for word in WORDS:
                said = [r for r in runs if r.certainty == word]
                cells.append(self.count(
                    "all", method, word, sum(map(Answer.holds, said)),
                    len(said)).replace(" ", f" of {len(said)} ", 1)
                    if said else "-")
            self.row(METHODS[method], *cells)

    def page(self, name):
        with open(os.path.join(self.folder, "version"), encoding="utf-8") as file:
            version = file.read().strip()
        cpu = sum(self.seconds_of(os.path.join(path, file)) / 3600
                  for path, _, files in os.walk(self.folder)
                  for file in files if file.endswith(".cpu"))
        missing = [data for data in DATA if data not in self.hours]
        self.lines += [
            "# All methods on all data", "",
            "    bench/table.sh build/release/bin DIR", "",
            f"Written by it with {version}, {cpu:.2f} h of CPU without the "
            "simulation of the runs"
            + (f"; left out: {', '.join(missing)}" if missing else "") + ". "
            "Seeds are those of the script. Limits of all methods are set on the "
            "same healthy hours for one false alarm in 1000 h (paper, untrained: "
            "10 000 h), but those of trees end at the largest value of healthy "
            "blocks; see what they cost in false episodes. Intervals are 95 %; p "
            "is McNemar's against ours, over the runs in which the two differ. "
            "The register of data is [data](data.md), the methods are described "
            "in bench/baselines.py and [evaluation](../evaluation.md)."]
        for data in DATA:
            if data in self.hours and not data.endswith("-hours"):
                self.faults(data)
        self.false_alarms()
        self.reliability()
        with open(name, "w", encoding="utf-8") as file:
            file.write("\n".join(self.lines) + "\n")
        with open(os.path.splitext(name)[0] + ".csv", "w", newline="",
                  encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("data", "method", "figure", "value", "low", "high"))
            writer.writerows(self.figures)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("table.py DIR PAGE.md")
    Table(sys.argv[1]).page(sys.argv[2])
