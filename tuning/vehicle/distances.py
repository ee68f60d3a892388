"""Braking distances of a whole car: sets tuned on a quarter car and on the car, true speed and estimated.

All cars brake under the same driver, 400 bar/s up to 150 bar, through actuators with a rate limit of 750 bar/s and a
lag of 5 ms; the ideal is that of the car under the pedal (`absjax.loop.vehicle_ideal`). The settings: switchings
located, told the truth; sampled every millisecond, told the truth; sampled, told a speed that a Kalman filter estimates
from all wheels and an accelerometer with errors, after two seconds of rolling (`tuning.cars.entry.VehicleEntry`).
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from absjax.loop.stop import Outcome
from tuning.cars.entry import AXLES
from tuning.controllers.batch import Batch, batch_of, scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.recipes import car_sets, tuned_sets
from tuning.controllers.rows import Row, rows_of
from tuning.controllers.scatter import scattered
from tuning.controllers.setup import Setup
from tuning.core.components import initial
from tuning.core.roads import Surfaces

CONTROLLERS = "five_phase", "two_phase", "slip", "rolling_slip", "bosch", "production"
"""Those of tables; two-phase goes by the true XBS here."""
TO_STOP_KMH = 15.0
"""Below this speed relaxed tyres and a control unit's tick leave little to control."""
MOST_EVENTS = 2500
"""Switchings a stop may make, of all channels."""
MUCH = 0.5
"""Time in all from which on a wheel that slides is counted, s."""
SETTINGS = "located", "sampled 1 ms", "sampled, estimated speed"
DRAWN = "drawn conditions, estimated speed"
ALL = "all cars"
CHANGING = tuple(
    Surfaces(surfaces, changes, speeds)
    for surfaces, changes, speeds in (
        (("dry_asphalt", "snow"), (45.0,), (120.0,)),
        (("wet_asphalt", "snow"), (20.0,), (80.0,)),
        (("snow", "dry_asphalt"), (40.0,), (100.0,)),
        (("wet_cobblestones", "dry_concrete"), (30.0,), (90.0,)),
        (("dry_asphalt", "snow", "dry_asphalt"), (25.0, 55.0), (120.0, 150.0)),
        (("dry_concrete", "wet_cobblestones", "dry_concrete"), (20.0, 60.0), (110.0,)),
        (("dry_asphalt", "wet_asphalt"), (25.0,), (100.0,)),
    )
)
"""Roads that change along the way; none is tuned on, but sets have been chosen by them."""
FURTHER = tuple(
    Surfaces(surfaces, changes, speeds)
    for surfaces, changes, speeds in (
        (("dry_concrete", "wet_cobblestones"), (35.0,), (110.0,)),
        (("snow", "wet_asphalt"), (30.0,), (90.0,)),
        (("dry_asphalt", "snow"), (60.0,), (130.0,)),
        (("wet_cobblestones", "snow"), (15.0,), (70.0,)),
        (("wet_asphalt", "snow", "wet_asphalt"), (30.0, 60.0), (110.0,)),
        (("snow", "dry_concrete", "snow"), (20.0, 35.0), (80.0,)),
        (("dry_cobblestones", "wet_asphalt", "dry_cobblestones"), (15.0, 40.0), (100.0,)),
    )
)
"""Others, on which nothing has been tuned; they were looked at when the set of three cars was chosen."""


class Found(NamedTuple):
    """One set of a controller in one setting on one vehicle, over the rows of a configuration."""

    vehicle: str
    controller: str
    set: str
    setting: str
    excess: np.ndarray
    """distance over ideal less 1, (rows,); nan where a stop does not end"""
    longest_lock: np.ndarray
    """above 15 km/h [s]"""
    slide_time: tuple[np.ndarray, ...]
    """of the wheels of each axle, in all, with a slip below -0.8 above 15 km/h [s]"""
    names: tuple[str, ...]
    """of the rows"""

    def row(self) -> dict[str, Any]:
        """What is told of it."""
        ended = np.isfinite(self.excess)
        worst = int(np.nanargmax(self.excess)) if ended.any() else 0
        return {
            "controller": self.controller,
            "set": self.set,
            "setting": self.setting,
            "mean above ideal [%]": round(100 * float(np.mean(self.excess[ended])), 2) if ended.any() else None,
            "worst [%]": round(100 * float(self.excess[worst]), 2) if ended.any() else None,
            "on": self.names[worst],
            "do not end": int(np.sum(~ended)),
            "locked over 0.2 s": int(np.sum(self.longest_lock > 0.2)),
            "longest lock [s]": round(float(np.max(self.longest_lock)), 3),
            **{
                f"{axle.rstrip('.')} slides over {MUCH:g} s": int(np.sum(time > MUCH))
                for axle, time in zip(AXLES, self.slide_time)
            },
            "longest slide [s]": round(float(np.max(self.slide_time)), 2),
        }


def sets_of(controller: str, axles: bool) -> dict[str, dict[str, float]]:
    """The default set, that tuned on a quarter car, and that tuned on the car, of one controller.

    Args:
        axles: whether each axle has its own; a set of one wheel is then that of both.
    """
    kind = TuningConfig(controller=controller).kind
    found, of_a_wheel = {"untuned": initial(kind, {})}, tuned_sets().get(controller)
    if of_a_wheel is not None:
        found["quarter car"] = initial(kind, of_a_wheel.start)
    prefixes = AXLES if axles else ("",)
    spread = {name: {p + n: v for p in prefixes for n, v in values.items()} for name, values in found.items()}
    on_car = car_sets().get(controller)
    return spread if on_car is None else {**spread, "car": Setup.of(on_car).initial}


def compared(config: TuningConfig, sets: Mapping[str, Mapping[str, float]]) -> list[Found]:
    """Sets of one controller in every setting, over the rows of a configuration, on each of its vehicles."""
    told = dataclasses.replace(config.vehicle, speed="kalman", speed_parameters={})
    found = []
    for setting, chosen in zip(SETTINGS, (config, config, dataclasses.replace(config, vehicle=told))):
        setup = Setup.of(chosen)
        grid = () if setting == SETTINGS[0] else setup.sampled_grid()
        found += _judged(setting, batch_of(setup), rows_of(chosen), sets, config, grid)
    return found


def drawn(config: TuningConfig, sets: Mapping[str, Mapping[str, float]]) -> list[Found]:
    """Sets of one controller in conditions drawn around the rows of a configuration (`tuning.controllers.scatter`), its
    test draws, on each of its vehicles."""
    setup = Setup.of(config)
    rows = [row for row in rows_of(config) for _ in range(config.checked)]
    return _judged(DRAWN, scattered(setup, "test"), rows, sets, config, setup.sampled_grid())


def _judged(
    setting: str,
    batch: Batch,
    rows: Sequence[Row],
    sets: Mapping[str, Mapping[str, float]],
    config: TuningConfig,
    grid: Sequence[Any],
) -> list[Found]:
    """Sets on a batch, by vehicle; `grid` as `tuning.controllers.batch.scored` takes it, empty where switchings are
    located."""
    order = tuple(next(iter(sets.values())))
    values = {name: np.array([chosen[name] for chosen in sets.values()]) for name in order}
    judged = scored(batch, values, *grid)
    stopped = np.asarray(judged.stops.outcome) == Outcome.STOPPED
    excess = np.where(stopped, np.asarray(judged.stops.distance) / batch.ideal[:, None] - 1, np.nan)
    locks, wheels = np.asarray(judged.stops.longest_lock[0]), np.asarray(judged.stops.slide_time)
    slides = wheels.reshape(len(AXLES), -1, *locks.shape).max(axis=1)
    names, which = np.array([f"{row.name}, {row.speed_kmh:g} km/h" for row in rows]), np.array([r.which for r in rows])
    return [
        Found(
            one.name,
            config.controller,
            name,
            setting,
            excess[which == i, k],
            locks[which == i, k],
            tuple(slides[:, which == i, k]),
            tuple(names[which == i]),
        )
        for i, one in enumerate(config.vehicle.each)
        for k, name in enumerate(sets)
    ]


def together(found: Sequence[Found]) -> list[Found]:
    """What is found of each set in each setting on several vehicles, as of one."""
    sets = dict.fromkeys((one.controller, one.set, one.setting) for one in found)
    return [_pooled([one for one in found if (one.controller, one.set, one.setting) == key]) for key in sets]


def _pooled(found: Sequence[Found]) -> Found:
    names = tuple(f"{name}, {one.vehicle}" for one in found for name in one.names)
    excess, locks = (np.concatenate([getattr(one, name) for one in found]) for name in ("excess", "longest_lock"))
    slides = tuple(map(np.concatenate, zip(*(one.slide_time for one in found))))
    return found[0]._replace(vehicle=ALL, excess=excess, longest_lock=locks, slide_time=slides, names=names)


def distances(
    cars: Sequence[str],
    roads: Sequence[Any],
    speeds_kmh: tuple[float, ...],
    controllers: Sequence[str] = CONTROLLERS,
    judge: Callable[..., list[Found]] = compared,
    **entries: Any,
) -> list[Found]:
    """Every set of every controller on cars, unladen and laden, as `judge` has it.

    Args:
        entries: of the configuration, besides.
    """
    found, vehicle = [], {"car": list(cars), "laden": [False, True], "sets": "own", **entries.pop("vehicle", {})}
    for controller in controllers:
        config = TuningConfig(
            controller=controller,
            roads=tuple(roads),
            speeds_kmh=speeds_kmh,
            stop_speed_kmh=TO_STOP_KMH,
            vehicle=vehicle,
            max_events=MOST_EVENTS,
            **entries,
        )
        found += judge(config, sets_of(controller, axles=True))
    return found
