#!/usr/bin/env python3
"""A flow loop as it is told by exception, compressed, or held.

    bench/by_exception.py FOLDER KIND DEAD_BAND MIN_S [seed=1] [KEY=VALUE...]

The loop is that of bench/flow_loop.py, which knows nothing of the simulator.
FOLDER gets taught.csv (2.5 h), day.csv (24 h), and leak.csv, meter.csv and
stuck.csv: two hours with a bypass of 5 %, a flow reading of 1.25 times the flow
and a rod that rests, each from 1800 s on. A reading is told when it is further
than DEAD_BAND [% of span] from the last one that was, MIN_S or more after it,
or after ten minutes. KIND: `exception` has the readings as they came, blank
cells between; `door` what a swinging door of twice the dead band leaves of
them; `held` a row a second with the last reading of each signal. Other keys are
those of flow_loop.py. Prints seconds a reading.
"""
import os
import sys

import flow_loop

SPANS = {"CV_pct": 100.0, "X_pct": 100.0, "F_m3_h": 28.0}
LONGEST_S = 600
FAULTS = {"leak": ("f18", 0.05), "meter": ("f19", 0.25), "stuck": ("f4", 1.0)}
ONSET_S = 1800


def by_exception(values, band, least_s, with_previous):
    """[(t, value)] of what is told. A door needs the value before a jump."""
    told = [(0, values[0])]
    for t, value in enumerate(values):
        since = t - told[-1][0]
        if (abs(value - told[-1][1]) > band and since >= least_s) or (
                since >= LONGEST_S):
            if with_previous and since > 1:
                told.append((t - 1, values[t - 1]))
            told.append((t, value))
    return told


def swinging_door(told, door):
    """Keeps a reading where no line passes all since the last one kept."""
    kept, last = [told[0]], None
    high, low = float("inf"), -float("inf")
    for t, value in told[1:]:
        begin, at = kept[-1]
        high = min(high, (value + door - at) / (t - begin))
        low = max(low, (value - door - at) / (t - begin))
        if last and (low > high or t - begin > LONGEST_S):
            kept.append(last)
            high = (value + door - last[1]) / (t - last[0])
            low = (value - door - last[1]) / (t - last[0])
        last = (t, value)
    return kept + [last] if last else kept


def rewrite(path, kind, band_pct, least_s):
    with open(path, encoding="utf-8") as table:
        head, *rows = [line.strip().split(",") for line in table]
    keep = [i for i, name in enumerate(head) if name in SPANS]
    labels = [i for i, name in enumerate(head) if name.startswith("fault")]
    cells, count = {}, 0
    for i in keep:
        band = band_pct / 100 * SPANS[head[i]]
        told = by_exception([float(row[i]) for row in rows], band, least_s,
                            kind == "door")
        cells[i] = dict(swinging_door(told, 2 * band) if kind == "door" else told)
        count += len(cells[i])
    last = {}
    with open(path, "w", encoding="utf-8") as out:
        out.write(",".join(["t_s"] + [head[i] for i in keep + labels]) + "\n")
        for t, row in enumerate(rows):
            new = {i: f"{cells[i][t]:.3f}" for i in keep if t in cells[i]}
            last.update(new)
            if kind == "held" or new:
                shown = last if kind == "held" else new
                out.write(",".join([str(t)] + [shown.get(i, "") for i in keep]
                                   + [row[i] for i in labels]) + "\n")
    return len(keep) * len(rows) / count


def main():
    if len(sys.argv) < 5:
        sys.exit(__doc__)
    folder, kind, band, least = sys.argv[1:5]
    keys = {key: float(value) for key, value in
            (text.split("=") for text in sys.argv[5:])}
    seed = int(keys.pop("seed", 1))
    os.makedirs(folder, exist_ok=True)
    flow_loop.write(f"{folder}/taught.csv", seed, 9000, **keys)
    flow_loop.write(f"{folder}/day.csv", seed + 1, 86400, **keys)
    for i, (name, (fault, size)) in enumerate(FAULTS.items()):
        flow_loop.write(f"{folder}/{name}.csv", seed + 2 + i, 7200, fault=fault,
                        size=size, onset=ONSET_S, **keys)
    for name in ["taught", "day", *FAULTS]:
        each = rewrite(f"{folder}/{name}.csv", kind, float(band), float(least))
        if name == "day":
            print(f"{each:.1f} s a reading")


main()
