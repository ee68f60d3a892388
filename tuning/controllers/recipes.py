"""How the shipped controller sets are made: configurations that begin with untuned values, one for each.

`data/recipes.json` has them; `data/controllers.json` has the parameters found, by the name of the recipe.
`python -m tuning abs-sets` makes them anew.
"""

import dataclasses
from collections.abc import Iterable
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from tuning.controllers.config import TuningConfig
from tuning.controllers.tune import TuningResult
from tuning.core.files import read_json, write_json

DIGITS = 12
"""Significant ones of shipped parameters."""


def shipped(name: str) -> Any:
    """A JSON file among the package's data."""
    with resources.as_file(resources.files("tuning") / "data" / name) as path:
        return read_json(path)


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
    return tuple(config for name, config in _sets().items() if name != config.controller)


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
