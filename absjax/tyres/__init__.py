"""Tyre curves, one file each."""

from absjax.tyres.base import Tyre
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.exponential_basis import ExponentialBasis
from absjax.tyres.magic_formula import MagicFormula

TYRES: dict[str, type[Tyre]] = {
    "burckhardt": Burckhardt,
    "exponential_basis": ExponentialBasis,
    "magic_formula": MagicFormula,
}
"""By name."""
