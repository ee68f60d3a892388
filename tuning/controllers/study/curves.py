"""The curves the controllers work on: friction and XBS against slip, and the real branches of Lambert's W.

Source: Aguado-Rojas 2019, Figs 2.1, 2.3, 2.4 and B.1, Table 2.1; Hoang 2014 (thesis), Fig. 1.4.
"""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.special import lambertw

from absjax.controllers._lambert import BRANCH_POINT, lambert_w0
from absjax.tyres.surfaces import SURFACES

TYPICAL = "dry_asphalt"
SLIP = np.linspace(-1.0, 1.0, 2001)
LOSS = (0.2, 0.3)
"""What the source says a locked wheel loses of the largest force."""


def rows() -> list[dict[str, Any]]:
    """Peak of each published surface, what a locked wheel loses, and the range of XBS."""
    table = []
    for name, surface in SURFACES.items():
        peak = surface.peak()
        locked = float(surface.friction(1.0))
        inner = float(peak.slip) < 1.0
        table.append(
            {
                "road": name,
                "peak slip": round(float(peak.slip), 4) if inner else "none",
                "peak friction": round(float(peak.friction), 4),
                "lost by a locked wheel [%]": round(100 * (1 - locked / float(peak.friction)), 1),
                "XBS, rolling": round(float(surface.stiffness(0.0)), 2),
                "XBS, locked": round(float(surface.stiffness(1.0)), 3),
            }
        )
    return table


def figure():
    """Friction and XBS of one road, regions told apart, and friction of all ([A] Figs 2.1, 2.3, 2.4; [H] Fig. 1.4)."""
    drawn, (left, middle, right) = plt.subplots(1, 3, figsize=(15, 4.4), layout="constrained")
    road = SURFACES[TYPICAL]
    peak = road.peak()
    slip = float(peak.slip)
    for axes, values, name in (
        (left, road.friction(SLIP), "friction μ"),
        (middle, road.stiffness(SLIP), "XBS = dμ/dλ"),
    ):
        axes.plot(SLIP, values, "C0")
        axes.axvspan(-slip, slip, color="C2", alpha=0.12, label="stable")
        axes.axvspan(-1, -slip, color="C3", alpha=0.08, label="unstable")
        axes.axvspan(slip, 1, color="C3", alpha=0.08)
        axes.axhline(0, color="k", lw=0.5)
        axes.set(xlabel="slip λ: braking, driving", ylabel=name, title=TYPICAL.replace("_", " "), xlim=(-1, 1))
    left.plot([-slip, slip], [-float(peak.friction), float(peak.friction)], "ko", ms=4, label="± λ*")
    middle.plot([-slip, slip], [0, 0], "ko", ms=4, label="XBS = 0 at ± λ*")
    middle.set_ylim(-2, 12)
    braking = SLIP[SLIP >= 0]
    for i, (name, surface) in enumerate(SURFACES.items()):
        right.plot(braking, surface.friction(braking), color=f"C{i}", label=name.replace("_", " "))
        best = surface.peak()
        if float(best.slip) < 1.0:
            right.plot(float(best.slip), float(best.friction), "o", color=f"C{i}", ms=4)
    right.set(xlabel="slip λ, drawn positive", ylabel="friction μ", title="published surfaces, and their peaks")
    for axes in (left, middle, right):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="small")
    return drawn


def lambert_figure():
    """Real branches of Lambert's W, and ours on the branch the Poincare map is made of ([A] Fig. B.1)."""
    drawn, axes = plt.subplots(figsize=(6.5, 4.5), layout="constrained")
    wide, narrow = np.linspace(BRANCH_POINT, 3.0, 2000), BRANCH_POINT * np.geomspace(1.0, 1e-3, 2000)
    axes.plot(wide, np.real(lambertw(wide, 0)), "C0", label="W0, principal branch")
    axes.plot(narrow, np.real(lambertw(narrow, -1)), "C0--", label="W-1")
    ours = np.linspace(BRANCH_POINT, 0.0, 15)
    axes.plot(ours, np.asarray(lambert_w0(ours)), "C3.", label="ours, on [-1/e, 0]")
    axes.plot(BRANCH_POINT, -1.0, "ko", ms=4, label="branch point")
    axes.set(xlabel="x", ylabel="W(x)", xlim=(-0.6, 3.0), ylim=(-5.0, 1.5))
    axes.axhline(0, color="k", lw=0.5)
    axes.axvline(0, color="k", lw=0.5)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return drawn
