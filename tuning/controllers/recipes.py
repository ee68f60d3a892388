"""How the shipped controller sets are made: configurations that begin with untuned values, one for each.

`data/recipes.json` has them; `data/controllers.json` has the parameters found, by the name of the recipe: of a
controller on one wheel, on a car, under the limits of the published table, or where it runs.
`python -m tuning abs-sets` makes them anew.
"""

import dataclasses
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from tuning.controllers.config import TuningConfig
from tuning.controllers.result import TuningResult
from tuning.core.files import shipped, write_json

DIGITS = 12
"""Significant ones of shipped parameters."""


@cache
def recipes() -> dict[str, TuningConfig]:
    """By name: of a controller, or of a controller and the limits under which the published table is aimed at."""
    return {name: TuningConfig.from_json(entry) for name, entry in shipped("recipes.json").items()}


@cache
def tuned_sets() -> dict[str, TuningConfig]:
    """The tuned sets by controller; the parameters are the start of a configuration."""
    return {name: config for name, config in _sets().items() if name == config.controller}


@cache
def published_sets() -> tuple[TuningConfig, ...]:
    """Sets tuned for the published quantity, one for each controller and limits."""
    return tuple(c for c in _sets().values() if c.reference == "published")


@cache
def running_sets() -> tuple[TuningConfig, ...]:
    """Sets tuned for where they run: sampled on the truth, or told by a chain."""
    return tuple(c for c in _sets().values() if c.setting != "located" and c.vehicle is None)


@cache
def car_sets() -> dict[str, TuningConfig]:
    """The sets tuned on a car, by controller."""
    return {config.controller: config for config in _sets().values() if config.vehicle is not None}


def _sets() -> dict[str, TuningConfig]:
    starts = shipped("controllers.json")
    return {
        name: dataclasses.replace(recipe, start=starts[name]) for name, recipe in recipes().items() if name in starts
    }


def write_sets(results: Iterable[tuple[str, TuningResult]], path: Path) -> Path:
    """Parameters by recipe, as they are shipped."""
    rounded = {
        name: {key: float(f"{value:.{DIGITS}g}") for key, value in result.parameters.items()}
        for name, result in results
    }
    return write_json(path, rounded)
