"""Figures as files, and bars with an end."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.container import BarContainer


def bars_up_to(highest: float, axes, at: np.ndarray, values: Sequence[float], width: float, **style) -> BarContainer:
    """Bars in whose place there is one that ends at `highest`, with its value in it, where they are higher; none where
    a value is nan."""
    bars = axes.bar(at, np.minimum(np.nan_to_num(values), highest), width, **style)
    for bar, value in zip(bars, values):
        if value > highest:
            middle = bar.get_x() + 0.5 * bar.get_width()
            axes.text(middle, highest, f"{value:.0f} ", rotation=90, ha="center", va="top", fontsize=6, color="w")
    return bars


def save(figure, path: Path) -> Path:
    """Write a figure and release it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)
    return path
