"""`encoder`, `tune-encoder`, `encoder-study`: wheel speed from edges, its compensation tuned, and studied."""

from pathlib import Path
from typing import Annotated

import typer

from tuning.core.command import Force, Out, Resume, carry_out, tune


def encoder(
    log: Annotated[Path, typer.Argument(help="Edge times of an encoder, CSV with a header, a row an edge.")],
    out: Out,
    teeth: Annotated[int, typer.Option(help="Teeth (pulses in a revolution).")] = 60,
    clock: Annotated[float, typer.Option(help="Length of a clock tick [s].")] = 1e-6,
    column: Annotated[str, typer.Option(help="Column with the edge times, integer ticks.")] = "edge_tick",
    period: Annotated[float, typer.Option(help="Sampling period of the control unit [s].")] = 1e-3,
    events: Annotated[int, typer.Option(help="Edges in the fit, n.")] = 15,
    harmonics: Annotated[int | None, typer.Option(help="Harmonics compensated, M; all if missing.")] = None,
    chain: Annotated[Path | None, typer.Option(help="A result of tune-encoder; overrides n and M.")] = None,
    force: Force = False,
) -> None:
    """Wheel speed and acceleration from edge times, the encoder's errors taken off: CSV, result.json and figures."""

    def work():
        from tuning.encoder.tasks import chain_for, study_edges
        from tuning.logs.edges import read_edges

        data = read_edges(log, teeth=teeth, clock=clock, column=column)
        wanted = chain_for(data, events, harmonics, chain)
        return (log, chain), lambda: study_edges(data, out, wanted, period)

    carry_out(out, work, force=force)


def tune_encoder(
    out: Out,
    config: Annotated[
        Path | None, typer.Option(help="JSON, see `tuning.encoder.config.EncoderConfig`; or a result to go on from.")
    ] = None,
    resume: Resume = False,
    force: Force = False,
) -> None:
    """The compensation of encoder errors, on simulated encoders: result.json and figures."""

    def load():
        from tuning.encoder import tasks
        from tuning.encoder.config import EncoderConfig

        return EncoderConfig, lambda wanted: lambda progress, journal: tasks.tune(wanted, out, progress, journal)

    tune("tune-encoder", out, config, load, resume=resume, force=force)


def encoder_study(
    out: Out,
    encoders: Annotated[int, typer.Option(min=1, help="Encoders in the loop.")] = 20,
    hours: Annotated[float, typer.Option(min=0.001, help="Length of the endurance run.")] = 1.0,
    force: Force = False,
) -> None:
    """The published table, other encoders, endurance, and the chain in the loop; tables and figures."""

    def work():
        from tuning.encoder.tasks import study

        return (), lambda: study(out, encoders, hours)

    carry_out(out, work, force=force)
