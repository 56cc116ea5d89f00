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
    "given-days": "Without fault: the independent model under the sine",
    "open-hours": "Without fault: our own simulator under the sine",
}
LAYERS = ("early", "floor", "looks", "observers", "windows", "linear")
# An answer is to be right in so many per cent of the cases.
WORDS = {"sure": 97, "likely": 85, "one of": 90}
RATES = ("1e-1", "1e-2", "1e-3", "1e-4")  # False alarms an hour.
USUAL_RATE = {"paper": "1e-4", "untrained": "1e-4"}  # Others: 1e-3.
Z = 1.959964


class Answer:
    """How a run ended."""

    def __init__(self, row):
        self.run = os.path.basename(row["run_id"])
        self.fault = "" if row["fault"] == "normal" else row["fault"]
        self.detected = row["detected"] == "true"
        self.set = sorted(filter(None, re.split(r"[|, ]+", row["final_set"])))
        self.certainty = row["certainty"]
        self.found = float(row["t_dt"])
        self.strength = float(row["fs_d"])
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
    # At the ends the bounds are 0 and 1, but for rounding.
    return (0.0 if count == 0 else (middle - half) / scale,
            1.0 if count == total else (middle + half) / scale)


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


def tally(runs):
    """Detected, holds the fault, is the fault, one wrong name, unknown."""
    return [sum(map(test, runs)) for test in (
        lambda run: run.detected, Answer.holds, Answer.exact, Answer.wrong,
        Answer.unknown)]


def and_so_on(names):
    return ", ".join(names) if names else "none"


class Table:
    def __init__(self, folder):
        self.folder = folder
        self.lines = []
        self.figures = []
        self.answers = {}
        self.cpu = {}
        self.skipped = {}
        self.hours = {}
        parts = os.path.join(folder, "parts")
        for data in sorted(os.listdir(parts), key=lambda name: next(
                n for n, of in enumerate(DATA) if self.is_of(name, of))):
            self.read(data)

    @staticmethod
    def is_of(part, data):
        """True of the data themselves, and of other seeds, rates, trainings."""
        return re.fullmatch(re.escape(data) + "(-second|-at.*|-training.*)?",
                            part) is not None

    def trainings(self, data):
        """Answers of ours as scored by sets that were trained again."""
        return [runs for (part, method), runs in self.answers.items()
                if part.startswith(data + "-training") and method == "ours"]

    def at(self, data, rate, method):
        """Answers with limits for another rate of false alarms."""
        usual = USUAL_RATE.get(data, "1e-3")
        part = data if rate == usual else f"{data}-at{rate}"
        return self.answers.get((part, method))

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
        hours = [d for d in DATA if d.endswith(("-hours", "-days"))
                 and d in self.hours]
        if not hours:
            return
        self.lines += ["", "## False episodes", "",
                       "Per 1000 valve-hours without a fault; in brackets the "
                       "episodes. CPU is the mean over the hours of the row, looks "
                       "included.", ""]
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

    def named(self, method, parts):
        """Answers with names, to runs with a fault."""
        return [r for part in parts for r in self.answers.get((part, method), [])
                if r.fault and r.detected and r.set]

    def reliability(self):
        taught = [part for data in DATA if data != "untrained"
                  for part in (data, data + "-second")]
        rows = [(METHODS[method], method, taught) for method in OURS]
        rows.insert(1, ("ours, with faults that nobody taught", "ours",
                        taught + ["untrained", "untrained-second"]))
        asked = ", ".join(f"{word} {share} %" for word, share in WORDS.items())
        self.lines += [
            "", "## Is an answer as right as it says?", "",
            "Answers that hold the fault, by the word that stands with them, over "
            f"all data and seeds that the row has been scored on. Asked for: {asked}.",
            ""]
        self.heads("method", *WORDS, "all", "mean size of a set")
        for name, method, parts in rows:
            runs = self.named(method, parts)
            if not runs:
                continue
            cells = []
            for word in (*WORDS, ""):
                said = [r for r in runs if word in ("", r.certainty)]
                key = ("untaught " if "nobody" in name else "") + (word or "any")
                cells.append(self.count(
                    "all", method, key, sum(map(Answer.holds, said)),
                    len(said)).replace(" ", f" of {len(said)} ", 1)
                    if said else "-")
            size = sum(len(r.set) for r in runs) / len(runs)
            self.row(name, *cells, f"{size:.2f}")
        self.sizes()

    def sizes(self):
        self.lines += ["", "Sets of ours by data; 85 to 97 % that hold the fault are "
                       "asked for, more means that sets are wider than they need be.",
                       ""]
        self.heads("data", "answers", "hold the fault", "mean size", "one name")
        for data in DATA:
            runs = self.named("ours", (data, data + "-second"))
            if data == "untrained" or not runs:
                continue
            held = self.count(data, "ours", "coverage",
                              sum(map(Answer.holds, runs)), len(runs))
            size = sum(len(r.set) for r in runs) / len(runs)
            self.row(DATA[data], str(len(runs)), held, f"{size:.2f}",
                     str(sum(len(r.set) == 1 for r in runs)))

    def layers(self):
        """Counts that change if a layer is left out."""
        self.lines += ["", "## What does a layer buy?", "",
                       "What changes without it: runs that are detected / whose "
                       "answer holds the fault / is the fault / is one wrong name, and "
                       "the median seconds to the name; `=`: no run has another "
                       "answer; empty: not scored. Observers only: without looks, floor "
                       "and drift.", ""]
        faults = [d for d in DATA if (d, "ours") in self.answers
                  and not d.endswith(("-hours", "-days"))]
        self.heads("left out", *(DATA[d] for d in faults))
        nothing = []
        for layer in LAYERS:
            cells, changes = [], False
            for data in faults:
                ours = self.answers[data, "ours"]
                runs = self.answers.get((data, layer))
                if runs is None:
                    cells.append("")
                elif list(map(vars, runs)) == list(map(vars, ours)):
                    cells.append("=")
                else:
                    pair = tally(runs)[:4], tally(ours)[:4]
                    difference = [a - b for a, b in zip(*pair)]
                    times = [median([r.named for r in some if r.named >= 0])
                             for some in (runs, ours)]
                    later = (times[0][0] - times[1][0]
                             if data != "untrained" and all(times) else 0)
                    changes |= any(difference) or later != 0
                    cells.append("/".join(f"{n:+d}" if n else "0"
                                          for n in difference)
                                 + (f", {later:+.0f} s" if later else ""))
            if any(cells):
                self.row(METHODS[layer], *cells)
                if not changes:
                    nothing.append(METHODS[layer])
        self.lines += ["", "Changes no count and no median of what it was scored on: "
                       f"{and_so_on(nothing)}."]
        self.simpler(faults)

    def simpler(self, faults):
        """Names methods that detect as many as ours."""
        self.lines += ["", "Where a simpler method detects as much:", ""]
        for data in faults:
            ours = self.answers[data, "ours"]
            more, alike = [], []
            for method in METHODS:
                runs = self.answers.get((data, method))
                if method in OURS or runs is None:
                    continue
                text = f"{METHODS[method]} {tally(runs)[0]}"
                p = mcnemar([r.detected for r in ours],
                            [r.detected for r in runs])
                if tally(runs)[0] >= tally(ours)[0]:
                    more.append(text)
                elif p > 0.05:
                    alike.append(text)
            self.lines.append(
                f"- {DATA[data]}: ours {tally(ours)[0]}; as many or more: "
                f"{and_so_on(more)}; fewer, but not proven (p > .05): "
                f"{and_so_on(alike)}.")

    def second(self):
        """Counts by other seeds beside the intervals of the first."""
        datas = [d for d in DATA if any(part == d + "-second"
                                        for part, _ in self.answers)]
        if not datas:
            return
        rows, outside, total = [], [], 0
        for method, name in METHODS.items():
            cells = []
            for data in datas:
                pair = [self.answers.get((part, method))
                        for part in (data, data + "-second")]
                if None in pair:
                    cells.append("")
                    continue
                inside, text = self.compare(data, method, *pair)
                total += len(inside)
                outside += [f"{name}, {DATA[data]}: {what}"
                            for what, is_inside in inside if not is_inside]
                cells.append(text)
            if any(cells):
                rows.append((name, *cells))
        self.lines += [
            "", "## Do other seeds say the same?", "",
            "Detected / holds the fault / is the fault / one wrong name, by the first "
            "seeds and by others (+40000000); of hours without fault the episodes. "
            f"{total - len(outside)} of {total} second counts are inside the 95 % "
            "interval of the first; as both are drawn, up to one in six may be "
            "outside by chance. Outside: "
            + ("; ".join(outside) or "none") + ".", ""]
        self.heads("method", *(DATA[d] for d in datas))
        for row in rows:
            self.row(*row)

    def compare(self, data, method, first, second):
        """Says of each count if it stays inside, and gives both as text."""
        if data.endswith("-hours"):
            counts = [sum(r.episodes for r in runs) for runs in (first, second)]
            low, high = poisson(counts[0])
            scale = self.hours[data + "-second"] / self.hours[data]
            self.note(data, method, "false_second", counts[1])
            return ([("episodes", low * scale <= counts[1] <= high * scale)],
                    "{}, {}".format(*counts))
        names = ("detected", "holds", "exact", "wrong")
        if method in DETECTS_ONLY:
            names = names[:1]
        inside = []
        pair = [tally(runs)[:len(names)] for runs in (first, second)]
        for what, one, other in zip(names, *pair):
            low, high = wilson(one, len(first))
            self.note(data, method, what + "_second", other)
            inside.append((f"{what} {one}, then {other}",
                           low <= other / len(second) <= high))
        return inside, ", ".join("/".join(map(str, one)) for one in pair)

    def curves(self):
        if not any("-at" in part for part, _ in self.answers):
            return
        self.lines += [
            "", "## Operating curves", "",
            "Limits of each method set for 100, 10, 1 and 0.1 false alarms in 1000 h; "
            "what they cost in false episodes a year of one valve under the sine, and "
            "what they find of the benchmark's 44. For faults that were not "
            "taught: the paper's ten exactly named, and of 44 others those called "
            "unknown and those that get one wrong name.", ""]
        self.heads("method", "set for, in 1000 h", "false episodes a valve-year",
                   "detected", "holds the fault", "is the fault",
                   "median s to the lasting alarm", "known: named",
                   "unknown: called so", "one wrong name")
        for method, name in METHODS.items():
            for rate in RATES:
                cells = self.operating_point(method, rate)
                if any(cells):
                    self.row(name, f"{1000 * float(rate):g}", *cells)
        self.least()

    def operating_point(self, method, rate):
        cells = [""] * 8
        if not any("-at" in p for p, m in self.answers if m == method):
            return cells
        names = method not in DETECTS_ONLY
        hours = self.at("open-hours", rate, method)
        if hours:
            count = sum(r.episodes for r in hours)
            year = 8760 / self.hours["open-hours"]
            bounds = [year * bound for bound in poisson(count)]
            cells[0] = "{:.0f} ({:.0f} to {:.0f})".format(year * count, *bounds)
            self.note("open-hours", method, f"false_per_year_at_{rate}",
                      f"{year * count:.1f}", *(f"{b:.1f}" for b in bounds))
        runs = self.at("benchmark", rate, method)
        if runs:
            counts = tally(runs)
            self.note("benchmark", method, f"detected_at_{rate}", counts[0])
            cells[1:4] = [str(counts[0]), *(str(n) if names else "-"
                                            for n in counts[1:3])]
            found = median([r.found for r in runs if r.found >= 0])
            cells[4] = f"{found[0]:.0f}" if found else "-"
        known, other = (self.at(data, rate, method)
                        for data in ("paper", "untrained"))
        if known and other and names:
            cells[5] = str(tally(known)[2])
            cells[6], cells[7] = (str(n) for n in reversed(tally(other)[3:]))
        return cells

    def least(self):
        """The strength at which ramps are detected, by rate."""
        methods = [m for m in METHODS
                   if ("benchmark-at1e-2", m) in self.answers]
        ramps = [r.run for r in self.answers.get(("benchmark", "ours"), [])
                 if "+" in r.run]
        if not ramps or not methods:
            return
        self.lines += ["", "The least strength that was detected while a fault grew, "
                       "with limits for 100 / 10 / 1 in 1000 h; -: not at any "
                       "strength. Behind the fault: seconds to full strength.", ""]
        self.heads("ramp", *(METHODS[m] for m in methods))
        for run in ramps:
            cells = []
            for method in methods:
                found = [next(r.strength for r in self.at("benchmark", rate, method)
                              if r.run == run) for rate in RATES[:3]]
                cells.append(" / ".join(f"{s:.2g}" if s >= 0 else "-"
                                        for s in found))
            self.row(run.removesuffix(".csv").replace("+", ", "), *cells)

    def retrained(self):
        rows = [(data, self.trainings(data)) for data in DATA]
        rows = [(data, runs) for data, runs in rows if runs]
        if not rows:
            return
        self.lines += ["", "## Does it depend on how the training began?", "",
                       "Sets trained again from other random starts of the clustering: "
                       "least to most of so many trainings, in brackets the set of the "
                       "table.", ""]
        self.heads("data", "trainings", "detected", "holds the fault",
                   "is the fault", "one wrong name", "unknown")
        for data, runs in rows:
            cells = []
            for counts, usual in zip(zip(*map(tally, runs)),
                                     tally(self.answers[data, "ours"])):
                cells.append(f"{min(counts)} to {max(counts)} ({usual})")
            self.note(data, "ours", "trainings", len(runs))
            self.row(DATA[data], str(len(runs)), *cells)

    def real(self):
        path = os.path.join(self.folder, "real")
        if not os.path.exists(path):
            return
        self.lines += ["", "## Records of others", "",
                       "By bench/real_data.py. What is not there is skipped by "
                       "name.", ""]
        with open(path, encoding="utf-8") as file:
            self.lines += file.read().splitlines()

    def short(self):
        """The short table, from which README takes its lines."""
        self.lines += ["", "## In short", ""]
        self.heads("question", "answer")

        def ours(data):
            runs = self.answers.get((data, "ours"))
            return runs and (len(runs), *tally(runs))

        if paper := ours("paper"):
            total, _, _, exact, _, _ = paper
            self.row("the method of Mendonça, Sousa and Sá da Costa (2009), "
                     "running live", f"right fault in {exact} of {total} scenarios")
        if benchmark := ours("benchmark"):
            total, found, held, exact, wrong, _ = benchmark
            self.row(f"DAMADICS benchmark, {total} scenarios",
                     f"{found} detected, {held} with the fault in the answer, "
                     f"{exact} exactly; wrong names: {wrong}")
        if loop := ours("loop"):
            total, found, held, _, wrong, _ = loop
            self.row("models from healthy data alone, on an independent simulator",
                     f"{found} of {total} faults detected, {held} with the fault in "
                     f"the answer; wrong names: {wrong}")
            if runs := self.answers.get(("loop", "observers")):
                found, held, _, wrong, _ = tally(runs)
                self.row("the same, without floor and second look",
                         f"{found} detected, {held} with the fault in the answer; "
                         f"wrong names: {wrong}")
        if untrained := ours("untrained"):
            _, found, _, _, wrong, unknown = untrained
            self.row("faults that nobody taught", f"{found} detected, {unknown} called "
                     f"unknown; wrong names: {wrong}")
        taught = [part for data in DATA if data != "untrained"
                  for part in (data, data + "-second")]
        said = [r for r in self.named("ours", taught) if r.certainty == "sure"]
        if said:
            self.row('answers called "sure" that are right',
                     f"{sum(map(Answer.holds, said))} of {len(said)} on taught "
                     "faults")
        hours = [d for d in DATA for d in (d, d + "-second")
                 if self.is_of(d.removesuffix("-second"), "own-hours")
                 or self.is_of(d.removesuffix("-second"), "open-hours")]
        hours = [d for d in hours if (d, "ours") in self.answers]
        if hours:
            count = sum(r.episodes for d in hours for r in self.answers[d, "ours"])
            self.row("false alarms of simulated valves", f"{count} in "
                     f"{sum(self.hours[d] for d in hours):.0f} h")

    def page(self, name):
        with open(os.path.join(self.folder, "version"), encoding="utf-8") as file:
            version = file.read().strip()
        cpu = sum(self.seconds_of(os.path.join(path, file)) / 3600
                  for path, _, files in os.walk(self.folder)
                  for file in files if file.endswith(".cpu"))
        missing = [data for data in DATA if data not in self.hours]
        missing += [what for what, mark in (("second seeds", "-second"),
                                            ("curves", "-at"),
                                            ("retrainings", "-training"))
                    if not any(mark in part for part, _ in self.answers)]
        self.lines += [
            "# All methods on all data", "",
            "    bench/table.sh build/release/bin DIR", "",
            f"Written by it with {version}, {cpu:.2f} h of CPU without the "
            "simulation of the runs"
            + (f"; left out: {', '.join(missing)}" if missing else "") + ". "
            "The full command has ten healthy days of each kind, ten trainings and all "
            "methods on all data; what this run left out is empty or has no row. "
            "Seeds are those of the script. Limits of all methods are set on the "
            "same healthy hours for one false alarm in 1000 h (paper, untrained: "
            "10 000 h), but those of trees end at the largest value of healthy "
            "blocks; see what they cost in false episodes. Intervals are 95 %; p "
            "is McNemar's against ours, over the runs in which the two differ. "
            "The register of data is [data](data.md), the methods are described "
            "in bench/baselines.py and [evaluation](../evaluation.md)."]
        self.short()
        for data in DATA:
            if data in self.hours and not data.endswith(("-hours", "-days")):
                self.faults(data)
        self.false_alarms()
        self.layers()
        self.reliability()
        self.second()
        self.curves()
        self.retrained()
        self.real()
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
