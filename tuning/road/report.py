"""Tables of an identified road."""

from typing import Any

from tuning.logs.quantities import Z95
from tuning.road.identify import PEAK, Identification


def identification_rows(result: Identification) -> list[dict[str, Any]]:
    """One row per surface: coefficients, peak, 95 % half-widths; ? marks what the log does not tell."""
    rows = []
    for segment in result.segments:
        values = {**segment.parameters, **{name: getattr(segment, name) for name in PEAK}}
        cells = {
            name: f"{value:.4g} ± {value - segment.ci95[name][0]:.2g}" + ("" if segment.identifiable[name] else " ?")
            for name, value in values.items()
        }
        rows.append(
            {"from [s]": f"{segment.start:.3f}", "to [s]": f"{segment.end:.3f}", **cells, "method": segment.method}
        )
    return rows


def told_lines(result: Identification) -> list[str]:
    """What was done with the log, and what each surface does not tell."""
    return [
        *result.notes,
        *(f"{segment.start:.3f} s: {said}" for segment in result.segments for said in segment.statements),
    ]


def quantity_rows(result: Identification) -> list[dict[str, Any]]:
    """One row per quantity of the car that was estimated: what it was known as, and what the log has."""
    return [
        {
            "quantity": name.replace("_", " "),
            "known as": f"{found.given:.4g}",
            "the log has": f"{found.value:.4g} ± {Z95 * found.spread:.2g}",
            "unit": found.unit,
        }
        for name, found in result.quantities.items()
    ]
