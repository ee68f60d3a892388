"""Distances from the pedal of every controller on every road from every speed, untuned and tuned, in every setting.

All controllers brake under the same driver, 400 bar/s up to 150 bar, through an actuator with a rate limit of 750 bar/s
and a lag of 5 ms, with thresholds and zref of 10 m/s^2 at least. Those that use XBS are told the estimate of the
adaptive observer, but for continuous control of XBS, which needs the true one. Untuned sets are the defaults.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from absjax.controllers import CONTROLLERS
from absjax.loop.stop import stop
from tuning.controllers import published
from tuning.controllers.batch import every_set_on_every_row
from tuning.controllers.config import TuningConfig
from tuning.controllers.loops import shortest
from tuning.controllers.recipes import tuned_sets
from tuning.controllers.rows import Row, rows_of
from tuning.controllers.settings import LOCATED, SAMPLED, Setting
from tuning.controllers.setup import Setup
from tuning.controllers.stop_figures import StopFigures
from tuning.controllers.study.ride import Ride, ride_of
from tuning.core.components import initial
from tuning.core.roads import stacked, surfaces_of

NAMES = {name: kind.title for name, kind in CONTROLLERS.items()}
SETS = ("untuned", "tuned")
HORIZON = 2.0
"""Longest time allowed, as a multiple of the ideal stop's, plus one second."""
RECORD = 1e-3
"""Between the points that are kept where a ride is asked for, s."""
NO_MAXIMUM = ((0.8, 12.0, 0.0), (0.35, 40.0, 0.0))
"""Roads whose friction does not fall with slip, like gravel or deep snow: c1, c2 and c3 = 0."""
FURTHER_ROADS: tuple[Any, ...] = ("snow", "ice", *NO_MAXIMUM)
FURTHER_SPEEDS_KMH = (60.0, 120.0)


class Entry(NamedTuple):
    """One stop of the study."""

    controller: str
    set: str
    setting: Setting
    row: Row
    ideal: float
    """from the pedal, m"""
    stop: StopFigures
    mark: str
    """what is special about it, see `absjax.controllers.base.Controller.mark_on`"""
    ride: Ride | None = None
    """what else a driver notices, where the stop was recorded"""

    @property
    def excess(self) -> float | None:
        """Distance above ideal, a share; None where the stop does not end."""
        return None if self.stop.distance is None else self.stop.distance / self.ideal - 1


def stops_of(
    config: TuningConfig, sets: Mapping[str, Mapping[str, float]], setting: Setting, record: bool = False
) -> list[Entry]:
    """Stops of parameter sets of one controller on all rows of a configuration."""
    setup, rows = Setup.of(config), rows_of(config)
    road, pedal = stacked([row.road for row in rows]), np.array([row.pedal_rate for row in rows])
    speed = np.array([row.speed for row in rows])
    loop = setup.loop(setup.controller(), road, pedal)
    horizon = HORIZON * max(row.longest_ideal for row in rows) + 1.0
    ideal = np.asarray(shortest(loop, speed, horizon))
    names = tuple(next(iter(sets.values())))
    values = {name: np.array([chosen[name] for chosen in sets.values()]) for name in names}
    lanes = every_set_on_every_row(loop, values, len(rows))
    system, step = setting.applied(setup, lanes)
    stopped = stop(
        system,
        np.repeat(speed, len(sets)),
        horizon=horizon,
        step=step,
        max_events=config.max_events,
        save_every=max(1, round(RECORD / step)) if record else 0,
        tile=max(8, -(-len(rows) * len(sets) // 4)),
    )
    ride = ride_of(lanes, stopped) if record else None
    return [
        Entry(
            config.controller,
            name,
            setting,
            row,
            float(ideal[i]),
            StopFigures.of(stopped, lane),
            setup.controller(chosen).mark_on(surfaces_of(row.road)[0]),
            None if ride is None else Ride(*(float(values[lane]) for values in ride)),
        )
        for i, row in enumerate(rows)
        for k, (name, chosen) in enumerate(sets.items())
        for lane in [i * len(sets) + k]
    ]


def untuned_and_tuned(config: TuningConfig) -> dict[str, dict[str, float]]:
    """Parameters of the default set, and of the start of a shipped configuration."""
    return dict(zip(SETS, (initial(config.kind, {}), initial(config.kind, config.start))))


def study(
    settings: Iterable[Setting],
    roads: tuple[Any, ...] = published.ROADS,
    speeds_kmh: tuple[float, ...] = published.SPEEDS_KMH,
) -> list[Entry]:
    """Stops of all shipped controllers in all settings."""
    found = []
    for config in tuned_sets().values():
        config = dataclasses.replace(config, roads=roads, speeds_kmh=speeds_kmh)
        for setting in settings:
            found += stops_of(config, untuned_and_tuned(config), setting, record=setting in (LOCATED, SAMPLED))
    return found


def _key(e: Entry) -> dict[str, Any]:
    return {
        "controller": e.controller,
        "set": e.set,
        "setting": e.setting.name,
        "period_ms": "" if e.setting.period is None else f"{1e3 * e.setting.period:g}",
        "road": e.row.name,
        "speed_kmh": e.row.speed_kmh,
    }


def table(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Every stop: distances from the pedal first, then the published quantity with the onset it begins at."""
    return [
        {
            **_key(e),
            "pedal_bar_s": e.row.pedal_rate,
            "pedal_distance_m": _rounded(e.stop.distance),
            "pedal_ideal_m": round(e.ideal, 4),
            "published_quantity_m": _rounded(e.stop.published_quantity),
            "onset_s": _rounded(e.stop.onset_s),
            "onset_kmh": _rounded(e.stop.onset_kmh),
            "cycles": e.stop.cycles,
            "lock_s_above_15": _rounded(e.stop.lock_s_above_15),
            "lock_s_above_2_5": _rounded(e.stop.lock_s_above_2_5),
            "outcome": e.stop.outcome,
        }
        for e in entries
    ]


def details(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """What else is counted of every stop; jerk and slip of those that were recorded."""
    return [
        {
            **_key(e),
            "longest_lock_s_above_15": _rounded(e.stop.longest_lock_above_15),
            "longest_cycle_s": _rounded(e.stop.longest_cycle),
            "rms_jerk_m_s3": None if e.ride is None else _rounded(e.ride.jerk),
            "largest_slip_above_15": None if e.ride is None else _rounded(e.ride.largest_slip),
            "slip_above_0_5_s": None if e.ride is None else _rounded(e.ride.time_above_large_slip),
            "apply_ended_by_slip_limit": e.mark == "S",
        }
        for e in entries
    ]


def _rounded(value: float | None, digits: int = 4) -> float | None:
    return None if value is None else round(value, digits)


def summary(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """By controller, set and setting: how far above ideal, and what it costs. A set with a stop that does not end
    misses its aim, whatever the mean of the others is."""
    rows = []
    for key in dict.fromkeys((e.controller, e.set, e.setting) for e in entries):
        mine = [e for e in entries if (e.controller, e.set, e.setting) == key]
        excess = [e.excess for e in mine if e.excess is not None]
        quantity = [
            e.stop.published_quantity / e.row.published_ideal - 1
            for e in mine
            if e.row.published_ideal is not None and e.stop.published_quantity is not None and e.excess is not None
        ]
        rows.append(
            {
                "controller": NAMES[key[0]],
                "set": key[1],
                "setting": key[2].label,
                "stops": len(mine),
                "do not end": len(mine) - len(excess),
                "mean above ideal [%]": _percent(float(np.mean(excess)) if excess else None),
                "worst [%]": _percent(max(excess, default=None)),
                "quantity above its ideal, mean [%]": _percent(float(np.mean(quantity)) if quantity else None),
                "latest onset [s]": f"{max(e.stop.onset_s or 0.0 for e in mine):.2f}",
                "lock > 15 km/h, longest [s]": f"{max(e.stop.longest_lock_above_15 or 0.0 for e in mine):.3f}",
                "lock > 2.5 km/h, most [s]": f"{max(e.stop.lock_s_above_2_5 or 0.0 for e in mine):.3f}",
            }
        )
    return rows


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.2f}"


def ride_rows(entries: Sequence[Entry]) -> list[dict[str, Any]]:
    """Jerk and slip by controller, set and setting, of the stops that were recorded."""
    rows = []
    recorded = [e for e in entries if e.ride is not None]
    for key in dict.fromkeys((e.controller, e.set, e.setting) for e in recorded):
        mine = [e.ride for e in recorded if e.ride and (e.controller, e.set, e.setting) == key]
        rows.append(
            {
                "controller": NAMES[key[0]],
                "set": key[1],
                "setting": key[2].label,
                "rms jerk, mean [m/s³]": round(float(np.mean([ride.jerk for ride in mine])), 1),
                "largest slip > 15 km/h": round(max(ride.largest_slip for ride in mine), 2),
                "slip > 0.5, most [s]": round(max(ride.time_above_large_slip for ride in mine), 3),
            }
        )
    return rows


def wide_rows(entries: Sequence[Entry], setting: Setting, which: str = "tuned") -> list[dict[str, Any]]:
    """Distances of one setting, a road and speed a row, a controller a column."""
    mine = [e for e in entries if e.setting == setting and e.set == which]
    places = sorted({(e.row.speed_kmh, e.ideal, e.row.name) for e in mine})
    return [
        {
            "km/h": speed,
            "road": name,
            **{NAMES[e.controller]: cell(e) for e in mine if (e.row.speed_kmh, e.row.name) == (speed, name)},
            "ideal": f"{ideal:.2f}",
        }
        for speed, ideal, name in places
    ]


def cell(entry: Entry) -> str:
    """Distance from the pedal, or how the stop failed to end; with its mark."""
    if entry.stop.distance is None:
        return entry.stop.outcome.lower().replace("_", " ")
    return f"{entry.stop.distance:.2f} {entry.mark}".rstrip()
