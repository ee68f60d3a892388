"""Tables of a tuning result."""

from typing import Any

from tuning.controllers.result import ResultRow, TuningResult
from tuning.controllers.stop_figures import StopFigures
from tuning.core.report import cell


def tuning_rows(result: TuningResult) -> list[dict[str, Any]]:
    """Distances from the pedal and their ideal; then the published quantity, which begins at the first switching."""
    began = result.config.began
    sampled = f"sampled {result.config.sampled_period * 1e3:g} ms"
    return [
        {
            **({"car": row.car} if row.car else {}),
            "km/h": row.speed_kmh,
            "road": row.road,
            "pedal [bar/s]": "-" if row.pedal_bar_s is None else f"{row.pedal_bar_s:.0f}",
            "ideal": cell(row.ideal),
            began: stop_cell(row.untuned),
            "tuned": stop_cell(row.tuned),
            sampled: stop_cell(row.sampled),
            "above ideal [%]": excess_cell(row),
            "onset [s]": cell(row.tuned.onset_s),
            "cycles": row.tuned.cycles,
            "lock > 15 km/h [s]": cell(row.sampled.lock_s_above_15, 3),
            "slide > 15 km/h [s]": cell(row.sampled.slide_s_above_15, 3),
            "quantity: published": cell(row.published),
            f"{began} quantity": cell(row.untuned.published_quantity),
            "tuned quantity": cell(row.tuned.published_quantity),
            "<= published": {True: "yes", False: "no", None: "-"}[row.reached],
        }
        for row in result.rows
    ]


def split_rows(result: TuningResult) -> list[dict[str, Any]]:
    """The sets in training, validation and test draws, above ideal."""

    def above(ratio: float | None) -> str:
        return "-" if ratio is None else f"{100 * (ratio - 1):.2f}"

    return [
        {
            "draws": row.split,
            "set": row.which if row.which == "tuned" else result.config.began,
            "stops": row.stops,
            "mean above ideal [%]": above(row.mean),
            "worst 5 % [%]": above(row.worst),
            "do not end": row.unfinished,
            "lock > 15 km/h": row.locked,
            "slide > 15 km/h": "-" if row.slid is None else row.slid,
            "stuck": row.stuck,
        }
        for row in result.splits
    ]


def stop_cell(figures: StopFigures) -> str:
    """A distance from the pedal, or how the stop failed to end."""
    return cell(figures.distance) if figures.outcome == "STOPPED" else figures.outcome.lower().replace("_", " ")


def excess_cell(row: ResultRow) -> str:
    """The worse of both semantics above the ideal [%]."""
    tuned, sampled = row.tuned.distance, row.sampled.distance
    if row.ideal is None or tuned is None or sampled is None:
        return "-"
    return f"{100 * (max(tuned, sampled) / row.ideal - 1):.2f}"


def parameter_line(result: TuningResult) -> str:
    """The tuned parameters on a line; those on a limit are marked."""
    marks = {name: "*" if name in result.on_limit else "" for name in result.parameters}
    return ", ".join(f"{name} {value:.4g}{marks[name]}" for name, value in result.parameters.items())


def cycles_line(result: TuningResult) -> str:
    """What is certified of the limit cycles, on a line."""
    if not result.cycles:
        return "limit cycles: none looked for" if result.config.vehicle is not None else "it does not cycle"
    attractive = [row for row in result.cycles if row.certified]
    line = f"limit cycles: {len(attractive)} of {len(result.cycles)} roads and speeds found and attractive"
    found = [(row.contraction, row) for row in result.cycles if row.contraction is not None]
    if found:
        contraction, worst = max(found, key=lambda pair: pair[0])
        line += f", largest contraction {contraction:.3g} ({worst.road}, {worst.speed_kmh:g} km/h)"
    return line.replace("_", " ")
