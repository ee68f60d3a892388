"""Tyre curves, one file each."""

from absjax.tyres.base import Tyre
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.exponential_basis import ExponentialBasis

TYRES: dict[str, type[Tyre]] = {
    "burckhardt": Burckhardt,
    "exponential_basis": ExponentialBasis,
}
"""By name."""
