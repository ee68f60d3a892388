"""Figures as files."""

from pathlib import Path

import matplotlib.pyplot as plt


def save(figure, path: Path) -> Path:
    """Write a figure and release it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=130, bbox_inches="tight")
    plt.close(figure)
    return path
