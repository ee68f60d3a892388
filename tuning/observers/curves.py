"""The curves behind the observers: Burckhardt's, and the basis of two fixed exponentials of the 4-state one.

Source: Hoang et al. 2014, eq. 18, Table I and Fig. 1; Hoang 2014 (thesis), Fig. 5.1.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.exponential_basis import ExponentialBasis, fit_exponential_basis
from absjax.tyres.surfaces import SURFACES

PUBLISHED: dict[str, tuple[Burckhardt, tuple[float, float, float]]] = {
    "dry": (Burckhardt(1.28, 24.0, 0.52), (-0.527, 25.222, 7.204)),
    "wet": (Burckhardt(0.857, 34.0, 0.35), (-0.360, 8.858, 24.000)),
    "snow": (Burckhardt(0.28, 50.0, 0.05), (-0.050, 0.241, 14.006)),
}
"""Roads of Table I with th0, th1 and th2 as printed; wet is fitted with c1 = 0.857, which the table rounds to 0.86."""
BEYOND = ("dry_cobblestones", "snow", "ice")
"""Published surfaces whose c2 does not lie between the rates of the basis."""
SLIP = -np.linspace(0.0, 1.0, 401)
FITTED = -np.linspace(0.0, 1.0, 101)
"""Slips of the least squares that give the printed coefficients."""


def _pairs():
    yield from ((name, road, printed) for name, (road, printed) in PUBLISHED.items())
    yield from ((f"{name}, [A] Table 2.1", SURFACES[name], None) for name in BEYOND)


def basis_of(road: Burckhardt) -> ExponentialBasis:
    """The basis fitted to a road."""
    return fit_exponential_basis(FITTED, road.friction(FITTED))


def rows() -> list[dict[str, Any]]:
    """Coefficients as fitted beside the printed ones, and by how much the curves differ."""
    table = []
    for label, road, printed in _pairs():
        basis = basis_of(road)
        fitted = [float(x) for x in (basis.theta0, basis.theta1, basis.theta2)]
        off = np.abs(np.asarray(basis.friction(SLIP) - road.friction(SLIP))).max()
        xbs = np.abs(np.asarray(basis.stiffness(SLIP) - road.stiffness(SLIP)))
        table.append(
            {
                "road": label,
                "c2": float(road.c2),
                **{f"th{i}": round(value, 3) for i, value in enumerate(fitted)},
                "off the printed": "-" if printed is None else f"{np.abs(np.subtract(fitted, printed)).max():.4f}",
                "largest difference of mu": round(float(off), 4),
                "of XBS, beyond 2 % of slip": round(float(xbs[np.abs(SLIP) > 0.02].max()), 3),
            }
        )
    return table


def figure():
    """Friction and XBS against slip: Burckhardt's curve and the basis, drawn for slips of positive sign."""
    drawn, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.4), layout="constrained")
    pairs = list(_pairs())
    for i, (label, road, printed) in enumerate(pairs):
        basis = basis_of(road)
        axes = left if printed is not None else middle
        for axis, name, sign in ((axes, "friction", -1), (right, "stiffness", 1)):
            if axis is right and printed is None:
                continue
            axis.plot(-SLIP, sign * np.asarray(getattr(road, name)(SLIP)), f"C{i}", lw=1.1, label=label)
            axis.plot(-SLIP, sign * np.asarray(getattr(basis, name)(SLIP)), "k--", lw=0.9)
    left.set(ylabel="friction μ", title="Table I: c2 between the rates 22 and 52")
    middle.set(title="c2 outside them")
    right.set(ylabel="XBS", xlim=(0, 0.3), ylim=(-2, 15), title="XBS of Table I's roads")
    for axes in (left, middle, right):
        axes.set(xlabel="slip λ, drawn positive")
        axes.grid(alpha=0.3)
    for axes in (left, middle):
        axes.plot([], [], "k--", lw=0.9, label="exponential basis")
        axes.legend(fontsize="small")
    return drawn
