"""The published table under a pedal that is given: the quantity its source prints, with and without limits.

The source prints v0^2 / (2 g mean friction of the ABS-active time) of the five-phase and the two-phase algorithm, and
says neither whether its brake had limits nor how its driver pressed. Here the pedal is 400 bar/s, or 6000 bar m/s^2
over the initial speed, with which a ramp of the source's form begins; thresholds and zref are 10 m/s^2 at least; there
is one set for all rows, the two-phase ones on the true XBS.
Source: Aguado-Rojas 2019, Table 4.1.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tuning.controllers.config import TuningConfig
from tuning.controllers.recipes import published_sets
from tuning.controllers.settings import LOCATED
from tuning.controllers.study.distances import NAMES, Entry, stops_of
from tuning.core.components import initial

COLUMNS = ("five_phase", "two_phase")


class Limits(NamedTuple):
    """What limits the brake."""

    rate_limit: float | None
    """bar/s"""
    lag: float | None
    """s"""

    @property
    def label(self) -> str:
        """In words."""
        parts = [] if self.rate_limit is None else [f"{self.rate_limit:g} bar/s"]
        parts += [] if self.lag is None else [f"lag {1e3 * self.lag:g} ms"]
        return " and ".join(parts) or "none"


def limits_of(config: TuningConfig) -> Limits:
    """What limits the brake of a configuration."""
    return Limits(config.rate_limit, config.lag)


def entries() -> dict[Limits, list[Entry]]:
    """Stops of all sets under both pedals, located."""
    found: dict[Limits, list[Entry]] = {}
    for config in published_sets():
        found.setdefault(limits_of(config), []).extend(
            stops_of(config, {"tuned": initial(config.kind, config.start)}, LOCATED)
        )
    return found


def gap(entry: Entry) -> float:
    """How far the published quantity of a stop is above the published one, a share."""
    quantity, published = entry.stop.published_quantity, entry.row.published(entry.controller)
    return np.inf if quantity is None or published is None else quantity / published - 1


def _pedal(entry: Entry) -> str:
    return "400 bar/s" if entry.row.pedal_rate == 400.0 else "6000 bar m/s² / v0"


def counts(found: dict[Limits, list[Entry]]) -> list[dict[str, Any]]:
    """How many of the 30 entries are at or below the published ones, by limits and pedal."""
    rows = []
    for limits, stops in found.items():
        for pedal in dict.fromkeys(map(_pedal, stops)):
            mine = [e for e in stops if _pedal(e) == pedal]
            row: dict[str, Any] = {"limits": limits.label, "pedal": pedal}
            for name in COLUMNS:
                own = [gap(e) for e in mine if e.controller == name]
                row[f"{NAMES[name]}: <= published"] = f"{sum(g <= 0 for g in own)} of {len(own)}"
                row[f"{NAMES[name]}: mean gap [%]"] = f"{100 * sum(own) / len(own):.2f}"
            row["entries <= published"] = f"{sum(gap(e) <= 0 for e in mine)} of {len(mine)}"
            row["largest gap [%]"] = f"{100 * max(map(gap, mine)):.2f}"
            rows.append(row)
    return rows


def rows(found: dict[Limits, list[Entry]]) -> list[dict[str, Any]]:
    """Every entry: published, and the quantity under each limits and pedal; + marks what is above."""
    table: dict[tuple[str, float, str], dict[str, Any]] = {}
    for limits, stops in found.items():
        for e in sorted(stops, key=lambda e: (COLUMNS.index(e.controller), e.row.speed_kmh, e.ideal)):
            key = (e.controller, e.row.speed_kmh, e.row.name)
            row = table.setdefault(
                key,
                {
                    "controller": NAMES[e.controller],
                    "km/h": e.row.speed_kmh,
                    "road": e.row.name,
                    "published": f"{e.row.published(e.controller):.2f}",
                },
            )
            mark = " +" if gap(e) > 0 else ""
            row[f"limits {limits.label}; {_pedal(e)}"] = f"{e.stop.published_quantity:.2f}{mark}"
    return list(table.values())


def above(found: dict[Limits, list[Entry]]) -> list[dict[str, Any]]:
    """The gap of every entry that is above the published one."""
    return [
        {
            "limits": limits.label,
            "pedal": _pedal(e),
            "controller": NAMES[e.controller],
            "km/h": e.row.speed_kmh,
            "road": e.row.name,
            "published": f"{e.row.published(e.controller):.2f}",
            "found": f"{e.stop.published_quantity:.2f}",
            "gap [%]": f"{100 * gap(e):.2f}",
            "from the pedal above ideal [%]": "-" if e.excess is None else f"{100 * e.excess:.2f}",
        }
        for limits, stops in found.items()
        for e in stops
        if gap(e) > 0
    ]


def onset_rows(found: dict[Limits, list[Entry]]) -> list[dict[str, Any]]:
    """What the published quantity leaves out: how late the controllers begin, and the way from the pedal."""
    return [
        {
            "limits": limits.label,
            "pedal": pedal,
            "controller": NAMES[name],
            "latest onset [s]": f"{max(e.stop.onset_s or 0.0 for e in mine):.2f}",
            "from the pedal above ideal, mean [%]": _mean([e.excess for e in mine]),
        }
        for limits, stops in found.items()
        for pedal in dict.fromkeys(map(_pedal, stops))
        for name in COLUMNS
        for mine in [[e for e in stops if e.controller == name and _pedal(e) == pedal]]
    ]


def _mean(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{100 * sum(known) / len(known):.2f}" if len(known) == len(values) else "-"
