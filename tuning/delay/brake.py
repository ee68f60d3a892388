"""Five phases with acceleration tracking, and two phases, on a brake with a delay: many stops as lanes of one program.

Every stop has its own road, speed, delay, controller and errors of what the controller knows. Gains not given are the
published ones for the delay the controller knows: alpha = pi / (4 h), beta1 = beta2 = pi / (10 h).
Source: Hoang 2014 (thesis), section 7.3.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from absjax.controllers.predictive_tracking import PredictiveTracking
from absjax.controllers.predictive_two_phase import PredictiveTwoPhase
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.lanes import stacked
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.delayed_loop import DelayedLoop
from absjax.loop.driver import Driver
from absjax.loop.sampled_loop import SampledLoop
from absjax.loop.stop import Outcome, Stop, stop
from absjax.observers.designs import KnownRoad
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.surfaces import surface
from tuning.core.files import shipped

DELAY, STEP, TICK, NODES = 0.01, 5e-4, 1e-3, 76
STOP_SPEED, HORIZON = 10 / 3.6, 24.0
"""A stop counts to 10 km/h: below, a delay of the brake is as long as a cycle."""
NEVER = 1e3
"""When a road changes that does not, s."""
MAX_EVENTS = 2400
LANES = 32
"""Stops that run together: one program, whatever their number."""
LONGEST_CYCLE = 1.0
"""Longer ones count as sticking, s."""


class Case(NamedTuple):
    """A stop."""

    road: str = "dry_asphalt"
    speed_kmh: float = 120.0
    delay: float = DELAY
    trust: float = 1.0
    """of the prediction; 0: without"""
    known: float = 1.0
    """delay as the controller knows it, over the true one"""
    efficiency: float = 1.0
    """of the brake, over the one the controller knows"""
    after: str | None = None
    """road it changes to"""
    change: float = NEVER
    """when, s"""
    parameters: Mapping[str, float] = {}
    """of the controller, where not the default ones"""
    two_phase: bool = False


def published_gains(delay: float) -> dict[str, float]:
    """alpha and beta of the source [1/s]."""
    return {"gain": math.pi / (4 * delay), "beta1": math.pi / (10 * delay), "beta2": math.pi / (10 * delay)}


def controller_of(case: Case) -> Any:
    """The controller, as it knows road, wheel and delay."""
    known, tyre = case.delay * case.known, surface(case.road)
    road: dict[str, Any] = {"c2": float(tyre.c2), "c3": float(tyre.c3), **case.parameters}
    if case.two_phase:
        beta: dict[str, Any] = {k: v for k, v in published_gains(known).items() if k != "gain"}
        return PredictiveTwoPhase(delay=known, trust=case.trust, **(beta | road))
    gains: dict[str, Any] = {**published_gains(known), **road}
    return PredictiveTracking(delay=known, trust=case.trust, **gains)


def car_of(case: Case) -> QuarterCar:
    """What is braked."""
    wheel = Wheel()
    wheel = dataclasses.replace(wheel, brake_efficiency=case.efficiency * wheel.brake_efficiency)
    surfaces = surface(case.road), surface(case.after or case.road)
    return QuarterCar(wheel, ChangingRoad(surfaces, (case.change,)))


def loop_of(case: Case, observer: Any = None) -> DelayedLoop:
    """The loop of a stop."""
    brake, driver = Brake(rate_limit=750.0), Driver(rate=400.0, largest=150.0)
    return DelayedLoop(
        car_of(case), brake, controller_of(case), STOP_SPEED, observer, driver, delay=case.delay, nodes=NODES
    )


def undelayed_loop(case: Case) -> ClosedLoop:
    """The same without the delay, under the law without prediction and the same gains."""
    kind: Any = TwoPhase if case.two_phase else AccelerationTracking
    own = {k: v for k, v in {**published_gains(case.delay), **case.parameters}.items() if k not in ("beta1", "beta2")}
    if case.two_phase:
        own = {k: v for k, v in own.items() if k != "gain" or "gain" in case.parameters}
    return dataclasses.replace(loop_of(case).undelayed(), controller=kind(**own))


class Stops(NamedTuple):
    """What counts of stops, arrays (stops,)."""

    distance: np.ndarray
    """m, to 10 km/h"""
    cycles: np.ndarray
    longest_cycle: np.ndarray
    lock: np.ndarray
    """longest lock above 15 km/h, s"""
    outcome: np.ndarray

    @property
    def cycling(self) -> np.ndarray:
        """Whether a stop ended, without sticking in a phase."""
        return (self.outcome == Outcome.STOPPED) & (self.longest_cycle < LONGEST_CYCLE)

    def of(self, i: int) -> dict[str, Any]:
        """One of them for a table."""
        return {
            "distance [m]": round(float(self.distance[i]), 2),
            "cycles": int(self.cycles[i]),
            "longest cycle [s]": round(float(self.longest_cycle[i]), 2),
            "longest lock [s]": round(float(self.lock[i]), 3),
            "cycling": "yes"
            if self.cycling[i]
            else Outcome(int(self.outcome[i])).name
            if self.outcome[i]
            else "sticks",
        }


@partial(jax.jit, static_argnames=("horizon",))
def _stops(loop, speed, horizon: float) -> Stop:
    step = TICK if isinstance(loop, SampledLoop) else STEP
    found = stop(loop, speed, horizon=horizon, step=step, max_events=MAX_EVENTS, tile=LANES // 2)
    return found._replace(rollout=None)  # pyright: ignore[reportArgumentType]


def stops(cases: Sequence[Case], sampled: bool = False, delayed: bool = True, observed: bool = False) -> Stops:
    """Stops of cases of one controller kind: located, or in a control unit at 1 ms; or without the delay.

    Args:
        cases: in a control unit 32 in a row have one delay as the controller knows it.
        observed: whether the control unit estimates XBS, by the observer of three states.
    """
    design = KnownRoad()
    observer, substeps = (design.observer(Wheel()), 2 * design.substeps) if observed else (None, 1)
    parts = []
    for first in range(0, len(cases), LANES):
        chunk = list(cases[first : first + LANES])
        filled = chunk + chunk[:1] * (LANES - len(chunk))
        loop = stacked([loop_of(case, observer) if delayed else undelayed_loop(case) for case in filled])
        system: Any = loop
        if sampled:
            ticks, known = (round(x / TICK) for x in (filled[0].delay, filled[0].delay * filled[0].known))
            system = loop.in_unit(ticks, known=known, substeps=substeps) if delayed else SampledLoop(loop)
        found = _stops(system, np.array([case.speed_kmh / 3.6 for case in filled]), HORIZON)
        kept = found.distance, found.cycles, found.longest_cycle, found.longest_lock[0], found.outcome
        parts.append([np.asarray(leaf)[: len(chunk)] for leaf in kept])
    return Stops(*(np.concatenate(columns) for columns in zip(*parts)))


ROBUSTNESS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("as it is", {}),
    ("delay thought half", {"known": 0.5}),
    ("delay thought half as long again", {"known": 1.5}),
    ("brake 10 % weaker", {"efficiency": 0.9}),
    ("brake 10 % stronger", {"efficiency": 1.1}),
    ("dry to wet after 1.2 s", {"after": "wet_asphalt", "change": 1.2}),
    ("wet to dry after 1.2 s", {"road": "wet_asphalt", "after": "dry_asphalt", "change": 1.2}),
)
VERSIONS = (("not predicted", 0.0), ("predicted", 1.0))
COMPARED = "distance [m]", "longest cycle [s]", "longest lock [s]", "cycling"
SWEPT = tuple(1e-3 * x for x in (1, 2, 3, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 25))
"""Delays of the sweep, s."""


def sweep_cases(speed_kmh: float = 120.0) -> list[Case]:
    """Every delay without and with prediction."""
    return [Case(speed_kmh=speed_kmh, delay=h, trust=trust) for _, trust in VERSIONS for h in SWEPT]


def sweep_rows(found: Stops) -> list[dict[str, Any]]:
    """Of `sweep_cases`."""
    named = [(name, h) for name, _ in VERSIONS for h in SWEPT]
    return [{"law": name, "delay [ms]": round(1e3 * h, 3), **found.of(i)} for i, (name, h) in enumerate(named)]


def robustness_cases() -> list[Case]:
    """Every error without and with prediction."""
    return [Case(trust=trust, **error) for _, error in ROBUSTNESS for _, trust in VERSIONS]


def robustness_rows(found: Stops) -> list[dict[str, Any]]:
    """Of `robustness_cases`."""
    named = [(what, name) for what, _ in ROBUSTNESS for name, _ in VERSIONS]
    return [{"error": what, "law": name, **found.of(i)} for i, (what, name) in enumerate(named)]


def estimated_rows() -> list[dict[str, Any]]:
    """The errors again but those of the delay, in a control unit that is told XBS or has to estimate it."""
    errors = [(what, error) for what, error in ROBUSTNESS if "known" not in error]
    named = [(what, name) for what, _ in errors for name, _ in VERSIONS]
    cases = [Case(trust=trust, **error) for _, error in errors for _, trust in VERSIONS]
    both = {how: stops(cases, sampled=True, observed=how == "estimated") for how in ("told", "estimated")}
    rows = []
    for i, (what, name) in enumerate(named):
        row: dict[str, Any] = {"error": what, "law": name}
        for how, found in both.items():
            row |= {f"{of}, XBS {how}": value for of, value in found.of(i).items() if of in COMPARED}
        rows.append(row)
    return rows


def table_roads(roads: Sequence[str], speeds: Sequence[float], **of: Any) -> list[Case]:
    """A case for every road and speed."""
    return [Case(road=road, speed_kmh=speed, **of) for road in roads for speed in speeds]


def tuned_parameters() -> dict[str, dict[str, float]]:
    """Of the shipped sets, by the name of the law."""
    return shipped("delay_gains.json")


def taken(found: Stops, part: slice) -> Stops:
    """Some of the stops."""
    return Stops(*(column[part] for column in found))
