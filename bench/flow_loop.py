#!/usr/bin/env python3
"""Starts of a healthy valve in a flow loop that knows nothing of the simulator.

    bench/flow_loop.py FOLDER [dead_time=1] [lag=1.5] [speed=8] [play=0.15]
    fdi-trainer onboard --valve V --no-coverage --file FOLDER/taught.csv
    fdi-study evaluate --assume-normal --model-set V --file FOLDER/start0.csv ...

FOLDER/taught.csv has two hours with a wandering set point; each of ten
start*.csv is shut from 1200 to 3000 s, opens to the old or another set point for
an hour, and goes on as before: every third together with its pump, two of three
with a medium that has cooled down. Equal-percentage trim of 30:1, a PI
controller; dead time [s], lag [s], speed [%/s] and play [%] of the rod.
bench/by_exception.py takes the loop from here, with faults: f4 (the rod rests),
f18 (`size` of the full opening bypassed) and f19 (reads `size` more).
"""
import math
import os
import random
import sys

SHUT_S = (1200, 3000)
ELSEWHERE = (None, None, 2.2, 3.0, 11.0, None, 13.0, 4.0, 1.6, 9.5)  # [m3/h]
FULL_FLOW, RANGEABILITY, LEAK = 28.0, 30.0, 0.04  # m3/h, -, m3/h
P1, P2 = 6.05, 2.40  # Without flow [bar].


def pressures(flow, pump):
    p1 = P2 + 0.1 + (P1 - P2 - 0.1) * pump - 0.006 * flow * flow
    return p1, P2 + 0.004 * flow * flow


def flow_at(opening, pump, bypass=0.0):
    """The flow at which trim and line have the same pressure drop."""
    share = bypass + (LEAK / FULL_FLOW if opening < 0.3
                      else RANGEABILITY ** (opening / 100 - 1))
    low, high = 0.0, 30.0
    for _ in range(30):
        flow = (low + high) / 2
        p1, p2 = pressures(flow, pump)
        if FULL_FLOW * share * math.sqrt(max(p1 - p2, 0) / 3.4) > flow:
            low = flow
        else:
            high = flow
    return flow


def write(path, seed, seconds, shut=None, elsewhere=None, with_pump=False,
          cools=False, dead_time=1, lag=1.5, speed=8.0, play=0.15,
          fault="", size=1.0, onset=0):
    draw = random.Random(seed)
    commands = [50.0] * (int(dead_time) + 1)
    rod = integral = 50.0
    flow = set_point = 6.0
    pump, warm, noise1, noise2, wander = 1.0, 25.0, 0.0, 0.0, 0.0
    begin, end = shut or (seconds, seconds)
    with open(path, "w", encoding="utf-8") as out:
        out.write("t_s,CV_pct,X_pct,F_m3_h,P1_kPa,P2_kPa,T1_degC")
        out.write(",fault,fault_strength\n" if fault else "\n")
        for t in range(seconds):
            if t % 240 == 0:
                wander = draw.uniform(-2.2, 2.8)
            target = 6.0 + wander
            if elsewhere and end <= t < end + 3600:
                target = elsewhere + 0.2 * wander
            set_point += (target - set_point) * 0.05
            acts = fault if t >= onset else ""
            factor = 1 + size if acts == "f19" else 1.0
            measured = factor * flow + draw.gauss(0, 0.05)
            closed = begin <= t < end
            if closed:
                command = integral = set_point = 0.0
            else:
                error = set_point - measured
                integral = min(100.0, max(0.0, integral + 0.06 * error))
                command = min(100.0, max(
                    0.0, integral + 1.2 * error + draw.gauss(0, 0.5) * 0.6))
            commands = commands[1:] + [command]
            away = commands[0] - rod
            if abs(away) > play and acts != "f4":
                step = (1 - math.exp(-1 / lag)) * (
                    away - math.copysign(play, away))
                rod += max(-speed, min(speed, step))
            rod = min(100.0, max(0.0, rod))
            noise1 = .9 * noise1 + draw.gauss(0, .006)
            noise2 = .9 * noise2 + draw.gauss(0, .004)
            pump += ((0.0 if with_pump and closed else 1.0) - pump) * 0.05
            flow = flow_at(rod, pump, size if acts == "f18" else 0.0)
            p1, p2 = pressures(flow, pump)
            warm += ((20.0 if cools and closed else 25.0) - warm) / 300
            label = f",{acts or 'normal'},{1.0 if acts else 0.0}" if fault else ""
            out.write(f"{t},{100 - command:.3f},"
                      f"{100 - rod - draw.gauss(0, .07):.3f},"
                      f"{max(factor * flow + draw.gauss(0, .03), 0):.3f},"
                      f"{(p1 + noise1) * 100:.2f},{(p2 + noise2) * 100:.2f},"
                      f"{warm + draw.gauss(0, .01):.3f}" + label + "\n")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder = sys.argv[1]
    rod = {key: float(value) for key, value in
           (text.split("=") for text in sys.argv[2:])}
    os.makedirs(folder, exist_ok=True)
    write(f"{folder}/taught.csv", 1, 7200, **rod)
    for i, place in enumerate(ELSEWHERE):
        write(f"{folder}/start{i}.csv", 100 + i, 12600, SHUT_S, place,
              with_pump=i % 3 == 1, cools=i % 3 != 0, **rod)


if __name__ == "__main__":
    main()
