"""A car driven by the wheel speeds and the steering of a log: does its body follow the logged yaw rate and side-slip?

One number is fitted, the friction over that of the tyre's curve, by Gauss-Newton steps on what every car measures: yaw
rate and lateral acceleration. The truth of a log is for judging only.
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from absjax.hybrid.rollout import rollout
from absjax.lanes import stacked
from absjax.plant.base import Road
from absjax.plant.driven import DrivenCar, ScaledRoad
from absjax.plant.four_wheel import FourWheel
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.sideslip.accelerometer import BodyAccelerometer
from absjax.sideslip.car import Car
from absjax.tyres.base import Tyre
from absjax.tyres.exponential_basis import ExponentialBasis
from absjax.tyres.magic_formula import MagicFormula
from absjax.tyres.surfaces import SURFACES
from tuning.logs.vehicle_log import VehicleLog

SETTLE = 1.0
"""Errors count from here on [s]."""
SUBSTEPS = 2
"""Grid steps a sample."""
STARTS = (1.6, 1.2, 0.9, 0.7, 0.55, 0.44, 0.35, 0.28, 0.2, 0.15)
"""Peak friction among which the fit begins where the misfit is least: one that spins on its way has other minima."""
STEPS, SHORTEST = 8, 1e-3
"""Of Gauss and Newton, at most, and as short as the last may be."""
LONGEST = 0.3
"""Longest step, of the logarithm of the scale."""
YAW_RATE, ACCELERATION = 0.01, 0.3
"""Errors that weigh alike: rad/s, and m/s^2, the roll of the body taken off."""
TYRES: dict[str, Tyre] = {
    "Burckhardt, dry": SURFACES["dry_asphalt"],
    "Burckhardt, wet": SURFACES["wet_asphalt"],
    "Burckhardt, snow": SURFACES["snow"],
    "exponential basis, dry": ExponentialBasis(-0.527, 25.222, 7.204),
    "Magic Formula, dry": MagicFormula(10.0, 1.65, 1.0, 0.6),
    "Magic Formula, soft": MagicFormula(6.0, 1.4, 1.0, 0.3),
}
"""Curves whose height is fitted."""
ROLL_SPLIT, RELAXATION = 0.55, 0.25


class Variant(NamedTuple):
    """A car to drive."""

    tyre: str
    """in `TYRES`"""
    relaxation: float | None = RELAXATION
    roll_split: float = ROLL_SPLIT

    @property
    def title(self) -> str:
        """For tables."""
        length = 0.0 if self.relaxation is None else self.relaxation
        return f"{self.tyre}, sigma {length:g} m, roll split {self.roll_split:g}"


VARIANTS = (
    *(Variant(tyre) for tyre in TYRES),
    Variant("Burckhardt, dry", None),
    Variant("Burckhardt, dry", 0.5),
    Variant("Burckhardt, dry", RELAXATION, 0.4),
    Variant("Burckhardt, dry", RELAXATION, 0.7),
)


class Motion(NamedTuple):
    """Of a driven car, arrays (..., samples)."""

    longitudinal: Any
    """vx [m/s]"""
    lateral: Any
    """vy [m/s]"""
    yaw_rate: Any
    """r [rad/s]"""
    lateral_acceleration: Any
    """m/s^2"""

    @property
    def side_slip(self):
        """-atan2(vy, vx), in the sign of the logs [rad]."""
        return -np.arctan2(self.lateral, self.longitudinal)


@dataclasses.dataclass(frozen=True)
class Drive:
    """A variant driven through a log."""

    variant: Variant
    friction: float
    """fitted peak friction"""
    cost: float
    """mean square of the errors against what was measured, each over the one that weighs alike"""
    motion: Motion

    def errors(self, log: VehicleLog) -> dict[str, float]:
        """Against the truth, from `SETTLE` on; empty where the log has none."""
        if not {"longitudinal_speed", "lateral_speed", "yaw_rate"} <= set(log.truth):
            return {}
        counts = slice(round(SETTLE / log.period), None)
        slip = np.degrees(self.motion.side_slip - log.true_side_slip)[counts]
        return {
            "yaw rate rms [rad/s]": _rms((self.motion.yaw_rate - log.truth["yaw_rate"])[counts]),
            "side-slip rms [deg]": _rms(slip),
            "side-slip, largest [deg]": float(np.abs(slip).max()),
            "vx rms [m/s]": _rms((self.motion.longitudinal - log.truth["longitudinal_speed"])[counts]),
        }


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def car_on(road: Road, car: Car, variant: Variant) -> FourWheel:
    """The four-wheel car of a description; the inertia of its wheels has no part in the drive."""
    wheel = Wheel(radius=float(car.radius))
    base = car.to_front + car.to_rear
    return FourWheel(
        (road,) * 4,
        (wheel,) * 4,
        car.mass,
        car.yaw_inertia,
        base,
        car.to_front,
        car.track_front,
        car.track_rear,
        car.height,
        variant.roll_split,
        variant.relaxation,
    )


def _driven(driven: DrivenCar, start, samples: int) -> Motion:
    state = driven.initial_state(start[0] + 0.0 * driven.car.mass, 0.0, start[1])
    step = driven.period / SUBSTEPS
    path = rollout(driven, state, step=step, steps=(samples - 1) * SUBSTEPS, save_every=SUBSTEPS).path
    motion = path.state.motion
    sideways = jnp.gradient(motion.lateral, axis=-1) / driven.period
    acceleration = sideways + motion.yaw_rate * motion.longitudinal
    return Motion(motion.longitudinal, motion.lateral, motion.yaw_rate, acceleration)


@partial(jax.jit, static_argnums=4)
def _at(scale, driven: DrivenCar, start, measured, settled: int):
    """Motion at the logarithms of the scales (lanes,), the cost, and the Gauss-Newton step."""

    def misses(scale):
        road = ScaledRoad(driven.car.roads[0], jnp.exp(scale))
        moved = dataclasses.replace(driven, car=dataclasses.replace(driven.car, roads=(road,) * 4))
        motion = _driven(moved, start, measured.shape[1])
        off = jnp.stack(
            [(motion.yaw_rate - measured[0]) / YAW_RATE, (motion.lateral_acceleration - measured[1]) / ACCELERATION]
        )
        return off[..., settled:], motion

    off, slope, motion = jax.jvp(misses, (scale,), (jnp.ones_like(scale),), has_aux=True)
    step = -jnp.sum(off * slope, axis=(0, 2)) / jnp.sum(slope**2, axis=(0, 2))
    return motion, jnp.mean(off**2, axis=(0, 2)), jnp.clip(step, -LONGEST, LONGEST)


def drive(log: VehicleLog, car: Car, variants: tuple[Variant, ...] = VARIANTS) -> list[Drive]:
    """Each variant of a car driven through a log, its friction fitted; those alike side by side."""
    found: dict[Variant, Drive] = {}
    for alike in _alike(variants):
        found.update(zip(alike, _fitted(log, car, alike)))
    return [found[variant] for variant in variants]


def _alike(variants: tuple[Variant, ...]) -> list[list[Variant]]:
    """Those that one program holds: with tyres of one kind, all with relaxation or all without."""
    kinds: dict[Any, list[Variant]] = {}
    for variant in variants:
        kinds.setdefault((type(TYRES[variant.tyre]), variant.relaxation is None), []).append(variant)
    return list(kinds.values())


def _fitted(log: VehicleLog, car: Car, variants: list[Variant]) -> list[Drive]:
    samples = log.samples
    cars = stacked([car_on(UniformRoad(TYRES[v.tyre]), car, v) for v in variants])
    driven = DrivenCar(cars, log.period, np.asarray(samples.wheel_speed), np.asarray(samples.steering_angle))
    start = jnp.array([np.mean(samples.wheel_speed[0]) * float(car.radius), samples.yaw_rate[0]])
    level = BodyAccelerometer().level(samples)
    measured = jnp.stack([jnp.asarray(samples.yaw_rate), jnp.asarray(level.lateral_acceleration)])
    settled = round(SETTLE / log.period)

    def at(scale):
        motion, cost, wanted = _at(jnp.asarray(scale), driven, start, measured, settled)
        return jax.tree.map(np.asarray, motion), np.asarray(cost), np.asarray(wanted)

    peaks = [float(TYRES[v.tyre].peak().friction) for v in variants]
    tried = [(np.log(np.divide(peak, peaks)), *at(np.log(np.divide(peak, peaks)))) for peak in STARTS]
    best = np.argmin([cost for _, _, cost, _ in tried], axis=0)
    scale, motion, cost, step = jax.tree.map(lambda *x: np.stack(x)[best, np.arange(len(best))], *tried)
    for _ in range(STEPS):
        if np.all(np.abs(step) < SHORTEST):
            break
        moved, after, wanted = at(scale + step)
        better = after < cost
        scale, cost = np.where(better, scale + step, scale), np.where(better, after, cost)
        motion = jax.tree.map(lambda new, old, b=better: np.where(b[:, None], new, old), moved, motion)
        step = np.where(better, wanted, step / 4)
    return [
        Drive(v, peak * float(np.exp(s)), float(c), jax.tree.map(lambda x, i=i: x[i], motion))
        for i, (v, peak, s, c) in enumerate(zip(variants, peaks, scale, cost))
    ]
