"""Results of earlier versions, read as what they mean today."""

import warnings
from collections.abc import Mapping
from typing import Any

from absjax.controllers import CONTROLLERS
from absjax.parameters import bounds_of

RAMP = "ramp"
"""The driver's ramp, once a parameter of controllers."""


def updated(config: Any) -> Any:
    """A configuration as a dictionary, of today.

    A driver's ramp is dropped with a warning: the pedal is no parameter of a controller. Sets of a time when there was
    one may have thresholds out of order, which are put in order with a warning.
    """
    if not isinstance(config, Mapping) or not _has_ramp(config):
        return config
    warnings.warn("ramp is dropped: the pedal is the driver's (pedal_rate), no parameter of a controller", stacklevel=4)
    config = dict(config)
    controller = config.get("controller", "five_phase")
    for entry, update in (("start", _valid), ("limits", lambda _, values: values)):
        if entry in config:
            config[entry] = update(controller, _without(config[entry]))
    if "known" in config:
        config["known"] = [_valid(controller, _without(item)) for item in config["known"]]
    if "tune" in config:
        config["tune"] = [name for name in config["tune"] if name != RAMP]
    return config


def updated_result(data: Mapping[str, Any]) -> dict[str, Any]:
    """A result of `tune-abs` as a dictionary, of today: distances once counted from the first switching on."""
    return {**data, "rows": [_row(row) for row in data["rows"]]}


def _row(row: Mapping[str, Any]) -> dict[str, Any]:
    if isinstance(row["tuned"], Mapping):
        return dict(row)

    def stop(name: str) -> dict[str, Any]:
        outcome = row["sampled_outcome" if name == "sampled" else "outcome"]
        kept = {"cycles": row["cycles"], "longest_cycle": row["longest_cycle"], "outcome": outcome}
        return {"distance": None, "published_quantity": row[name], **kept}

    return {
        "road": row["road"],
        "speed_kmh": row["speed_kmh"],
        "pedal_bar_s": None,
        "ideal": None,
        "published_ideal": row["ideal"],
        "published": row["published"],
        **{name: stop(name) for name in ("untuned", "tuned", "sampled")},
    }


def _has_ramp(config: Mapping[str, Any]) -> bool:
    places = (config.get("start"), config.get("limits"), config.get("tune"), *(config.get("known") or ()))
    return any(isinstance(place, Mapping | list | tuple) and RAMP in place for place in places)


def _without(values: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in values.items() if name != RAMP}


def _valid(controller: str, values: Mapping[str, float]) -> dict[str, float]:
    """Values within their bounds, those the controller demands an order of in order."""
    valid, kind = dict(values), CONTROLLERS.get(controller)
    if kind is None:
        return valid
    for name, bounds in bounds_of(kind).items():
        if name in valid and valid[name] > bounds.high:
            _say(name, valid[name], bounds.high)
            valid[name] = bounds.high
    for low, high, margin in kind.ordered:
        if low in valid and high in valid and valid[high] < valid[low] + margin:
            _say(high, valid[high], valid[low] + margin)
            valid[high] = valid[low] + margin
    return valid


def _say(name: str, was: float, now: float) -> None:
    warnings.warn(f"{name} = {was:g} is taken for {now:g}: it was not admissible", stacklevel=5)
