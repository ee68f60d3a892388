"""Sets by what they were tuned for, each judged in every setting; and scattered stops through the chain.

The settings: switchings located on the truth; sampled at 1 and at 5 ms on the truth; sampled at 1 ms, told by the
encoder chain, its harmonics learned before the pedal. Rows are roads and speeds as they are, drawn for the phase of
the clock and the encoder alone, from draws no set was tuned on; scattered ones have everything drawn.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
from matplotlib.lines import Line2D

from tuning.controllers.config import Scatter, TuningConfig
from tuning.controllers.published import ROADS, SPEEDS_KMH
from tuning.controllers.recipes import running_sets, tuned_sets
from tuning.controllers.scatter import SPLITS, Split, scattered
from tuning.controllers.setup import Setup
from tuning.controllers.splits import SplitFigures, figures_of
from tuning.controllers.study.distances import NAMES
from tuning.core.components import initial

CHAIN = "settled"
ONLY_ENCODERS: dict[str, float] = {name: 0.0 for name in Scatter._fields if name != "tolerance"}
"""What is scattered of the rows as they are."""
LEVELS = (2, 3, 5, 10, 20, 50)
"""Above ideal, on the axis of the figure, %."""


class Where(NamedTuple):
    """A setting that sets are judged in."""

    label: str
    setting: str
    period: float = 1e-3
    located: bool = False

    def of(self, config: TuningConfig, **other: Any) -> Setup:
        """The setup of a configuration in it."""
        entries = {"setting": self.setting, "sampled_period": self.period, "chain": CHAIN, **other}
        return Setup.of(dataclasses.replace(config, largest_contraction=None, **entries))


SETTINGS = (
    Where("located", "sampled", located=True),
    Where("1 ms", "sampled"),
    Where("5 ms", "sampled", 5e-3),
    Where("chain", "chain"),
)


class Judged(NamedTuple):
    """A set in a setting."""

    controller: str
    tuned_for: str
    setting: str
    figures: SplitFigures


def controllers() -> tuple[str, ...]:
    """Those with sets tuned for where they run."""
    return tuple(dict.fromkeys(config.controller for config in running_sets()))


def contestants(controller: str) -> dict[str, dict[str, float]]:
    """Sets of a controller by what they were tuned for, untuned first."""
    truth = tuned_sets()[controller]
    sets: dict[str, dict[str, float]] = {"untuned": initial(truth.kind, {}), "truth": dict(truth.start)}
    for config in running_sets():
        if config.controller == controller:
            label = "chain" if config.setting == "chain" else f"{1e3 * config.sampled_period:g} ms"
            sets[label] = dict(config.start)
    return sets


def completed(setup: Setup, sets: Mapping[str, Mapping[str, float]]) -> dict[str, dict[str, float]]:
    """Sets with the same parameters each: those of the chain as by default where a set has none, left out where it is
    not told by one."""
    return {
        label: {name: values.get(name, own) for name, own in setup.initial.items()} for label, values in sets.items()
    }


def judged(
    controller: str,
    sets: Mapping[str, Mapping[str, float]],
    draws: int,
    *,
    speeds_kmh: tuple[float, ...] = SPEEDS_KMH,
    roads: tuple[Any, ...] = ROADS,
    stop_speed_kmh: float = 15.0,
    settings: tuple[Where, ...] = SETTINGS,
) -> Iterator[Judged]:
    """Sets of one controller on the rows as they are, in every setting; `draws` of clock and encoder for each row."""
    config = dataclasses.replace(
        tuned_sets()[controller],
        roads=roads,
        speeds_kmh=speeds_kmh,
        stop_speed_kmh=stop_speed_kmh,
        checked=draws,
        start={},
        conditions=ONLY_ENCODERS,
    )
    for where in settings:
        setup = where.of(config)
        grid = (None, 0) if where.located else setup.sampled_grid()
        for figures in figures_of(scattered(setup, "test"), "test", completed(setup, sets), grid):
            yield Judged(controller, figures.which, where.label, figures)


def table(found: list[Judged]) -> list[dict[str, Any]]:
    """A row for each set, a column for each setting: mean and worst twentieth above ideal."""
    rows = []
    for controller, tuned_for in dict.fromkeys((one.controller, one.tuned_for) for one in found):
        mine = {one.setting: one.figures for one in found if (one.controller, one.tuned_for) == (controller, tuned_for)}
        row = {"controller": NAMES[controller], "tuned for": tuned_for}
        rows.append(row | {setting: cell(figures) for setting, figures in mine.items()})
    return rows


def cell(figures: SplitFigures) -> str:
    """Mean and worst twentieth above ideal [%], and what must not be, where it is."""
    if figures.mean is None or figures.worst is None:
        return "none ends"
    failed = [
        f"{count} {what}"
        for count, what in (
            (figures.unfinished, "do not end"),
            (figures.locked, "lock"),
            (figures.slid, "slide"),
            (figures.stuck, "stick"),
        )
        if count
    ]
    shown = f"{100 * (figures.mean - 1):.2f}, {100 * (figures.worst - 1):.2f}"
    return shown + (f" ({', '.join(failed)})" if failed else "")


def scattered_stops(
    controller: str, sets: Mapping[str, Mapping[str, float]], stops: int, splits: tuple[Split, ...] = SPLITS
) -> Iterator[SplitFigures]:
    """Sets of one controller through the chain, in the conditions its set for the chain was tuned in.

    Args:
        stops: in the test draws, about; training and validation are those of the tuning.
    """
    config = next(c for c in running_sets() if c.controller == controller and c.setting == "chain")
    rows = len(config.roads) * len(config.speeds_kmh)
    for split in splits:
        checked = max(1, stops // rows) if split == "test" else config.checked
        setup = Setup.of(dataclasses.replace(config, start={}, checked=checked))
        yield from figures_of(scattered(setup, split), split, completed(setup, sets), setup.sampled_grid())


def scattered_rows(controller: str, found: Iterator[SplitFigures]) -> list[dict[str, Any]]:
    """A row for each set and split."""
    return [
        {
            "controller": NAMES[controller],
            "tuned for": figures.which,
            "draws": figures.split,
            "stops": figures.stops,
            "mean above ideal [%]": above(figures.mean),
            "worst 5 % [%]": above(figures.worst),
            "do not end": figures.unfinished,
            "lock > 15 km/h": figures.locked,
            "slide > 15 km/h": figures.slid,
            "stuck": figures.stuck,
        }
        for figures in found
    ]


def above(ratio: float | None) -> str:
    """A ratio above ideal [%]."""
    return "-" if ratio is None else f"{100 * (ratio - 1):.2f}"


def figure(found: list[Judged]):
    """Mean above ideal of every set, a panel for each setting; hollow where stops fail, lock or stick."""
    names = list(dict.fromkeys(one.controller for one in found))
    drawn, axes = plt.subplots(1, len(SETTINGS), figsize=(11, 3.4), sharey=True, layout="constrained")
    for panel, where in zip(axes, SETTINGS):
        for i, tuned_for in enumerate(dict.fromkeys(one.tuned_for for one in found)):
            mine = [one for one in found if (one.tuned_for, one.setting) == (tuned_for, where.label)]
            mine = [one for one in mine if one.figures.mean is not None]
            x = [names.index(one.controller) + 0.12 * (i - 2) for one in mine]
            y = [100 * (one.figures.mean - 1) for one in mine if one.figures.mean is not None]
            fine = [one.figures.feasible for one in mine]
            colour = f"C{i}"
            faces = [colour if good else "white" for good in fine]
            panel.scatter(x, y, c=faces, edgecolors=colour, s=30, label=tuned_for)
        panel.set_title(f"judged: {where.label}")
        panel.set_xticks(range(len(names)), [NAMES[name] for name in names])
        panel.set_yscale("log")
        panel.set_yticks(LEVELS, [f"{level:g}" for level in LEVELS])
        panel.minorticks_off()
        panel.grid(axis="y", alpha=0.3)
    axes[0].set_ylabel("mean above ideal [%]")
    handles = [Line2D([], [], marker="o", ls="", color=f"C{i}") for i in range(5)]
    labels = list(dict.fromkeys(one.tuned_for for one in found))
    drawn.legend(handles[: len(labels)], labels, title="tuned for", loc="outside right upper")
    return drawn
