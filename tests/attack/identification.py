"""Identification on random stops of a simulator of its own: `python -m tests.attack.identification`.

For each kind of log: how often the number of surfaces is right, how often the truth lies in the 95 % intervals of what
is called identifiable, how far its peak frictions are off, and the verdicts.
"""

import argparse
import collections
import dataclasses
import tempfile
import time
import traceback
from pathlib import Path

import numpy as np

from tests.oracles.log_scenarios import Brake, Logging, Scatter, Sensors, on_two_axles, random_stops
from tests.oracles.log_simulator import Record, simulate
from tuning.logs.brake_log import read_log
from tuning.logs.car import Car, car_from
from tuning.logs.tables import LogError
from tuning.road.identify import Identification, identify

RADIUS = 0.3
OFF = Scatter(radius=0.02, brake_efficiency=0.1, inertia=0.1, pressure_zero=2.0)
STATED = {
    "radius": {"value": 0.3, "sd": 0.006},
    "brake_efficiency": {"value": 17.5, "sd": 1.75},
    "inertia": {"value": 1.2, "sd": 0.12},
    "load": 2500.0,
    "pressure_zero": {"value": 0.0, "sd": 2.0},
}
PLACES = {"wheelbase": 2.7, "cg_height": 0.55}
NAMES = ("c1", "c2", "c3", "peak_friction", "peak_slip")


def kinds(logs: int, seed: int) -> dict:
    """Name -> (scenarios, description of the car; None: as the simulator declares it)."""
    plain = random_stops(logs, seed)
    lagging = random_stops(logs, seed + 3, brake=Brake(lag=0.004))
    gps = Logging(sensors=Sensors().gps())
    two = [on_two_axles(stop) for stop in random_stops(logs, seed + 5, logging=gps, surfaces=(1,))]
    return {
        "as shipped": (plain, None),
        "three times the noise": (random_stops(logs, seed + 1, logging=Logging(sensors=Sensors().scaled(3.0))), None),
        "three surfaces": (random_stops(logs, seed + 2, surfaces=(3,), speeds=(28.0, 35.0)), None),
        "pressure before a lag": (lagging, None),
        "car off, as it says": (random_stops(logs, seed + 4, scatter=OFF), STATED),
        "car off, unsaid": (random_stops(logs, seed + 4, scatter=OFF), None),
        "slow and late speed": (random_stops(logs, seed + 6, logging=gps), None),
        "two axles, slow speed": (two, "axle"),
        "two axles that pitch, slow speed": ([dataclasses.replace(stop, pitch_lag=0.06) for stop in two], "axle"),
    }


def car_of(record: Record, description) -> Car:
    """What the car file says."""
    if description == "axle":
        wheel = {name: getattr(record.truth.car, name) for name in ("inertia", "radius", "load", "brake_efficiency")}
        weight = 4280.0 + 3080.0
        return car_from({**wheel, **PLACES, "cg_to_front": 2.7 * 3080.0 / weight, "axle": "front"})
    if description is not None:
        return car_from(description)
    return Car()


def found(record: Record, description, folder: Path) -> Identification | None:
    """What is identified of a record; None, printed, where it is refused or that fails."""
    path = folder / "log.csv"
    record.write_csv(path)
    try:
        car = car_of(record, description)
        return identify(read_log(path, radius=RADIUS, stated=car.stated), car)
    except LogError as refusal:
        print(f"refused: {refusal}")
        return None
    except Exception:
        traceback.print_exc(limit=3)
        return None


def judged(records, results) -> dict:
    """Figures of a kind."""
    right, inside, errors, slips = 0, collections.defaultdict(list), [], []
    for record, result in zip(records, results):
        if result is None or len(result.segments) != len(record.truth.surfaces):
            continue
        right += 1
        for segment, surface in zip(result.segments, record.truth.surfaces):
            truth = {n: getattr(surface, n) for n in NAMES}
            for name in NAMES:
                low, high = segment.ci95[name]
                if segment.identifiable[name]:
                    inside[name].append(low <= truth[name] <= high)
            if segment.identifiable["peak_friction"]:
                errors.append(abs(segment.peak_friction / truth["peak_friction"] - 1))
                slips.append(abs(segment.peak_slip - truth["peak_slip"]))
    verdicts = collections.Counter("none" if r is None else r.verdict for r in results)
    return {
        "surfaces right": right / len(records),
        "inside": {name: float(np.mean(values)) for name, values in inside.items()},
        "peak error": np.quantile(errors, [0.5, 0.95, 1.0]) if errors else None,
        "slip error": np.quantile(slips, [0.5, 0.95, 1.0]) if slips else None,
        "verdicts": dict(verdicts),
    }


def main() -> None:
    """Print a paragraph for each kind."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", default=None)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    for kind, (scenarios, description) in kinds(options.logs, options.seed).items():
        if options.kinds and kind not in options.kinds:
            continue
        records = [record for record in simulate(scenarios) if not record.truth.locks]
        began = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            results = [found(record, description, Path(folder)) for record in records]
        took = (time.perf_counter() - began) / len(records)
        figures = judged(records, results)
        covered = ", ".join(f"{name} {100 * share:.0f}" for name, share in figures["inside"].items())
        print(f"{kind}: {len(records)} logs, {took:.1f} s each, surfaces right {100 * figures['surfaces right']:.0f} %")
        print(f"   truth inside [%]: {covered}; verdicts {figures['verdicts']}")
        print(
            f"   peak off (median, 95 %, worst) {figures['peak error']}, peak slip {figures['slip error']}", flush=True
        )
        if options.verbose:
            for number, (record, result) in enumerate(zip(records, results)):
                show(number, record, result)


def show(number: int, record: Record, result: Identification | None) -> None:
    """A line for a log that is not as it should be."""
    surfaces = record.truth.surfaces
    if result is None:
        return
    wrong = len(result.segments) != len(surfaces)
    off = [] if wrong else [abs(s.peak_friction / t.peak_friction - 1) for s, t in zip(result.segments, surfaces)]
    if wrong or max(off) > 0.01 or result.verdict != "sound":
        true = [f"{t:.2f} s {s.peak_friction:.3f}" for t, s in zip(record.truth.starts, surfaces)]
        seen = [f"{s.start:.2f} s {s.peak_friction:.3f}" for s in result.segments]
        print(
            "     ",
            number,
            true,
            seen,
            result.verdict,
            result.reasons,
            {k: q.value for k, q in result.quantities.items()},
        )


if __name__ == "__main__":
    main()
