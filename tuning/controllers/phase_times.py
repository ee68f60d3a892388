"""How long the phases of a controller last, from the switchings of stops."""

from collections.abc import Mapping

import numpy as np

from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.stop import Stop, stop
from absjax.loop.vehicle_loop import VehicleLoop
from tuning.controllers.batch import Batch
from tuning.controllers.loops import with_parameters
from tuning.controllers.setup import Setup


def phase_times(loop: ClosedLoop | VehicleLoop, stops: Stop, channel: int = 0) -> dict[int, np.ndarray]:
    """Durations [s] of every visit to every phase but the driver's and the last; switchings must have been saved.

    Of a vehicle those of one channel.
    """
    log = stops.rollout.log
    times, sources, targets = (np.atleast_2d(np.asarray(x)) for x in log)
    found: dict[int, list[float]] = {}

    def phases(modes):
        return np.asarray(loop.phase(modes) if isinstance(loop, ClosedLoop) else loop.phases(modes)[channel])

    for time, source, target in zip(times, phases(sources), phases(targets)):
        entered, inside = 0.0, 0
        for at, before, after in zip(time, source, target):
            if before < 0:
                break
            if before == after:
                continue
            if inside:
                found.setdefault(inside, []).append(at - entered)
            entered, inside = at, int(after)
    return {phase: np.array(values) for phase, values in sorted(found.items())}


def short_phases(setup: Setup, batch: Batch, parameters: Mapping[str, float]) -> list[str]:
    """A sentence for every phase of a set that lasts less than a tick of the control unit in the mean, located."""
    loop = with_parameters(batch.loop, parameters)
    stops = stop(
        loop,
        batch.speed,
        horizon=batch.horizon,
        step=batch.step,
        max_events=batch.max_events,
        save_switches=True,
    )
    said, period = [], setup.config.sampled_period
    channels = [""] if isinstance(loop, ClosedLoop) else [f"{name}, " for name in loop.names]
    for channel, name in enumerate(channels):
        for phase, lasted in phase_times(loop, stops, channel).items():
            if phase > 0 and lasted.mean() < period:
                said.append(
                    f"{name}phase {phase} ({setup.kind.phases[phase]}) lasts {1e3 * lasted.mean():.2g} ms in the mean, "
                    f"less than a tick of {1e3 * period:g} ms"
                )
    return said
