"""Whether a log goes with what a fit takes for true, in a word and in sentences."""

import numpy as np

from absjax.plant.wheel import GRAVITY
from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.quantities import departures
from tuning.road.conditions import Start, deceleration_of
from tuning.road.corrected import corrected
from tuning.road.fitted import Fitted
from tuning.road.samples import balanced_force
from tuning.road.sampling import interval_of

SOUND, DOUBTFUL, REFUTED = "sound", "doubtful", "refuted"
LARGEST_MISFIT, REFUTING_MISFIT = 1.6, 4.0
"""Residual over the channel's own noise from which a fit is doubtful, and refuted."""
FAST = 6e-3
"""Time between measurements [s] up to which a channel's own noise can be told from its course."""
TORQUE_SHARE = (0.75, 1.33)
"""Measured force over what brake torque and the wheel's inertia ask for: outside, one of them is wrong."""
BEYOND = 1.25
"""Peak friction over the strongest deceleration from which a vehicle is asked why it did not use it."""


def judged(log: BrakeLog, car: Car, start: Start, fitted: Fitted) -> tuple[str, list[str]]:
    """The verdict: 'sound', 'doubtful' or 'refuted', and why."""
    doubts = [*log.doubts, *departures(fitted.quantities, car.priors)]
    refutations = []
    for name, ratio in fitted.misfit.items():
        if interval_of(log, name) > FAST or ratio <= LARGEST_MISFIT:
            continue
        words = name.replace("_", " ")
        said = f"{words}: what the fit leaves of it is {ratio:.3g} times its own noise{_mended_by(name, fitted)}"
        (refutations if ratio > REFUTING_MISFIT else doubts).append(said)
    share = _force_over_torque(log, car, fitted)
    if share is not None and not TORQUE_SHARE[0] < share < TORQUE_SHARE[1]:
        refutations.append(
            f"the measured force is {share:.3g} times what brake pressure and wheel speed ask for"
            f"{' (force in kN?)' if abs(np.log10(max(share, 1e-9)) + 3) < 0.3 else ''}: "
            "force, pressure, brake efficiency or their zeros are wrong"
        )
    strongest = float(np.quantile(deceleration_of(log, car), 0.99)) / GRAVITY
    if fitted.imposed and fitted.method == "output error" and start.motion is not None:
        peak = max(stretch.peak_friction for stretch in fitted.stretches)
        if peak > BEYOND * strongest + 0.05:
            doubts.append(
                f"the curve reaches a friction of {peak:.3g}, yet the vehicle never decelerates by more than "
                f"{strongest:.3g} g: load or brake efficiency may be wrong"
            )
    if refutations:
        return REFUTED, [*refutations, *doubts]
    return (DOUBTFUL if doubts else SOUND), doubts


def _mended_by(name: str, fitted: Fitted) -> str:
    if name in ("acceleration", "vehicle_speed") and not fitted.imposed:
        return (
            "; the vehicle does not decelerate as this wheel's friction has it. Where the load changes while braking, "
            "the car file should give wheelbase, cg_height, cg_to_front and axle, or the log vertical_load_n"
        )
    if name == "wheel_speed":
        return "; pressure, load or inertia do not go with it"
    return ""


def _force_over_torque(log: BrakeLog, car: Car, fitted: Fitted) -> float | None:
    """Measured force over -(J w' + gamma_b Pb) / R, by least squares; None where one of them was not logged."""
    if log.force is None or log.brake_pressure is None:
        return None
    log, wheel = corrected(log, {name: q.value for name, q in fitted.quantities.items()}), car.wheel
    assert log.force is not None
    asked = balanced_force(log, wheel)
    return float(asked @ log.force / (asked @ asked)) if asked @ asked > 0 else None
