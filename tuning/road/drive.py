"""The road from the log of a drive, braking by braking."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tuning.core.report import Report
from tuning.core.version import VERSION
from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.recording import LogError
from tuning.road.figures import identification_figures
from tuning.road.fitted import Say
from tuning.road.identify import Identification, identify
from tuning.road.report import identification_rows, quantity_rows, told_lines
from tuning.road.verdict import DOUBTFUL, REFUTED, SOUND


class Braking(NamedTuple):
    """What a braking of a drive says."""

    number: int
    """from 1 on"""
    log: BrakeLog
    result: Identification


def identify_brakings(
    logs: Sequence[BrakeLog | LogError], car: Car, kind: str, *, progress: Say
) -> tuple[list[Braking], dict[int, str]]:
    """Identify each braking by itself.

    Args:
        logs: as `tuning.logs.brake_log.read_brakings` gives them.
        car: what is known of it.
        kind: of the tyre curve.
        progress: called with a line of text as the work goes on.

    Returns:
        Those that tell a road, and by number why the others do not.

    Raises:
        LogError: if none does.
    """
    found, refused = [], {}
    for number, log in enumerate(logs, 1):
        try:
            if isinstance(log, LogError):
                raise log
            progress(f"braking {number}, {log.time[0]:.2f} to {log.time[-1]:.2f} s")
            found.append(Braking(number, log, identify(log, car, kind, progress=progress)))
        except LogError as error:
            refused[number] = str(error)
    if not found:
        raise LogError(f"{len(logs)} brakings, and none tells a road; {refused[1]}")
    return found, refused


def drive_report(found: Sequence[Braking], refused: dict[int, str], car: Car, out: Path) -> Report:
    """One table of all brakings; figures of each in a folder of its own."""
    files, rows, quantities, lines, reasons = [], [], [], [], []
    for number, log, result in found:
        where = {"braking": str(number)}
        rows += [{**where, **row, "verdict": result.verdict} for row in identification_rows(result)]
        quantities += [where | row for row in quantity_rows(result)]
        lines += [f"braking {number}: {said}" for said in told_lines(result) if said not in log.notes]
        reasons += [f"braking {number}: {said}" for said in result.reasons]
        folder = out / f"braking_{number}"
        folder.mkdir(parents=True, exist_ok=True)
        shown = f"{log.name}, braking {number}, {log.time[0]:.2f} to {log.time[-1]:.2f} s"
        files += identification_figures(result, log, car, folder, shown)
    name = found[0].log.name
    tables = {f"the road's friction curve, +- 95 %: {name}": rows}
    if quantities:
        tables["the car's own quantities, +- 95 %"] = quantities
    told = {"log": name, "brakings": {number: result.to_json() for number, _, result in found}, "refused": refused}
    words = {result.verdict for _, _, result in found}
    verdict = next(word for word in (REFUTED, DOUBTFUL, SOUND) if word in words)
    lines = [*dict.fromkeys(note for braking in found for note in braking.log.notes), *lines]
    lines += [f"braking {number} tells no road: {why}" for number, why in refused.items()]
    results = {out / "result.json": {**told, "version": VERSION}}
    return Report(tables, lines, files, verdict=verdict, reasons=reasons, results=results)
