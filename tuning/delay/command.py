"""`delay-study`: the delay of an input, what is predicted across it, and how much of it loops bear."""

from typing import Annotated

import typer

from tuning.core.command import Force, Out, carry_out
from tuning.delay.about import DELAY_STUDY


def delay_study(
    out: Out,
    retune: Annotated[bool, typer.Option(help="Make the tuned sets anew instead of taking the shipped ones.")] = False,
    force: Force = False,
) -> None:
    """The predictor on chains and on the brake, delay margins, gains tuned by them; tables and figures."""

    def work():
        from tuning.delay.tasks import study

        return (), lambda: study(out, retune)

    carry_out(out, work, about=DELAY_STUDY, force=force)
