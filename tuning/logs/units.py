"""Units in which logs may come, and the factor to the unit this project uses."""

FACTORS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "wheel_speed": {"rad/s": 1.0, "rpm": 0.10471975511965977, "deg/s": 0.017453292519943295},
    "vehicle_speed": {"m/s": 1.0, "km/h": 1 / 3.6, "mph": 0.44704},
    "brake_pressure": {"bar": 1.0, "Pa": 1e-5, "kPa": 1e-2, "MPa": 10.0, "psi": 0.0689475729},
    "acceleration": {"m/s2": 1.0, "g": 9.81},
    "force": {"N": 1.0, "kN": 1e3},
    "load": {"N": 1.0, "kN": 1e3},
}
"""By signal, then by unit; the first unit of each is the project's own."""


def is_unit(text: str) -> bool:
    """Whether a cell of a header is a unit."""
    return any(text in units for units in FACTORS.values())
