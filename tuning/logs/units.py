"""Units in which logs may come, by the `pint` library, and how they are spelt in logs."""

import functools
import re
from typing import NamedTuple

from absjax.plant.wheel import GRAVITY

OWN = {
    "time": "s",
    "wheel_speed": "rad/s",
    "vehicle_speed": "m/s",
    "brake_pressure": "bar",
    "acceleration": "m/s^2",
    "force": "N",
    "load": "N",
}
"""The project's unit of each signal."""
EXAMPLES = {
    "time": "s, ms, us",
    "wheel_speed": "rad/s, rpm, deg/s, rev/s; km/h, m/s, mph of the rim; Hz of pulses; slip",
    "vehicle_speed": "m/s, km/h, mph",
    "brake_pressure": "bar, Pa, kPa, MPa, psi",
    "acceleration": "m/s^2, g",
    "force": "N, kN",
    "load": "N, kN, kg",
}
"""Of units, for messages."""
SPELT = {
    **dict.fromkeys(("kmh", "kph", "kmph", "km_h", "km/hr"), "km/hour"),
    **dict.fromkeys(("m_s", "mps", "meters/second", "metres/second"), "m/s"),
    **dict.fromkeys(("rad_s", "rads", "rps_rad"), "rad/s"),
    **dict.fromkeys(("rpm", "rev/min", "r/min", "u/min", "1/min", "/min", "min-1", "min^-1"), "revolution/min"),
    **dict.fromkeys(("rps", "r/s", "u/s", "rev/s"), "revolution/s"),
    **dict.fromkeys(("dps", "deg_s", "°/s", "deg/sec"), "degree/s"),
    **dict.fromkeys(("m_s2", "ms2", "ms^2", "mps2", "m/s2", "m/s²", "m/sec2", "m/s/s", "ms-2"), "m/s**2"),
    **dict.fromkeys(("g", "g0", "gn", "gee"), "g_here"),
    **dict.fromkeys(("sec", "secs", "seconds"), "s"),
    **dict.fromkeys(("msec", "millis"), "ms"),
    **dict.fromkeys(("usec", "micros", "µs", "μs"), "us"),
    **dict.fromkeys(("barg", "bar(g)"), "bar"),
    **dict.fromkeys(("kpa", "kpag", "kpa(g)"), "kPa"),
    **dict.fromkeys(("mpa", "mpag"), "MPa"),
    **dict.fromkeys(("pa",), "Pa"),
    **dict.fromkeys(("psig", "psi(g)"), "psi"),
    **dict.fromkeys(("n",), "N"),
    **dict.fromkeys(("kn",), "kN"),
    **dict.fromkeys(("lb", "lbs"), "lbf"),
    **dict.fromkeys(("kg", "kp"), "kg * g_here"),
}
"""Spellings that pint does not know or takes for something else, in small letters."""
PULSES = ("hz", "khz", "1/s", "pulses/s", "imp/s")
OTHERS = ("%", "-", "#", "°", "deg", "degc", "°c", "c", "°f", "bool", "count", "no unit", "none", "l", "1", "ratio")
"""What stands in a row of units besides units of the signals."""
UNSAFE = re.compile(r"\d\d|\d\s*(\*\*|\^)|[^\w/*^·²°() .+-]")
"""What no unit holds: numbers of two digits, powers of numbers, odd characters."""
SPEED, TURNS = "[length] / [time]", "1 / [time]"


class Unit(NamedTuple):
    """A unit of a signal."""

    text: str
    factor: float
    """to the project's unit, or of a kind"""
    kind: str = ""
    """'' of the signal itself; of wheel speed also 'rim' (m/s), 'pulses' (1/s), 'slip' (1)"""


@functools.cache
def _registry():
    import pint

    registry = pint.UnitRegistry(on_redefinition="ignore")
    registry.define(f"g_here = {GRAVITY} * m / s**2")
    return registry


@functools.cache
def _quantity(text: str):
    """One of a unit, or None if there is no such unit."""
    if not text or len(text) > 24 or UNSAFE.search(text):
        return None
    try:
        return _registry().Quantity(1.0, _registry().parse_units(text.replace("²", "**2").replace("·", "*")))
    except Exception:  # pint's parser raises what it stumbles over: any kind
        return None


@functools.cache
def unit_of(signal: str, text: str) -> Unit | None:
    """The unit of a signal that a text names; None if it names none."""
    text = text.strip().strip("[](){} ")
    small = text.lower().replace(" ", "")
    if signal == "wheel_speed":
        if small in PULSES:
            return Unit(text, 1e3 if small == "khz" else 1.0, "pulses")
        if small in ("slip", "slipratio"):
            return Unit(text, 1.0, "slip")
    if signal.endswith("speed") and small == "ms":
        small, text = "m/s", "m/s"
    spelt = SPELT.get(small)
    for candidate in (spelt, text) if spelt else (text, small):
        quantity = _quantity(candidate)
        if quantity is None:
            continue
        if quantity.check(_registry().parse_units(OWN[signal].replace("^", "**")).dimensionality):
            return Unit(text, float(quantity.to(OWN[signal].replace("^", "**")).magnitude))
        if signal == "wheel_speed" and quantity.check(SPEED):
            return Unit(text, float(quantity.to("m/s").magnitude), "rim")
    return None


@functools.cache
def is_unit(text: str) -> bool:
    """Whether a cell of a header is a unit, of a signal or of something else."""
    bare = text.strip().strip("[](){} ")
    return (
        bare.lower() in OTHERS
        or any(unit_of(signal, bare) is not None for signal in OWN)
        or (len(bare) <= 10 and _quantity(bare) is not None)
    )
