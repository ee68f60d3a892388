"""What a brake log holds, in words, numbers and a figure."""

from pathlib import Path
from typing import Any

import numpy as np

from tuning.core.figures import save
from tuning.core.report import Report
from tuning.core.version import VERSION
from tuning.logs.brake_log import Reading, reading
from tuning.logs.car import Car, read_car
from tuning.logs.channel_map import declarations
from tuning.logs.figures import description_figure
from tuning.logs.grid import timing_of
from tuning.logs.units import OWN


def described(
    log: Path,
    out: Path,
    columns: str | None = None,
    channels: Path | None = None,
    car: Path | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Report:
    """Report of what a log holds.

    Raises:
        LogError: if the log cannot be used, or a declaration.
    """
    known = Car() if car is None else read_car(car)
    radius = float(known.wheel.radius)
    found = reading(log, declarations(columns, channels), start=start, end=end, radius=radius, stated=known.stated)
    result = description(found)
    files = [save(description_figure(found), out / "description.png")]
    results = {out / "result.json": {**result, "version": VERSION}}
    lines = [f"{name}: column {source.channel.name!r} in {source.unit.text}" for name, source in found.sources.items()]
    lines += found.log.notes
    verdict, tables = "doubtful" if found.log.doubts else "nothing looks wrong", _rows(result["signals"])
    title, reasons = f"signals: {found.log.name}", found.log.doubts
    return Report({title: tables}, lines, files, verdict=verdict, reasons=reasons, results=results)


def description(found: Reading) -> dict[str, Any]:
    """What a log holds, as a plain dictionary; of each signal in the project's unit."""
    log = found.log
    signals = {}
    for signal, quality in zip(found.signals, found.qualities):
        source, name = found.sources[signal.name], signal.name
        timing = timing_of(signal.time[quality.taken])
        values = getattr(log, name)
        signals[name] = {
            "column": source.channel.name,
            "column_unit": source.unit.text,
            "unit": OWN[name],
            "samples": int(signal.time.size),
            "rate": 1 / timing.period,
            "jitter": timing.jitter,
            "least": float(values.min()),
            "median": float(np.median(values)),
            "largest": float(values.max()),
            "resolution": quality.resolution,
            "held": quality.held,
            "measured": float(log.measured[name].mean()),
            "clipped": list(quality.clipped),
            "stuck": [[float(signal.time[a]), float(signal.time[b])] for a, b in quality.stuck],
            "spikes": [float(t) for t in signal.time[quality.spikes]],
        }
    return {
        "log": log.name,
        "start": float(log.time[0]),
        "end": float(log.time[-1]),
        "step": log.period,
        "signals": signals,
        "notes": list(log.notes),
        "doubts": list(log.doubts),
    }


def _rows(signals: dict[str, Any]) -> list[dict[str, Any]]:
    return [
        {
            "signal": name,
            "unit": told["unit"],
            "samples": told["samples"],
            "rate [Hz]": round(told["rate"], 1),
            "least": f"{told['least']:.4g}",
            "median": f"{told['median']:.4g}",
            "largest": f"{told['largest']:.4g}",
            "step": f"{told['resolution']:.3g}" if told["resolution"] else "in the noise",
            "measured": f"{told['measured']:.1%}",
        }
        for name, told in signals.items()
    ]
