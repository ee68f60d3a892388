"""A car's controllers screened: what each stop has to reach and what it reaches, as rows with a verdict."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax.loop.sampled_loop import loop_state
from absjax.loop.stop import Outcome, Stop
from absjax.loop.vehicle_loop import VehicleLoop
from tuning.cars.car import CarFigures
from tuning.vehicle.regulation import adhesion
from tuning.vehicle.regulation.course import Course, courses, rise_time
from tuning.vehicle.regulation.lanes import Clocked, Lane, lanes_of, loops_of, run
from tuning.vehicle.regulation.quantities import (
    KMH,
    LARGEST_UTILISATION,
    MARGIN,
    UTILISATION,
    Weights,
    mean_rate,
    split_demands,
)
from tuning.vehicle.regulation.surfaces import surfaces

LONGEST_LOCK = 0.2
"""Brief, above 15 km/h, s; the regulation gives no number, this is ours."""
LONGEST_SLIDE = 0.5
"""In all at a slip below -0.8 above 15 km/h, s; ours: a wheel let go of whenever it stands has no long lock."""
LEAST_STEERABILITY = 0.3
"""Ours: a locked wheel has 0.05 of the lateral force of one that rolls, one at the peak of friction half of it."""
STEERING_RATIO = 16.0
"""Of the angle of the steering wheel over that of the front wheels; ours, of a usual car."""
STEERED_SOON, STEERED = 120.0, 240.0
"""Largest angle of the steering wheel on the split road in two seconds, and in all, deg (5.3.6)."""
UTILISED = "utilisation of adhesion"
HELD = "least steerability over 0.5 s"
SPLIT = "z, of both surfaces", "z, of the lower surface"
HALF_A_TYRE = 0.1
"""m; no tyre may cross the line between the two surfaces (5.3.6)."""
LOADS = {False: "unladen", True: "laden"}


class Quantity(NamedTuple):
    """What stops have to reach; numbers may be traced."""

    surface: str
    name: str
    reached: Any
    demanded: Any
    """None: only told"""
    outcomes: Sequence[Any]
    """of the stops"""
    at_least: bool = True
    with_margin: bool = False
    """whether the second verdict asks for `MARGIN` more"""
    note: str = ""
    told: Sequence[Any] = ()
    """numbers of the note"""

    @property
    def margin(self) -> Any:
        """How far it is on the right side, as a share of what is demanded."""
        more = (self.reached - self.demanded) / self.demanded
        return more if self.at_least else -more

    @property
    def firmly(self) -> float:
        """The margin that the second verdict asks for."""
        return MARGIN if self.with_margin else 0.0


@dataclasses.dataclass(frozen=True)
class Row:
    """A quantity of a car, as it is written; None for what is not finite or not demanded."""

    car: str
    load: str
    surface: str
    quantity: str
    demanded: float | None
    reached: float | None
    margin: float | None
    passed: bool | None
    """None where nothing is demanded"""
    passed_with_margin: bool | None
    """with 5 % more than is demanded of epsilon and z"""
    note: str = ""


class Screened(NamedTuple):
    """A car."""

    rows: list[Row]
    lanes: list[Lane]
    stops: Stop
    radii: tuple[float, ...]
    """of the wheels [m]"""
    places: tuple[str, ...]


class Limits(NamedTuple):
    """What is told, and kept where it has a limit; ours, the regulation has none of them."""

    yaw_rate: float | None = None
    """largest yaw rate on the split road, the driver steering, deg/s"""
    side_slip: float | None = None
    """largest side-slip there, deg"""
    held: float | None = None
    """steerability of the half second that has least of it"""


FREE = Limits()


class Adhesions(NamedTuple):
    """Of a car, unladen (False) and laden (True)."""

    weights: dict[bool, Weights]
    found: dict[bool, dict[str, tuple[float, ...]]]
    """(k_f, k_r) by surface"""


def adhesions_of(figures: CarFigures) -> Adhesions:
    """k of a car, measured on both surfaces."""
    keys = [(laden, name) for laden in LOADS for name in surfaces()]
    cars = [adhesion.straight_ahead(figures, surfaces()[name], laden=laden) for laden, name in keys]
    measured = dict(zip(keys, adhesion.measured_adhesion(cars)))
    weights = {laden: Weights.of(car) for (laden, _), car in zip(keys, cars)}
    found = {laden: {name: tuple(map(float, measured[laden, name])) for name in surfaces()} for laden in LOADS}
    return Adhesions(weights, found)


def quantities(
    laden: bool, stops: Sequence[tuple[Lane, Course]], known: Adhesions, rise: Any, limits: Limits = FREE
) -> list[Quantity]:
    """What one load has to reach.

    Args:
        stops: with their courses, those of this load.
        known: adhesion of the car.
        rise: time to a high deceleration [s].
        limits: of what is told otherwise.
    """
    weights, k = known.weights[laden], known.found[laden]
    found = []
    for surface in surfaces():
        tests = [course for lane, course in stops if lane.stop[:2] == ("utilisation", surface)]
        ends = [course.outcome for course in tests]
        rate = mean_rate(jnp.stack([course.utilised for course in tests]))
        note = "z {:.3f}, k {:.3f} in front and {:.3f} behind", (rate, *k[surface])
        used = weights.utilisation(k[surface], rate)
        found.append(Quantity(surface, UTILISED, used, UTILISATION, ends, True, True, *note))
        left = sum(course.steerability for course in tests) / len(tests)
        found.append(Quantity(surface, "steerability", left, LEAST_STEERABILITY, ends))
        held = jnp.stack([course.held for course in tests]).min()
        found.append(Quantity(surface, HELD, held, limits.held, ends))
    for lane, course in stops:
        stop, passed = lane.stop, ("at {:.0f} km/h", (course.passed / KMH,))
        ends = [course.outcome]
        if stop.name == "rise":
            name = f"time to rise from {stop.at:g} [s]"
            found.append(Quantity(stop.surface, name, rise, None, ends, False, False, *passed))
        elif stop.name != "utilisation":
            note, told = passed if stop.name == "passage" else ("", ())
            for name, reached, limit in (("lock", course.lock, LONGEST_LOCK), ("slide", course.slide, LONGEST_SLIDE)):
                what = f"{name} from {stop.at:g} [s]"
                found.append(Quantity(stop.surface, what, reached, limit, ends, False, False, note, told))
    split = next(course for lane, course in stops if lane.stop.name == "split")
    ends = [split.outcome]
    if laden:
        high, low = (weights.mean_adhesion(k[name], split.rate) for name in surfaces())
        for name, least in zip(SPLIT, split_demands(high, low)):
            found.append(Quantity("split", name, split.rate, least, ends, with_margin=True))
    note = "turned by {:.1f} deg", (jnp.degrees(split.yaw),)
    found.append(Quantity("split", "tyre from the line [m]", split.clearance, HALF_A_TYRE, ends, True, False, *note))
    for name, angle, limit in (("in 2 s", split.steered_soon, STEERED_SOON), ("in all", split.steered, STEERED)):
        turned = jnp.degrees(STEERING_RATIO * angle)
        found.append(Quantity("split", f"steered {name} [deg]", turned, limit, ends, False))
    largest = (
        ("yaw rate [deg/s]", split.yaw_rate, limits.yaw_rate),
        ("side-slip [deg]", split.side_slip, limits.side_slip),
    )
    for name, reached, limit in largest:
        found.append(Quantity("split", f"largest {name}", jnp.degrees(reached), limit, ends, False))
    return found


def all_quantities(loops: VehicleLoop, lanes: Sequence[Lane], stops: Stop, known: Adhesions, limits: Limits = FREE):
    """Of both loads: (laden, quantity). Differentiable by the loops' parameters through the course of the stops."""
    every = courses(loops, stops)
    path, found = stops.rollout.path, []
    motion = loop_state(path.state).vehicle.motion
    for laden in LOADS:
        mine = [(i, lane) for i, lane in enumerate(lanes) if lane.laden == laden]
        own = [(lane, jax.tree.map(lambda leaf, i=i: leaf[i], every)) for i, lane in mine]
        high = mean_rate(jnp.stack([c.utilised for lane, c in own if lane.stop[:2] == ("utilisation", "high")]))
        at, lane = next((i, lane) for i, lane in mine if lane.stop.name == "rise")
        rise = rise_time(path.time[at], motion.longitudinal[at], motion.distance[at], lane.stop.change, high)
        found += [(laden, quantity) for quantity in quantities(laden, own, known, rise, limits)]
    return found


def screened(
    car: str, figures: CarFigures, loops: Mapping[bool, VehicleLoop], clocked: Clocked, limits: Limits = FREE
) -> Screened:
    """Screen the controllers of a car.

    Args:
        car: its name.
        loops: of it on four wheels, unladen (False) and laden (True); their roads do not matter.
        clocked: makes the system that is rolled out.
        limits: of what is told otherwise.
    """
    lanes = lanes_of(loops[False].driver)
    together = loops_of(loops, lanes)
    stops, known = run(together, lanes, clocked), adhesions_of(figures)
    found = all_quantities(together, lanes, stops, known, limits)
    rows, car_on_four = [row_of(car, laden, quantity) for laden, quantity in found], loops[False].vehicle
    radii = tuple(float(wheel.radius) for wheel in car_on_four.wheels)
    return Screened(rows, lanes, stops, radii, car_on_four.places)


def row_of(car: str, laden: bool, quantity: Quantity) -> Row:
    """As it is written."""
    margin = passed = firmly = None
    if quantity.demanded is not None:
        margin = float(quantity.margin)
        passed = margin >= 0
        firmly = margin >= quantity.firmly
    notes = [quantity.note.format(*map(float, quantity.told))] if quantity.note else []
    if quantity.name == UTILISED and float(quantity.reached) > LARGEST_UTILISATION:
        notes.append("above 1.1: k is to be measured anew")
    ends = {Outcome(int(outcome)) for outcome in quantity.outcomes} - {Outcome.STOPPED}
    notes += [end.name.lower().replace("_", " ") for end in sorted(ends)]
    return Row(
        car=car,
        load=LOADS[laden],
        surface=quantity.surface,
        quantity=quantity.name,
        demanded=_finite(quantity.demanded),
        reached=_finite(quantity.reached),
        margin=_finite(margin),
        passed=passed,
        passed_with_margin=firmly,
        note="; ".join(notes),
    )


def _finite(value: Any) -> float | None:
    return None if value is None or not math.isfinite(float(value)) else float(value)
