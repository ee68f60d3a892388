"""`delay-study`: the delay of an input, what is predicted across it, and how much of it loops bear."""

from tuning.core.command import Force, Out, carry_out


def delay_study(out: Out, force: Force = False) -> None:
    """The predictor on chains and on the brake, delay margins, gains tuned by them; tables and figures."""

    def work():
        from tuning.delay.tasks import study

        return (), lambda: study(out)

    carry_out(out, work, force=force)
