"""`describe`: what a brake log holds, and what looks wrong with it."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, carry_out
from tuning.logs.about import DESCRIBE

Columns = Annotated[
    str | None,
    typer.Option(help='SIGNAL=COLUMN[:UNIT], comma-separated, where they differ; names with , or : as "NAME".'),
]
Channels = Annotated[
    Path | None, typer.Option(help="TOML of the signals: column, unit, sign, delay, offset, factor, teeth.")
]


def describe(
    log: Annotated[Path, typer.Argument(help="Brake log: CSV, Parquet, MATLAB or MDF.")],
    out: Out,
    columns: Columns = None,
    channels: Channels = None,
    car: Annotated[Path | None, typer.Option(help="JSON with the radius; for speeds of the rim.")] = None,
    start: Annotated[float | None, typer.Option("--from", help="Use the log from this time on [s].")] = None,
    end: Annotated[float | None, typer.Option("--to", help="Use the log up to this time [s].")] = None,
    force: Force = False,
) -> None:
    """What a brake log holds and what looks wrong with it: channels, units, rates, gaps; result.json and a figure.

    The car is found as by identify; only its radius is used.
    """

    def work():
        from tuning.logs.car import car_of
        from tuning.logs.describe import described

        given = car_of(log, car)
        return (log, given, channels), lambda: described(log, out, columns, channels, given, start, end)

    carry_out(out, work, about=DESCRIBE, force=force)
