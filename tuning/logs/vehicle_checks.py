"""Signals of a car that contradict each other: what no sensor tells, what stands still, units, signs, order of wheels.

With v = R mean(w), filtered over half a second,

    ay ~ r v           w_i R - v ~ -r y_i           r ~ v delta / L

hold on any road as to their sign, and roughly as to their size. Three relations tell which of the signals is the odd
one out. A relation counts where the car turned enough for the correlation to be clear.
"""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from absjax.sideslip.car import Car
from tuning.logs.quality import runs_of
from tuning.logs.recording import LogError

LARGEST = {
    "longitudinal_acceleration": (20.0, "m/s^2", "another unit"),
    "lateral_acceleration": (20.0, "m/s^2", "another unit"),
    "yaw_rate": (3.5, "rad/s", "deg/s"),
    "steering_angle": (1.0, "rad", "degrees, or that of the steering wheel"),
    "wheel_speed": (400.0, "rad/s", "rpm, deg/s or km/h"),
}
"""Largest magnitude that is plausible, in which unit, and what a larger one suggests."""
SMOOTHED = 0.5
"""s"""
CLEAR = 0.5
"""Share of the variance from which a relation counts."""
TURNS = 0.015
"""Standard deviation of the yaw rate from which signs are checked [rad/s]."""
STUCK, STUCK_SAMPLES = 0.3, 20
"""Time and samples from which one and the same value of a noisy sensor is a defect."""
STANDS = 0.1
"""Share of its range by which a signal without noise should have moved while it stood still."""
WHEELS = ("fl", "fr", "rl", "rr")
SMALL_ANGLE = 0.12
"""Slope of r over v delta / L below which delta is in another unit: degrees give 1/57, a steering wheel 1/16."""
SMALL_ACCELERATION = 0.3
"""Slope of ay over r v below which ay is in another unit: g gives 1/9.81."""
VERY_CLEAR, LARGEST_SCALE = 0.97, 1.18
"""Share of the variance from which the scale of the wheel speeds is checked, and the largest that is taken."""
LEAST_SPREAD = 0.03
"""Slope of the difference of the axles over ax from which the driven one is told [s]."""
FEWEST_DRIVING = 100
"""Samples in which the car speeds up, for that."""
MOVING = 2.0
"""Mean speed below which nothing is checked [m/s]."""


def check_plausible(
    path: Path, names: Mapping[str, str], values: Mapping[str, np.ndarray], place: Callable[[str, int], str]
) -> None:
    """Refuse what no sensor of a car tells.

    Raises:
        LogError: naming file, column and row.
    """
    for signal, column in values.items():
        largest, unit, other = LARGEST["wheel_speed" if signal.startswith("wheel_speed") else signal]
        at = int(np.argmax(np.abs(column)))
        if abs(column[at]) > largest:
            raise LogError(
                f"{path}, column {names[signal]!r}, {place(signal, at)}: {column[at]:g} is not plausible for {signal} "
                f"in {unit}; is it in {other}? Declare it as {signal}={names[signal]}:UNIT"
            )


def check_stuck(
    path: Path, names: Mapping[str, str], time: np.ndarray, values: Mapping[str, np.ndarray], car: Car
) -> None:
    """Refuse a sensor that stands still while others say that it should not, or that drops out.

    Raises:
        LogError: naming file, column and time.
    """
    period = float(np.median(np.diff(time)))
    expected = _expected(values, car)
    for signal, column in values.items():
        runs = runs_of(column)
        steps = np.diff(column)
        moved = steps[steps != 0]
        noisy = moved.size > 50 and np.mean(moved[1:] * moved[:-1] < 0) > 0.4 and moved.size > 0.5 * steps.size
        usual = np.quantile(runs.length, 0.9)
        long = np.flatnonzero(runs.length >= max(STUCK_SAMPLES, STUCK / period, 10 * usual if noisy else 0))
        for i in long:
            a, b = int(runs.first[i]), int(runs.first[i] + runs.length[i])
            other = expected.get(signal)
            moves = 0.0 if other is None else np.ptp(other[0][a:b]) / max(np.ptp(other[0]), 1e-9)
            if (noisy and not _parked(values, a, b)) or (moved.size and moves > max(STANDS, 3 / np.sqrt(b - a))):
                against = "; elsewhere its noise moves it" if noisy else f", while {other[1]} moves" if other else ""
                raise LogError(
                    f"{path}, column {names[signal]!r}: stuck at {column[a]:g} for {(b - a) * period:.3g} s from "
                    f"{time[a]:g} s on{against}"
                )


def _parked(values: Mapping[str, np.ndarray], a: int, b: int) -> bool:
    """Whether all wheels stand still."""
    return all(not np.any(values[f"wheel_speed_{wheel}"][a:b]) for wheel in WHEELS)


def _expected(values: Mapping[str, np.ndarray], car: Car) -> dict[str, tuple[np.ndarray, str]]:
    """What others say of a signal, and which they are."""
    wheels = np.stack([values[f"wheel_speed_{wheel}"] for wheel in WHEELS], axis=1)
    v = np.median(wheels, axis=1) * car.radius
    found = {
        "steering_angle": (values["yaw_rate"] * (car.to_front + car.to_rear) / np.maximum(v, 1.0), "the yaw rate"),
        "yaw_rate": (values["lateral_acceleration"] / np.maximum(v, 1.0), "the lateral acceleration"),
        "lateral_acceleration": (values["yaw_rate"] * v, "the yaw rate"),
    }
    for i, wheel in enumerate(WHEELS):
        found[f"wheel_speed_{wheel}"] = (np.median(np.delete(wheels, i, axis=1), axis=1), "that of the other wheels")
    return found


def check_contradictions(
    path: Path, names: Mapping[str, str], time: np.ndarray, values: Mapping[str, np.ndarray], car: Car
) -> list[str]:
    """Refuse units, signs and orders of wheels that contradict the rest.

    Returns:
        What could not be checked.

    Raises:
        LogError: naming file and columns, and what contradicts what.
    """
    width = max(1, round(SMOOTHED / float(np.median(np.diff(time)))))
    smooth = {signal: _smoothed(column, width) for signal, column in values.items()}
    rims = np.stack([smooth[f"wheel_speed_{wheel}"] for wheel in WHEELS], axis=1) * float(car.radius)
    v, r = rims.mean(axis=1), smooth["yaw_rate"]
    if v.mean() < -MOVING:
        raise LogError(f"{path}: the wheel speeds are negative in the mean; forward is positive")
    if v.mean() < MOVING:
        return [f"the car hardly moves ({v.mean():.2g} m/s in the mean): signs and units are not checked"]
    _check_dropped(path, names, time, values, car)
    if np.std(r) < TURNS:
        return [f"the car hardly turns ({np.std(r):.2g} rad/s): signs, units and order of wheels are not checked"]
    left, steer = np.asarray(car.left), smooth["steering_angle"] * v / float(car.to_front + car.to_rear)
    sides = [_relation(rims[:, i] - v, -r * left[i], v) for i in range(4)]
    ay, gentle = _relation(smooth["lateral_acceleration"], r * v), _gentle(smooth["lateral_acceleration"])
    steering = max(_relation(r[gentle], steer[gentle]), _relation(r, steer), key=lambda relation: relation[1])
    _check_signs(path, names, ay, steering, sides)
    _check_sizes(path, names, ay, steering)
    rear = _relation(rims[:, 3] - rims[:, 2], r * float(car.track_rear), v)
    if rear[1] > VERY_CLEAR and not 1 / LARGEST_SCALE < rear[0] < LARGEST_SCALE:
        raise LogError(
            f"{path}, columns {_shown(names, WHEELS[2:])}: they differ {rear[0]:.3g} times as much as yaw rate, track "
            "and wheel radius say; is a unit wrong (km/h, rpm, deg/s), or the radius of the car?"
        )
    told = {
        "the sign of the lateral acceleration": ay[1],
        "the sign of the steering angle": steering[1],
        "which wheels are in front": _check_axles(path, names, smooth, rims, car),
    }
    return [
        f"not checked, since the log does not tell it clearly: {what}" for what, share in told.items() if share < CLEAR
    ]


def _gentle(acceleration: np.ndarray) -> np.ndarray:
    """Where the tyres are far from their limit, if this is the largest the road allows."""
    return np.abs(acceleration) < 0.5 * np.abs(acceleration).max()


def _shown(names: Mapping[str, str], wheels) -> str:
    return ", ".join(repr(names[f"wheel_speed_{wheel}"]) for wheel in wheels)


def _smoothed(values: np.ndarray, width: int) -> np.ndarray:
    return np.convolve(values, np.ones(width) / width, "valid")


def _relation(told: np.ndarray, by: np.ndarray, *beside: np.ndarray) -> tuple[float, float]:
    """Slope of a signal over another, and the share of the variance that the other explains beyond those beside."""
    others = np.stack([np.ones_like(by), *beside], axis=1)
    rest = [x - others @ np.linalg.lstsq(others, x, rcond=None)[0] for x in (told, by)]
    power = float(rest[1] @ rest[1])
    if power == 0 or not np.any(rest[0]):
        return 0.0, 0.0
    slope = float(rest[0] @ rest[1]) / power
    return slope, float(slope**2 * power / (rest[0] @ rest[0]))


def _sign(relation: tuple[float, float]) -> int:
    slope, share = relation
    return 0 if share < CLEAR else int(np.sign(slope))


def _check_dropped(path: Path, names, time, values, car: Car) -> None:
    """Refuse a wheel that stands from one sample to the next and turns again as suddenly."""
    for wheel in WHEELS:
        signal = f"wheel_speed_{wheel}"
        column = values[signal]
        runs = runs_of(column)
        for a, n in zip(runs.first, runs.length):
            if column[a] == 0 and a > 0 and column[a - 1] * float(car.radius) > MOVING:
                raise LogError(
                    f"{path}, column {names[signal]!r}: drops from {column[a - 1]:g} to 0 rad/s at {time[a]:g} s, "
                    f"for {n * np.median(np.diff(time)):.3g} s; no wheel stops in a sample"
                )


def _check_signs(path: Path, names, ay, steering, sides) -> None:
    wrong = [wheel for wheel, side in zip(WHEELS, sides) if _sign(side) < 0]
    right = [wheel for wheel, side in zip(WHEELS, sides) if _sign(side) > 0]
    turned = {"lateral_acceleration": _sign(ay) < 0, "steering_angle": _sign(steering) < 0}
    if wrong and right:
        raise LogError(
            f"{path}, columns {_shown(names, wrong)}: by the yaw rate they are not on the side their names say; are "
            "the wheels in another order? Front left, front right, rear left, rear right are expected"
        )
    against = [signal for signal, is_turned in turned.items() if is_turned]
    if wrong:
        against.append("wheel speeds")
    if not against:
        return
    known = [
        signal for signal, relation in (("lateral_acceleration", ay), ("steering_angle", steering)) if _sign(relation)
    ]
    everything = len(against) == len(known) + bool(wrong or right)
    if everything and len(against) > 1:
        raise LogError(
            f"{path}, column {names['yaw_rate']!r}: its sign contradicts {', '.join(against)}, which agree with each "
            "other; positive is to the left"
        )
    if against == ["wheel speeds"]:
        raise LogError(
            f"{path}, columns {_shown(names, WHEELS)}: left and right contradict the yaw rate; they are exchanged, or "
            "yaw rate, lateral acceleration and steering angle are positive to the right. Positive is to the left"
        )
    if len(against) == 1:
        rest = "the yaw rate" + (", the wheel speeds" if right else "")
        raise LogError(f"{path}, column {names[against[0]]!r}: its sign contradicts {rest}; positive is to the left")
    raise LogError(
        f"{path}: the signs of {', '.join(against)} contradict that of column {names['yaw_rate']!r}; "
        "positive is to the left"
    )


def _check_sizes(path: Path, names, ay, steering) -> None:
    if _sign(steering) > 0 and steering[0] < SMALL_ANGLE:
        raise LogError(
            f"{path}, column {names['steering_angle']!r}: {1 / steering[0]:.3g} times what the yaw rate says; is it in "
            "degrees, or that of the steering wheel? The angle at the road wheels in rad is expected"
        )
    if _sign(ay) > 0 and not SMALL_ACCELERATION < ay[0] < 1 / SMALL_ACCELERATION:
        raise LogError(
            f"{path}, columns {names['lateral_acceleration']!r} and {names['yaw_rate']!r}: ay over r v is {ay[0]:.3g}, "
            "near 1 is expected; is one of them in another unit (g, deg/s)?"
        )


def _check_axles(path: Path, names, smooth, rims, car: Car) -> float:
    """The driven axle is the faster one while the car speeds up. Returns how clearly the log tells it, 0 to 1."""
    ax, turning = smooth["longitudinal_acceleration"], smooth["yaw_rate"] * smooth["steering_angle"]
    drives, axle = ax > 0.3, float(car.driven_front) - float(car.driven_rear)
    if drives.sum() < FEWEST_DRIVING or axle == 0:
        return 0.0
    ahead = (rims[:, 0] + rims[:, 1] - rims[:, 2] - rims[:, 3]) / 2
    slope, share = _relation(ahead[drives], ax[drives], turning[drives], rims.mean(axis=1)[drives])
    if share > CLEAR and slope * axle < -LEAST_SPREAD:
        driven, other = ("front", "rear") if axle > 0 else ("rear", "front")
        raise LogError(
            f"{path}, columns {_shown(names, WHEELS)}: the {other} wheels turn faster while the car speeds up, but its "
            f"{driven} wheels are driven; are the wheels in another order, or is `driven` of the car wrong?"
        )
    return share
