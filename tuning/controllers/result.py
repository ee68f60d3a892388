"""A tuned controller and what it is worth, as it is written and read back."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from absjax.controllers.base import Controller
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import CycleRow
from tuning.controllers.legacy import updated_result
from tuning.controllers.setup import Setup
from tuning.controllers.splits import SplitFigures
from tuning.controllers.stop_figures import StopFigures
from tuning.core.version import VERSION


@dataclasses.dataclass(frozen=True)
class ResultRow:
    """A road, speed, pedal and vehicle: ideal and published distances [m], the stops of the start (`untuned`) and of
    the tuned set.

    `ideal` is from the pedal, None in results of earlier versions; `published_ideal` is v0^2 / (2 g mu_max), None on a
    road that changes; `published` is None where nothing is.
    """

    road: str
    speed_kmh: float
    pedal_bar_s: float | None
    ideal: float | None
    published_ideal: float | None
    published: float | None
    untuned: StopFigures
    tuned: StopFigures
    sampled: StopFigures
    growth: float | None = None
    """of the tuned stop, located (`absjax.loop.growth`): 2 for a regular one; None in results of earlier versions"""
    at_half_step: float | None = None
    """where the tuned stop is another at half its grid step (`absjax.loop.step_check`): its distance there, m"""
    car: str = ""
    """which one, where there are several"""

    @property
    def where(self) -> str:
        """Road, speed, and car where there are several."""
        return f"{self.road}, {self.speed_kmh:g} km/h" + (f", {self.car}" if self.car else "")

    @property
    def reached(self) -> bool | None:
        """Whether the published quantity of the tuned set, located and sampled, is at or below the published one."""
        if self.published is None:
            return None
        found = (self.tuned.published_quantity, self.sampled.published_quantity)
        return all(d is not None and d <= self.published for d in found)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "ResultRow":
        """Read back what `dataclasses.asdict` gave."""
        stops = {name: StopFigures(**data[name]) for name in ("untuned", "tuned", "sampled")}
        return cls(**{**data, **stops})


@dataclasses.dataclass(frozen=True)
class TuningResult:
    """A tuned controller and what it is worth. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    rows: list[ResultRow]
    cycles: list[CycleRow]
    """limit cycles on every uniform road; empty for a controller without"""
    cost: float
    """of the winner, at the worse of both semantics"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that ended on one of their limits"""
    config: TuningConfig
    version: str = VERSION
    warnings: list[str] = dataclasses.field(default_factory=list)
    """what a user of the set should know: phases that last less than a tick, and the like"""
    breached: list[str] | None = None
    """a sentence for every row of the regulation that the set breaches; None where it was not screened"""
    interrupted: bool = False
    """whether the search was ended from the keyboard"""
    splits: list[SplitFigures] = dataclasses.field(default_factory=list)
    """the start (untuned) and the tuned set in training, validation and test draws; empty where it was tuned located"""

    @property
    def setup(self) -> Setup:
        """The loop it was tuned in."""
        return Setup.of(self.config)

    @property
    def controller(self) -> Controller:
        """The tuned controller.

        Raises:
            ValueError: if each axle of a vehicle has its own; `setup.controller(parameters, axle)` is that of one.
        """
        if len(self.config.prefixes) > 1:
            raise ValueError("a controller for each axle: setup.controller(parameters, axle) is that of one")
        return self.setup.controller(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "TuningResult":
        """Read back what `to_json` gave, or a result of an earlier version."""
        known = updated_result(data)
        rows = [ResultRow.from_json(row) for row in known["rows"]]
        cycles = [CycleRow(**row) for row in known["cycles"]]
        splits = [SplitFigures(**row) for row in known.get("splits", ())]
        config = TuningConfig.from_json(known["config"])
        return cls(**{**known, "rows": rows, "cycles": cycles, "splits": splits, "config": config})
