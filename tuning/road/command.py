"""`identify`: the road's friction curve from a brake log."""

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from tuning.core.command import Force, Out, carry_out, say
from tuning.core.terminal import say_step
from tuning.logs.command import Channels, Columns
from tuning.road.about import IDENTIFY


def identify(
    log: Annotated[Path, typer.Argument(help="Brake log: CSV, Parquet, MATLAB or MDF.")],
    out: Out,
    columns: Columns = None,
    channels: Channels = None,
    car: Annotated[Path | None, typer.Option(help="JSON with inertia, radius, load, brake_efficiency.")] = None,
    load: Annotated[float | None, typer.Option(help="Vertical load on the wheel [N]; overrides the car.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Use the log from this time on [s].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Use the log up to this time [s].")] = None,
    tyre: Annotated[
        str, typer.Option(help="Tyre curve: burckhardt, exponential_basis, or module:Class.")
    ] = "burckhardt",
    beside: Annotated[
        list[Path] | None, typer.Option("--with", help="Another log of the same car; what it says of the car counts.")
    ] = None,
    edges: Annotated[Path | None, typer.Option(help="Edges of the wheel, for its speed; as `encoder` takes.")] = None,
    teeth: Annotated[int, typer.Option(help="Teeth of the wheel, missing ones counted; of --edges.")] = 60,
    clock: Annotated[float | None, typer.Option(help="Length of a clock tick of --edges [s].")] = None,
    force: Force = False,
) -> None:
    """The road's friction curve from a brake log: result.json and figures.

    Without --car, a JSON file of the log's name beside it is taken for the car if there is one, and the
    default wheel if not.
    """

    def work():
        from tuning.logs.car import car_of
        from tuning.logs.edge_speed import study_of
        from tuning.logs.edges import read_edges

        given = car_of(log, car)
        wheel = None if edges is None else study_of(read_edges(edges, teeth=teeth, clock=clock))
        others = beside or []
        return (log, given, channels, edges, *others), lambda: identified(
            log, out, columns, given, load, start, end, tyre, channels=channels, edges=wheel, beside=others
        )

    carry_out(out, work, about=IDENTIFY, force=force)


def identified(
    log,
    out,
    columns=None,
    car=None,
    load=None,
    start=None,
    end=None,
    tyre="burckhardt",
    *,
    channels=None,
    edges=None,
    beside=(),
) -> Any:
    """Report of the friction curve of a log."""
    from tuning.core.report import Report
    from tuning.logs.brake_log import read_brakings, read_log
    from tuning.logs.car import Car, read_car
    from tuning.logs.channel_map import declarations
    from tuning.logs.recording import LogError
    from tuning.road.drive import drive_report, identify_brakings
    from tuning.road.figures import identification_figures
    from tuning.road.identify import identify
    from tuning.road.report import identification_rows, quantity_rows, told_lines
    from tuning.road.together import identify_together

    known = Car() if car is None else read_car(car)
    if load is not None:
        known = dataclasses.replace(known, wheel=dataclasses.replace(known.wheel, load=load))
    wheel = known.wheel
    say(f"car: {car or 'default wheel'}, load {float(wheel.load):g} N, radius {float(wheel.radius):g} m")
    radius = float(wheel.radius)
    declared, stated = declarations(columns, channels), known.stated
    logs = read_brakings(log, declared, start=start, end=end, radius=radius, stated=stated, edges=edges)
    others = [read_log(path, declared, radius=radius, stated=stated) for path in beside]

    if len(logs) > 1:
        if others:
            raise LogError(f"{log}: {len(logs)} brakings; with other logs beside, choose one by --from and --to")
        found, refused = identify_brakings(logs, known, tyre, progress=say_step)
        return drive_report(found, refused, known, out)
    (data,) = logs
    if isinstance(data, LogError):
        raise data
    if others:
        result = identify_together([data, *others], known, tyre, progress=say_step)[0]
    else:
        result = identify(data, known, tyre, progress=say_step)
    files = identification_figures(result, data, known, out)
    title = f"the road's friction curve, +- 95 %: {result.log}"
    tables = {title: identification_rows(result)}
    if result.quantities:
        tables["the car's own quantities, +- 95 %"] = quantity_rows(result)
    results = {out / "result.json": result.to_json()}
    return Report(tables, told_lines(result), files, verdict=result.verdict, reasons=result.reasons, results=results)
