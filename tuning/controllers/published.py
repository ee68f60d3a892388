"""Published braking distances and the settings they were made with.

Source: Aguado-Rojas 2019, Table 4.1; v0^2 / (2 g mean friction over the interval in which the
anti-lock system is active), in m.
"""

from typing import NamedTuple

SPEEDS_KMH = (60.0, 120.0, 180.0)


class Row(NamedTuple):
    """Published distances [m] on one road from one speed."""

    five_phase: float
    two_phase: float


DISTANCES: dict[str, dict[float, Row]] = {
    "dry_asphalt": {60.0: Row(12.31, 12.18), 120.0: Row(49.27, 48.78), 180.0: Row(110.87, 109.90)},
    "wet_asphalt": {60.0: Row(18.09, 17.86), 120.0: Row(72.38, 71.58), 180.0: Row(162.88, 161.37)},
    "dry_concrete": {60.0: Row(13.24, 13.08), 120.0: Row(52.97, 52.40), 180.0: Row(119.27, 118.10)},
    "dry_cobblestones": {60.0: Row(14.34, 14.28), 120.0: Row(57.34, 57.11), 180.0: Row(129.01, 128.51)},
    "wet_cobblestones": {60.0: Row(38.46, 38.30), 120.0: Row(153.88, 153.41), 180.0: Row(346.08, 345.57)},
}
"""By road, then by initial speed [km/h]."""

ROADS = tuple(DISTANCES)
