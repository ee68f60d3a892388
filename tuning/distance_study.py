"""Braking distances of every controller on every road: published, of the default set, tuned, ideal.

The default sets, without limits and on the true XBS, reproduce the published distances (the source prints the
five-phase thresholds only). Tuned sets live with a rate limit of 750 bar/s, a brake lag of 5 ms, thresholds and zref of
10 m/s^2 at least, and, where they use XBS, with the estimate of the adaptive observer, but for continuous control of
XBS, which needs the true one.
Source: Aguado-Rojas 2019, Table 4.1.
"""

import dataclasses
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from absjax.manoeuvre import Outcome
from tuning import published
from tuning.batch import build, judge, labels
from tuning.config import TuningConfig
from tuning.files import read_json

NO_LIMITS: dict[str, Any] = {"rate_limit": None, "lag": None}
DEFAULTS = ("five_phase", "two_phase")
"""Controllers whose default sets reproduce published distances."""
NO_MAXIMUM = ((0.8, 12.0, 0.0), (0.35, 40.0, 0.0))
"""Roads whose friction does not fall with slip, like gravel or deep snow: c1, c2 and c3 = 0."""
FURTHER_ROADS: tuple[Any, ...] = ("snow", "ice", *NO_MAXIMUM)
FURTHER_SPEEDS_KMH = (60.0, 120.0)
NAMES = {
    "five_phase": "five-phase",
    "tracking": "five-phase, tracking",
    "two_phase": "two-phase",
    "stiffness": "continuous, true XBS",
    "slip": "wheel slip",
    "bosch": "eight-phase",
}
MARKS = {
    Outcome.STOPPED: "",
    Outcome.LOCKED: " L",
    Outcome.STILL_MOVING: " M",
    Outcome.BUDGET_EXHAUSTED: " B",
    Outcome.DIVERGED: " D",
    Outcome.CONTROL_UNDEFINED: " U",
}
TRUE_XBS = ("stiffness",)
"""Controllers told what no sensor and no observer can tell: they bound what can be reached, and do not compete."""
LEGEND = (
    "L: the wheel locks; M: still moving when the ideal stop would be long over; U: the law is not defined any more; "
    "B: out of switchings; D: diverged"
)


class Distances(NamedTuple):
    """Stops of one parameter set; arrays (rows,)."""

    distance: np.ndarray
    """v0^2 / (2 g mean friction) [m]; infinite where the vehicle was not slowed down"""
    outcome: np.ndarray
    cycles: np.ndarray

    def cell(self, row: int) -> str:
        """Distance and how the stop ended; no distance where the vehicle has hardly been slowed down."""
        outcome = Outcome(int(self.outcome[row]))
        distance = "-" if outcome is Outcome.STILL_MOVING else f"{self.distance[row]:.2f}"
        return distance + MARKS[outcome]


@cache
def default_sets() -> dict[str, TuningConfig]:
    """Five phases: thresholds of Aguado-Rojas 2019, Fig. 6.6; two phases: zref = 20, kp = 500, chi = (-0.1, 1.0)."""
    return {name: TuningConfig(controller=name, **NO_LIMITS) for name in DEFAULTS}


@cache
def tuned_sets() -> dict[str, TuningConfig]:
    """The shipped tuned sets by controller; the parameters are the start of a configuration."""
    with resources.as_file(resources.files("tuning") / "data" / "controllers.json") as path:
        return {name: TuningConfig.from_json(entry) for name, entry in read_json(path).items()}


def distances(config: TuningConfig, sampled: bool, roads: tuple[Any, ...], speeds_kmh: tuple[float, ...]) -> Distances:
    """Stops of the start of a configuration, in the order of `tuning.batch.labels`."""
    config = dataclasses.replace(config, roads=roads, speeds_kmh=speeds_kmh, reference="ideal")
    one = {name: np.array([value]) for name, value in config.initial().items()}
    judged = judge(build(config), one, *(config.sampled_grid() if sampled else ()))
    return Distances(judged.distances[:, 0], judged.outcomes[:, 0], judged.cycles[:, 0])


class Study(NamedTuple):
    """Distances of all sets on some roads and speeds."""

    rows: list[tuple[str, float, float]]
    """road, speed [km/h], ideal distance [m]"""
    default: dict[str, Distances]
    """default sets without limits, located"""
    located: dict[str, Distances]
    """tuned sets"""
    sampled: dict[str, Distances]
    """tuned sets, guards tested at the sampling period"""

    @property
    def order(self) -> list[int]:
        """Rows by speed, then by ideal distance."""
        return sorted(range(len(self.rows)), key=lambda i: (self.rows[i][1], self.rows[i][2]))

    def best(self, row: int) -> str:
        """The controller with the shortest sampled stop, among those that stop and do not need the true XBS."""
        able = {name: d for name, d in self.sampled.items() if name not in TRUE_XBS}
        stops = {name: d.distance[row] for name, d in able.items() if d.outcome[row] == Outcome.STOPPED}
        return min(stops, key=stops.get, default="")


def study(roads: tuple[Any, ...] = published.ROADS, speeds_kmh: tuple[float, ...] = published.SPEEDS_KMH) -> Study:
    """Stops of all sets."""
    config = TuningConfig(roads=roads, speeds_kmh=speeds_kmh)
    return Study(
        [(name, speed, float(d)) for (name, speed, _), d in zip(labels(config), build(config).ideal)],
        {name: distances(config, False, roads, speeds_kmh) for name, config in default_sets().items()},
        *(
            {name: distances(config, sampled, roads, speeds_kmh) for name, config in tuned_sets().items()}
            for sampled in (False, True)
        ),
    )


def reached(done: Study, controller: str) -> list[bool]:
    """Whether tuned distances, located and sampled, are at or below the published ones, by row."""
    return [
        max(done.located[controller].distance[i], done.sampled[controller].distance[i])
        <= _published(done, i, controller)
        for i in range(len(done.rows))
    ]


def _published(done: Study, row: int, controller: str) -> float:
    road, speed, _ = done.rows[row]
    return getattr(published.DISTANCES[road][speed], controller)


def distance_rows(done: Study, controller: str) -> list[dict[str, Any]]:
    """Published, default set, tuned, tuned and sampled, ideal; of the five-phase or the two-phase controller."""
    verdict = reached(done, controller) if done.rows[0][0] in published.DISTANCES else None
    return [
        {
            "km/h": done.rows[i][1],
            "road": done.rows[i][0],
            **({} if verdict is None else {"published": _published(done, i, controller)}),
            "default set": done.default[controller].cell(i),
            "tuned": done.located[controller].cell(i),
            "tuned, sampled": done.sampled[controller].cell(i),
            "ideal": round(done.rows[i][2], 2),
            "cycles": int(done.located[controller].cycles[i]),
            **({} if verdict is None else {"<= published": "yes" if verdict[i] else "no"}),
        }
        for i in done.order
    ]


def best_rows(done: Study) -> list[dict[str, Any]]:
    """Tuned and sampled distances of all controllers, and the best."""
    return [
        {
            "km/h": done.rows[i][1],
            "road": done.rows[i][0],
            **{NAMES[name]: d.cell(i) for name, d in done.sampled.items()},
            "ideal": round(done.rows[i][2], 2),
            "best but for the true XBS": NAMES.get(done.best(i), "none"),
        }
        for i in done.order
    ]
