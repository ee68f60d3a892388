"""The command line: identify a road; tune anti-lock control, observers, the encoder chain, side-slip and speed."""

import contextlib
import os
import sys

import typer

from tuning.controllers import command as controllers
from tuning.core.call import ToldCommand
from tuning.delay import command as delay
from tuning.encoder import command as encoder
from tuning.logs import command as logs
from tuning.observers import command as observers
from tuning.road import command as road
from tuning.sideslip import command as sideslip
from tuning.speed import command as speed
from tuning.vehicle import command as vehicle
from tuning.vehicle.regulation import command as screening

# Without markup: help and errors show units and names in brackets as they are.
app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    help=__doc__,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
COMMANDS = {
    "describe": logs.describe,
    "identify": road.identify,
    "tune-abs": controllers.tune_abs,
    "abs-sets": controllers.abs_sets,
    "abs-study": controllers.abs_study,
    "gradient-study": controllers.gradient_study,
    "setting-study": controllers.setting_study,
    "tune-observer": observers.tune_observer,
    "observer-study": observers.observer_study,
    "encoder": encoder.encoder,
    "tune-encoder": encoder.tune_encoder,
    "encoder-study": encoder.encoder_study,
    "side-slip": sideslip.side_slip,
    "tune-side-slip": sideslip.tune_side_slip,
    "side-slip-study": sideslip.side_slip_study,
    "speed-study": speed.speed_study,
    "vehicle-study": vehicle.vehicle_study,
    "split-mu": vehicle.split_mu,
    "drive-log": vehicle.drive_log,
    "delay-study": delay.delay_study,
    "regulation": screening.regulation,
    "regulation-study": screening.regulation_study,
    "demo": controllers.demo,
}
"""By name, in the order of the help."""
for _name, _command in COMMANDS.items():
    app.command(_name, cls=ToldCommand)(_command)


@app.callback()
def _setup() -> None:
    """Double precision, every core a device, wide vectors, figures without a screen, compiled programs kept, and
    components of the folder one is in."""
    import jax
    import matplotlib

    from absjax.vectors import prefer_wide_vectors

    prefer_wide_vectors()
    matplotlib.use("Agg")
    jax.config.update("jax_enable_x64", True)
    with contextlib.suppress(RuntimeError):
        jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))
    from tuning.core.compilation import keep_compiled, tell_of_compilations
    from tuning.core.terminal import say

    keep_compiled()
    tell_of_compilations(say)
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
