"""Observers and controllers under a load that changes: their gain a = R^2 Fz / J with it."""

import dataclasses
from typing import Any

from absjax.plant.wheel import Wheel


def at_load(component: Any, share: Any) -> Any:
    """A controller or observer on a wheel with `share` of its load: it has a method `at_load`, or a part `wheel`.

    One that has neither does not know the load.
    """
    own = getattr(component, "at_load", None)
    if own is not None:
        return own(share)
    wheel = getattr(component, "wheel", None)
    if not isinstance(wheel, Wheel):
        return component
    return dataclasses.replace(component, wheel=dataclasses.replace(wheel, load=share * wheel.load))
