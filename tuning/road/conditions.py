"""What a log says before any curve is fitted: whether it brakes, how the load goes, what a rolling wheel tells."""

import dataclasses
from collections.abc import Mapping

import numpy as np

from absjax.plant.wheel import GRAVITY, Wheel
from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.quantities import Prior
from tuning.logs.tables import LogError
from tuning.road.noise import noise_of
from tuning.road.output_error import lagged
from tuning.road.samples import is_rig, rate_of
from tuning.road.sampling import interval_of, measured
from tuning.road.vehicle_speed import SIGNIFICANT, SLOW, Motion, motion_of

LEAST_DECELERATION = 0.7
"""m/s^2; less is not braking"""
LEAST_SLIP = 0.01
LEAST_RANGE = 0.03
"""Of slip, when nobody says how fast the vehicle slows down."""
ROLLING = 0.4
"""Deceleration below which a wheel counts as rolling freely [m/s^2]."""
FEWEST_ROLLING = 20
RISEN, LEAST_SPREAD = 5.0, 0.02
"""Noises from which a pressure has risen; standard deviation of its zero before it has, at the least [bar]."""
CALM = 0.1
"""Window over which a deceleration counts [s]."""
LOAD_LAG = 0.03
"""Where the search for the lag of a load begins that nobody says is moved at once [s]."""
BRAKE_RANGE = (0.1, 100.0)
"""Brake efficiency that is believed, over the known one: a unit of pressure may be another."""
REFRESHED = 0.02
"""Time between samples of a speed that comes from the acceleration [s]."""
CHANGING_LOAD = 0.03


@dataclasses.dataclass(frozen=True)
class Start:
    """A log made ready for fitting, and where the fit begins."""

    log: BrakeLog
    """with the vehicle's speed advanced by the delay found, or taken from the acceleration where it is slow"""
    share: np.ndarray | None
    """load over that of the wheel, (samples,), where the vehicle's speed is imposed"""
    transferred: bool
    """whether that is reckoned from the acceleration; it then may lag behind it"""
    values: dict[str, float]
    """what quantities are about"""
    rest: Prior | None
    """zero of the pressure, as it is before anybody brakes"""
    motion: Motion | None
    slow: bool
    """whether the vehicle's speed was taken from the acceleration"""
    notes: list[str]

    def load_behind(self, lag: float) -> np.ndarray | None:
        """`share` with a lag [s], where it may lag."""
        return self.share if self.share is None or not self.transferred else lagged(self.share, self.log.period, lag)

    def wheel(self, car: Car) -> Wheel:
        """The car's wheel with the radius found."""
        return dataclasses.replace(car.wheel, radius=self.values["radius"])


def deceleration_of(log: BrakeLog, car: Car) -> np.ndarray:
    """Deceleration by the tyres over `CALM`, in m/s^2, (samples,), positive while braking.

    The bias of the accelerometer is taken out, or the slope of the road, as the car file has it.
    """
    if log.acceleration is not None:
        width = max(1, round(CALM / log.period))
        padded = np.pad(_felt(log, car), (width // 2, width - 1 - width // 2), mode="edge")
        return -np.convolve(padded, np.ones(width) / width, "valid")
    return GRAVITY * car.priors["slope"].value - rate_of(log, log.vehicle_speed, smoothing=3 * CALM)


def _felt(log: BrakeLog, car: Car) -> np.ndarray:
    """The measured acceleration without the bias that the car file states."""
    assert log.acceleration is not None
    return log.acceleration - car.priors["acceleration_bias"].value


def require_braking(log: BrakeLog, car: Car) -> None:
    """Check that somebody brakes.

    Raises:
        LogError: if neither deceleration nor slip is that of braking.
    """
    ratio = float(car.wheel.radius) * log.wheel_speed / log.vehicle_speed - 1
    slip = float(np.quantile(ratio, 0.995) - np.quantile(ratio, 0.005))
    largest = float(np.quantile(np.abs(ratio), 0.999))
    strongest = float(np.quantile(deceleration_of(log, car), 0.99))
    rolls = slip < LEAST_RANGE and (is_rig(log) or strongest < LEAST_DECELERATION)
    weak = strongest < LEAST_DECELERATION and not (is_rig(log) and slip >= LEAST_RANGE)
    if rolls or weak or largest < LEAST_SLIP:
        pressed = (
            "" if log.brake_pressure is None else f", pressure at most {np.quantile(log.brake_pressure, 0.99):.3g} bar"
        )
        raise LogError(
            f"{log.name}: the log holds no braking to identify a road from: deceleration at most "
            f"{strongest:.2g} m/s^2, slip within {slip:.3f}{pressed}"
        )


def load_share(log: BrakeLog, car: Car) -> tuple[np.ndarray | None, bool]:
    """Load over that of the wheel at rest, (samples,), and whether it is reckoned from the acceleration, without lag.

    None where nothing says that it changes.
    """
    if log.load is not None and (
        np.ptp(log.load) > CHANGING_LOAD * np.mean(log.load) or is_rig(log) or log.force is not None
    ):
        return log.load / float(car.wheel.load), False
    if car.axle is not None:
        felt = rate_of(log, log.vehicle_speed) if log.acceleration is None else _felt(log, car)
        return car.axle.load_share(felt), True
    return (np.ones(len(log.time)) if is_rig(log) else None), False


def begin(log: BrakeLog, car: Car) -> Start:
    """Delay and course of the vehicle's speed, and radius and pressure zero while the wheel rolls freely."""
    notes, values = [], {name: prior.value for name, prior in car.priors.items()}
    motion = None if is_rig(log) else motion_of(log, car)
    slow = motion is not None and interval_of(log, "vehicle_speed") > SLOW
    delay = values["speed_delay"]
    if motion is not None:
        late = abs(motion.delay) > max(SIGNIFICANT * motion.delay_spread, 2 * log.period)
        delay = motion.delay if late or slow or "speed_delay" in car.stated else delay
    if slow and motion is not None:
        values["speed_delay"] = delay
        at = np.zeros(len(log.time), bool)
        at[:: max(1, round(REFRESHED / log.period))] = True
        log = _with_speed(log, motion.speed, at)
        notes.append("the vehicle's speed between its measurements comes from the acceleration")
    else:
        shift = round(delay / log.period)
        values["speed_delay"], log = shift * log.period, _advanced(log, shift)
    rolling = np.abs(deceleration_of(log, car)) < ROLLING
    rolling &= np.cumsum(~rolling) == 0
    if rolling.sum() >= FEWEST_ROLLING and not is_rig(log):
        free_rolling = {"radius": float(np.median(log.vehicle_speed[rolling] / log.wheel_speed[rolling]))}
        if log.brake_pressure is not None:
            free_rolling["pressure_zero"] = float(np.median(log.brake_pressure[rolling]))
        values |= _uncertain(free_rolling, car)
    rest = None
    if rolling.sum() >= FEWEST_ROLLING and log.brake_pressure is not None and not is_rig(log):
        rest = _at_rest(
            log,
            dataclasses.replace(car, wheel=dataclasses.replace(car.wheel, radius=values["radius"])),
            rolling,
            motion,
        )
    share, transferred = load_share(log, car)
    if not transferred:
        values["load_lag"] = 0.0
    elif car.priors["load_lag"].spread > 0 and values["load_lag"] == 0:
        values["load_lag"] = LOAD_LAG
    if share is None and log.acceleration is not None and log.brake_pressure is not None:
        wheel = dataclasses.replace(car.wheel, radius=values["radius"])
        values |= _uncertain(_brake(log, wheel, _felt(log, car)), car)
    return Start(log, share, transferred, values, rest, motion, slow, notes)


def _uncertain(values: Mapping[str, float], car: Car) -> dict[str, float]:
    """Those of some values that the car file does not have for certain."""
    return {name: value for name, value in values.items() if car.priors[name].spread > 0}


def _at_rest(log: BrakeLog, car: Car, rolling: np.ndarray, motion: Motion | None) -> Prior | None:
    """Zero of the pressure by the samples before it rises: P + R Fz a / (g gamma_b), a bias of a not known."""
    assert log.brake_pressure is not None
    pressure, level = log.brake_pressure, noise_of(log, "brake_pressure", rolling)
    risen = np.abs(pressure - np.median(pressure[rolling][:FEWEST_ROLLING])) > RISEN * level
    before = rolling & (np.cumsum(risen) == 0)
    if before.sum() < FEWEST_ROLLING:
        return None
    rate, wheel = -deceleration_of(log, car) if log.acceleration is None else _felt(log, car), car.wheel
    bias = ROLLING / 2 if motion is None else float(np.hypot(*motion.bias))
    per_acceleration = float(wheel.radius * wheel.load / (GRAVITY * wheel.brake_efficiency))
    zeros = pressure[before] + per_acceleration * rate[before]
    spread = np.hypot(np.std(zeros) / np.sqrt(before.sum()), per_acceleration * bias)
    return Prior(float(np.mean(zeros)), float(np.hypot(spread, LEAST_SPREAD)), False)


def _brake(log: BrakeLog, wheel: Wheel, felt: np.ndarray) -> dict[str, float]:
    """About what brake efficiency and pressure zero are: J w' + R Fz a / g = -gamma_b (P - P_0), by least squares."""
    assert log.brake_pressure is not None
    friction = float(wheel.radius) * float(wheel.load) * felt / GRAVITY
    torque = -(float(wheel.inertia) * rate_of(log, log.wheel_speed) + friction)
    columns = np.stack([log.brake_pressure, np.ones(len(log.time))], axis=1)
    efficiency, offset = np.linalg.lstsq(columns, torque, rcond=None)[0]
    low, high = (factor * float(wheel.brake_efficiency) for factor in BRAKE_RANGE)
    if not low < efficiency < high:
        return {}
    return {"brake_efficiency": float(efficiency), "pressure_zero": float(-offset / efficiency)}


def _advanced(log: BrakeLog, shift: int) -> BrakeLog:
    """The vehicle's speed earlier by some samples; what it has not told, at an end, is not measured."""
    if shift == 0:
        return log
    at = np.roll(measured(log, "vehicle_speed"), -shift)
    at[len(at) - max(shift, 0) :] = False
    at[: max(-shift, 0)] = False
    moved = np.clip(np.arange(len(at)) + shift, 0, len(at) - 1)
    return _with_speed(log, log.vehicle_speed[moved], at)


def _with_speed(log: BrakeLog, speed: np.ndarray, at: np.ndarray) -> BrakeLog:
    speed = np.maximum(speed, 0.1)
    return dataclasses.replace(log, vehicle_speed=speed, measured={**log.measured, "vehicle_speed": at})
