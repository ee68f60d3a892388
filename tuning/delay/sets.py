"""Thresholds and gains of five phases through a delay of 10 ms, without and with prediction, by evolution.

They are judged as a car has them, in a control unit at 1 ms, on dry and wet asphalt from 60 and 120 km/h; the shipped
sets were made so. By gradient they are tuned with `tune-abs`, located.
"""

import numpy as np

from absjax.controllers.predictive_tracking import PredictiveTracking
from tuning.core.box import Box, box_of
from tuning.core.components import initial
from tuning.core.evolution import Evolution
from tuning.delay import brake

NAMES = ("eps0", "eps1", "eps2", "eps3", "eps4", "eps5", "gain", "beta1")
ROWS = (("dry_asphalt", 60.0), ("dry_asphalt", 120.0), ("wet_asphalt", 60.0), ("wet_asphalt", 120.0))
REFERENCE = np.array([12.9, 52.0, 20.0, 75.0])
"""Distances that the rows are weighed by, m."""
LEAST, ROUNDS, POINTS, WIDEST = 8.0, 14, 16, 0.15
"""Smallest threshold, m/s^2; generations, points of each, and standard deviation of the first."""
LONGEST_LOCK, LOCK_CHARGE, STICKING_CHARGE = 0.05, 2.0, 0.3
STARTS = (
    {},
    {"gain": 78.5, "eps0": 50.0},
    {"eps1": 22.0, "eps2": 25.0, "eps3": 13.0, "eps4": 11.0, "eps5": 15.0, "gain": 30.0},
)


def costs(points: np.ndarray, box: Box, trust: float) -> np.ndarray:
    """Mean distance over the reference of points (sets, parameters), long locks and sticking charged."""
    values = box.arrays(points)
    cases = [
        brake.Case(road, speed, trust=trust, parameters={n: float(values[n][k]) for n in NAMES})
        for k in range(len(points))
        for road, speed in ROWS
    ]
    found = brake.stops(cases, sampled=True)
    locked = np.maximum(found.lock - LONGEST_LOCK, 0.0)
    charges = LOCK_CHARGE * locked + STICKING_CHARGE * ~found.cycling
    return (found.distance.reshape(-1, len(ROWS)) / REFERENCE + charges.reshape(-1, len(ROWS))).mean(axis=1)


def tuned_set(trust: float, rounds: int = ROUNDS) -> dict[str, float]:
    """The set of a law, from the starts above."""
    start = initial(PredictiveTracking, {"gain": 40.0, "eps0": 30.0})
    box = box_of(PredictiveTracking, start, tune=NAMES, limits={"eps0": (15.0, 80.0)}, floor=LEAST)
    points = box.valid(np.stack([box.point({**start, **own}) for own in STARTS]))
    evolution = Evolution(box, points, costs(points, box, trust))
    for seed in range(rounds):
        evolution.run(lambda x: costs(x, box, trust), rounds=1, count=POINTS, widest=WIDEST, seed=seed)
    return {name: round(float(value), 4) for name, value in box.values(evolution.point).items()}
