#!/usr/bin/python3
"""Detectors that a reader knows, to stand beside ours in bench/table.sh.

    bench/baselines.py fit METHOD --per-hour RATE -o MODEL RUN.csv...
    bench/baselines.py score MODEL -o DIR RUN.csv...

`fit` learns from runs with their truth. Their samples without a fault are the
healthy hours by which the limits are set; without the first minute of a run.
`score` writes a file of verdicts for each run, which `fdi-study verdicts`
scores by the same indices as ours.

position  |X - CV - median|, held for ten seconds: the alarm of a positioner.
pca       T2 and SPE of the six signals at k, k-1 and k-2, with the components
          that have 95 % of the variance.
forest    200 trees on windows of a minute (features() names what they see).
boosted   Gradient boosted trees on the same.

Each has the settings of ours where there is a counterpart: two samples to an
alarm, 60 without one to its end. A limit is where the statistic goes RATE times
an hour: an exponential tail of its maxima of a minute above their 80 % quantile.
Trees are judged on healthy blocks of ten minutes that they were not grown on,
and their limit is at most what these show: probabilities end at 0 and 1.
Their answer is the smallest set of faults with 90 % of the probability of all;
more than four are no answer.

Exit code 77: a package is missing, or the runs do not have what the method
learns from; the reason is on stdout.
"""

import argparse
import csv
import os
import pickle
import sys

try:
    import numpy as np
except ImportError:
    print("python3-numpy is missing")
    sys.exit(77)

SIGNALS = ("CV", "P1", "P2", "T1", "X", "F")
START = 60          # Samples of a run in which nothing is judged.
ALARM = 2           # n_d
CLEAR = 60          # t_c
DELAY = 10          # Samples of the position alarm.
WINDOW = 60         # Samples that the trees see,
STRIDE = 5          # each so many.
LEAST = 0.1         # Weaker faults are learnt neither as a fault nor as none.
TREES = 200
VARIANCE = 0.95
MASS = 0.9
MOST = 4


class Run:
    """The signals of a file, a row a sample, and its truth."""

    def __init__(self, path, with_truth):
        with open(path, newline="", encoding="ascii") as file:
            heads = next(csv.reader(file))
        names = [head.split("_")[0] for head in heads]
        self.name = os.path.splitext(os.path.basename(path))[0]
        columns = [0] + [names.index(signal) for signal in SIGNALS]
        table = np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns)
        self.time = table[:, 0]
        self.values = table[:, 1:]
        if not with_truth:
            return
        self.strength = np.zeros(len(table))
        self.fault = np.full(len(table), "f0")
        if "fault_strength" in heads:
            self.strength = np.abs(np.loadtxt(
                path, delimiter=",", skiprows=1,
                usecols=heads.index("fault_strength")))
            fault = np.loadtxt(path, delimiter=",", skiprows=1, dtype=str,
                               usecols=names.index("fault"))
            fault = np.where(np.char.isdigit(fault),
                             np.char.add("f", fault), fault)
            self.fault = np.where(self.strength > 0, fault, "f0")

    def healthy(self):
        return self.strength == 0


def signal(values, name):
    return values[:, SIGNALS.index(name)]


def limit(series, per_hour):
    """The value that the statistics of healthy stretches exceed so often."""
    maxima = np.concatenate([
        one[:len(one) // 60 * 60].reshape(-1, 60).max(axis=1)
        for one in series if len(one) >= 60])
    start = np.quantile(maxima, 0.8)
    scale = (maxima[maxima > start] - start).mean()
    return start + scale * np.log(0.2 * 60 / per_hour)


def held(values, samples):
    """The least of the last `samples` values."""
    least = values.copy()
    for lag in range(1, samples):
        least[lag:] = np.minimum(least[lag:], values[:-lag])
        least[lag - 1] = -np.inf
    return least


class Position:
    """The alarm of a positioner."""

    def learn(self, runs):
        """Returns the statistics of healthy data, if runs do not show them."""
        self.median = np.median(np.concatenate([
            (signal(run.values, "X") - signal(run.values, "CV"))[run.healthy()]
            for run in runs]))

    def statistics(self, run):
        error = signal(run.values, "X") - signal(run.values, "CV")
        return held(np.abs(error - self.median), DELAY)[:, None]


class Pca:
    """T2 and SPE."""

    @staticmethod
    def rows(run):
        values = run.values
        rows = np.hstack([values, np.roll(values, 1, axis=0),
                          np.roll(values, 2, axis=0)])
        rows[:2] = rows[2]
        return rows

    def learn(self, runs):
        rows = np.vstack([self.rows(run)[START:][run.healthy()[START:]]
                          for run in runs])
        self.mean = rows.mean(axis=0)
        self.scale = np.maximum(rows.std(axis=0), 1e-9)
        variances, axes = np.linalg.eigh(np.cov((rows - self.mean) / self.scale,
                                                rowvar=False))
        variances, axes = variances[::-1], axes[:, ::-1]
        share = np.cumsum(variances) / variances.sum()
        count = int(np.searchsorted(share, VARIANCE)) + 1
        self.axes = axes[:, :count]
        self.variances = variances[:count]

    def statistics(self, run):
        rows = (self.rows(run) - self.mean) / self.scale
        scores = rows @ self.axes
        left = rows - scores @ self.axes.T
        return np.column_stack([(scores ** 2 / self.variances).sum(axis=1),
                                (left ** 2).sum(axis=1)])


def features(values):
    """A row for each window of a minute, which ends at the samples ends(n)."""

    def means(columns):
        sums = np.vstack([np.zeros(columns.shape[1]),
                          np.cumsum(columns, axis=0)])
        last = ends(len(columns)) + 1
        return (sums[last] - sums[last - WINDOW]) / WINDOW

    error = (signal(values, "X") - signal(values, "CV"))[:, None]
    steps = np.abs(np.diff(values, axis=0, prepend=values[:1]))
    drop = np.maximum(signal(values, "P1") - signal(values, "P2"), 1.0)
    flow = (signal(values, "F") / np.sqrt(drop))[:, None]
    centre = values.mean(axis=0)  # The squares of large numbers lose digits.
    mean = means(values)
    return np.hstack([
        mean,                                                # of each signal
        np.sqrt(np.maximum(means((values - centre) ** 2)
                           - (mean - centre) ** 2, 0)),      # its deviation
        means(steps),                                        # its travel
        means(error), means(np.abs(error)), means(error ** 2),  # X - CV
        means(flow),                                         # F / sqrt(P1 - P2)
        values[ends(len(values))],                           # the last reading
    ])


def ends(samples):
    return np.arange(WINDOW - 1, samples, STRIDE)


class Trees:
    """A classifier of windows; its statistic is the odds of a fault."""

    def __init__(self, make, least):
        self.make = make
        self.least = least  # Probabilities are no closer to 0 and 1.

    def learn(self, runs):
        rows, names, blocks, spans = [], [], [], []
        for number, run in enumerate(runs):
            last = ends(len(run.time))
            fault = run.fault[last]
            first = last - WINDOW + 1
            alike = (run.fault[first] == fault) & (first >= START)
            alike &= (fault == "f0") | (run.strength[first] >= LEAST)
            rows.append(features(run.values)[alike])
            names.append(fault[alike])
            blocks.append(number * 1000 + first[alike] // 600)
        rows, names = np.vstack(rows), np.concatenate(names)
        blocks = np.concatenate(blocks)
        if len(set(names)) < 2:
            print("its training data have no faults to learn from")
            sys.exit(77)
        self.model = self.make().fit(rows, names)
        # Its answers on healthy blocks that it was not grown on.
        healthy = names == "f0"
        odds = np.zeros(len(names))
        folds = np.unique(blocks, return_inverse=True)[1] % 5
        for fold in range(5):
            away = folds == fold
            model = self.make().fit(rows[~away], names[~away])
            judged = away & healthy
            if judged.any():
                odds[judged] = self.odds(model.predict_proba(rows[judged]),
                                         list(model.classes_).index("f0"))
        return [[np.repeat(odds[healthy & (blocks == block)], STRIDE)
                 for block in np.unique(blocks[healthy])]]

    def odds(self, probabilities, normal):
        normal = probabilities[:, normal]
        return np.log((1 - normal + self.least) / (normal + self.least))

    def statistics(self, run):
        probabilities = self.model.predict_proba(features(run.values))
        classes = list(self.model.classes_)
        normal = classes.index("f0")
        odds = self.odds(probabilities, normal)
        self.names = [set_of(np.delete(one, normal),
                             classes[:normal] + classes[normal + 1:])
                      for one in probabilities]
        # A window holds until the next one.
        at = np.maximum(np.arange(len(run.time)) - (WINDOW - 1), 0) // STRIDE
        self.at = np.minimum(at, len(odds) - 1)
        return odds[self.at][:, None]


def set_of(probabilities, classes):
    """The smallest set with MASS of the probability; empty: more than MOST."""
    order = np.argsort(probabilities)[::-1]
    total = probabilities.sum()
    if total <= 0:
        return ""
    count = int(np.searchsorted(np.cumsum(probabilities[order]) / total,
                                MASS)) + 1
    return ("" if count > MOST else
            "|".join(sorted(classes[i] for i in order[:count])))


def forest():
    from sklearn.ensemble import RandomForestClassifier
    return RandomForestClassifier(TREES, random_state=1, n_jobs=1)


def boosted():
    from sklearn.ensemble import HistGradientBoostingClassifier
    return HistGradientBoostingClassifier(max_iter=50, random_state=1)


METHODS = {"position": Position, "pca": Pca,
           "forest": lambda: Trees(forest, 0.5 / TREES),
           "boosted": lambda: Trees(boosted, 1e-9)}


def healthy_statistics(model, runs):
    """By statistic, a series for each healthy start of a run."""
    series = []
    for run in runs:
        healthy = run.healthy()
        end = len(healthy) if healthy.all() else int(np.argmin(healthy))
        series.append(list(model.statistics(run)[START:end].T))
    return [list(one) for one in zip(*series)]


def fit(options):
    runs = [Run(path, True) for path in options.runs]
    model = METHODS[options.method]()
    try:
        series = model.learn(runs) or healthy_statistics(model, runs)
    except ImportError:
        print("python3-sklearn is missing")
        sys.exit(77)
    model.limits = np.array([limit(one, options.per_hour / len(series))
                             for one in series])
    if isinstance(model, Trees):
        # A limit that their probabilities cannot reach is none.
        model.limits = np.minimum(model.limits, max(map(max, series[0])))
    hours = sum(len(one) for one in series[0]) / 3600
    print(f"{options.method}: limits {model.limits} from {hours:.2f} h")
    with open(options.output, "wb") as file:
        pickle.dump(model, file)


def verdicts(above, names):
    """Holds an alarm until CLEAR samples were below the limits, and its name."""
    detected = np.zeros(len(above), dtype=int)
    said = [""] * len(above)
    streak, quiet, alarm, name = 0, 0, False, ""
    for k, over in enumerate(above):
        streak = streak + 1 if over else 0
        quiet = 0 if over else quiet + 1
        if streak >= ALARM:
            alarm = True
            name = names(k) or name
        elif alarm and quiet >= CLEAR:
            alarm, name = False, ""
        detected[k] = alarm
        said[k] = name
    return detected, said


def score(options):
    with open(options.method, "rb") as file:
        model = pickle.load(file)
    os.makedirs(options.output, exist_ok=True)
    for path in options.runs:
        run = Run(path, False)
        above = (model.statistics(run) > model.limits).any(axis=1)
        above[:START] = False
        names = ((lambda k: model.names[model.at[k]])
                 if hasattr(model, "names") else lambda k: "")
        detected, said = verdicts(above.tolist(), names)
        with open(os.path.join(options.output, run.name + ".csv"), "w",
                  encoding="ascii") as file:
            file.write("t_s,detected,faults\n")
            file.writelines(f"{t:.9g},{d},{s}\n"
                            for t, d, s in zip(run.time, detected, said))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("verb", choices=("fit", "score"))
    parser.add_argument("method", help="of fit: " + ", ".join(METHODS))
    parser.add_argument("--per-hour", type=float, default=1e-3)
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("runs", nargs="+")
    options = parser.parse_args()
    (fit if options.verb == "fit" else score)(options)


if __name__ == "__main__":
    main()
