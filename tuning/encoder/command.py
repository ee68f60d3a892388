"""`encoder`, `tune-encoder`, `encoder-study`: wheel speed from edges, its compensation tuned, and studied."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from tuning.core.command import Force, Out, Resume, carry_out, tune
from tuning.encoder.about import ENCODER, ENCODER_STUDY, TUNE_ENCODER

Kind = Literal["ticks", "seconds", "periods", "levels"]


def encoder(
    log: Annotated[Path, typer.Argument(help="Edges of an encoder: CSV, Parquet, MATLAB or MDF; a row an edge.")],
    out: Out,
    teeth: Annotated[int, typer.Option(help="Teeth of the wheel, missing ones counted.")] = 60,
    clock: Annotated[
        float | None, typer.Option(help="Length of a clock tick [s]; as the file says it, or 1 us, if missing.")
    ] = None,
    column: Annotated[str | None, typer.Option(help="Column with the edges; known by its name if missing.")] = None,
    kind: Annotated[
        Kind | None, typer.Option(help="What it holds: ticks, seconds, periods, levels; recognised if missing.")
    ] = None,
    both: Annotated[
        bool | None, typer.Option("--both/--one", help="Both edges of a tooth, or one; recognised if missing.")
    ] = None,
    period: Annotated[float, typer.Option(help="Sampling period of the control unit [s].")] = 1e-3,
    events: Annotated[int, typer.Option(help="Edges in the fit, n.")] = 15,
    harmonics: Annotated[int | None, typer.Option(help="Harmonics compensated, M; all if missing.")] = None,
    chain: Annotated[Path | None, typer.Option(help="A result of tune-encoder; overrides n and M.")] = None,
    force: Force = False,
) -> None:
    """Wheel speed and acceleration from edge times, the encoder's errors taken off: CSV, result.json and figures."""

    def work():
        from tuning.encoder.tasks import chain_for, study_edges
        from tuning.logs.edge_speed import study_of
        from tuning.logs.edges import read_edges

        data = read_edges(log, teeth=teeth, clock=clock, column=column, kind=kind)
        edges = study_of(data, period=period, both=both)
        wanted = chain_for(edges.filled, events, harmonics, chain)
        return (log, chain), lambda: study_edges(edges, out, wanted, period)

    carry_out(out, work, about=ENCODER, force=force)


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

    tune("tune-encoder", out, config, load, about=TUNE_ENCODER, resume=resume, force=force)


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

    carry_out(out, work, about=ENCODER_STUDY, force=force)
