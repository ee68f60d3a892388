"""The published surfaces."""

from absjax.tyres.burckhardt import Burckhardt

SURFACES: dict[str, Burckhardt] = {
    "dry_asphalt": Burckhardt(1.2801, 23.99, 0.52),
    "wet_asphalt": Burckhardt(0.857, 33.822, 0.347),
    "dry_concrete": Burckhardt(1.1973, 25.168, 0.5373),
    "dry_cobblestones": Burckhardt(1.3713, 6.4565, 0.6691),
    "wet_cobblestones": Burckhardt(0.4004, 33.708, 0.1204),
    "snow": Burckhardt(0.1946, 94.129, 0.0646),
    "ice": Burckhardt(0.05, 306.39, 0.0),
}
"""Burckhardt coefficients by surface. Source: Aguado-Rojas 2019, Table 2.1."""


def surface(name: str) -> Burckhardt:
    """The published surface `name`.

    Raises:
        ValueError: if there is none; lists those there are.
    """
    if name not in SURFACES:
        raise ValueError(f"surface {name!r} is unknown; there are {', '.join(SURFACES)}")
    return SURFACES[name]
