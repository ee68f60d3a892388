"""A log whose friction is measured, sample by sample: curves through its points, driving and braking apart."""

import dataclasses

import numpy as np

from absjax.plant.wheel import GRAVITY
from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Quantity
from tuning.road.arrow_fit import Fit, Prior
from tuning.road.changes import Stretch, find_stretches
from tuning.road.conditions import Start
from tuning.road.curve import Curve
from tuning.road.curve_fit import BLOCK, fit_curve
from tuning.road.fitted import (
    Fitted,
    FittedStretch,
    Say,
    changes_of,
    clear_of_changes,
    largest_slip,
    peak_of,
    samples_as_fitted,
    told_of,
)
from tuning.road.noise import noise_of
from tuning.road.samples import FrictionSamples, balanced_force
from tuning.road.sampling import measured
from tuning.road.selection import selected

ZERO_SHARE = 0.003
"""Of the load, by which the balance of a wheel is off at the least."""
DRIVING = 0.02
"""Slip from which a wheel counts as driven."""
FEWEST_DRIVING = 200


def fitted_by_curve(curve: Curve, start: Start, car: Car, say: Say) -> Fitted:
    """By `tuning.road.curve_fit`, driving and braking apart where the log has both."""
    log, values = start.log, {name: prior.value for name, prior in car.priors.items()}
    values["speed_delay"] = start.values["speed_delay"]
    signal = "force" if log.force is not None else "acceleration"
    samples = samples_as_fitted(start, car, values)[1]
    told = np.flatnonzero(measured(log, signal) & measured(log, "wheel_speed") & (log.wheel_speed > 0))
    some = FrictionSamples(samples.time[told], samples.slip[told], samples.friction[told], samples.source)
    sides = {"braking": some.slip < 0.5 * DRIVING, "driving": some.slip > -0.5 * DRIVING}
    swept = (some.slip > DRIVING).sum() >= FEWEST_DRIVING
    if swept:
        # A sweep comes and goes; its sides are not stretches of time.
        sides = {side: on for side, on in sides.items() if (on & (np.abs(some.slip) > DRIVING)).sum() >= FEWEST_DRIVING}
        stretches = [_whole(some, on) for on in sides.values()]
        masks, labels = list(sides.values()), list(sides)
    else:
        stretches = find_stretches(some)
        masks, labels = clear_of_changes(some.time, stretches), ["braking"] * len(stretches)
    say(f"{len(stretches)} curve{'s' if len(stretches) > 1 else ''} found in friction from {samples.source}")
    load = float(car.wheel.load) * (1.0 if start.share is None else float(start.share.mean()))
    scale = load if signal == "force" else GRAVITY
    zero_name = "force_zero" if signal == "force" else "acceleration_bias"
    slip_noise = np.hypot(
        float(car.wheel.radius) * noise_of(log, "wheel_speed"), (1 + samples.slip) * noise_of(log, "vehicle_speed")
    )
    slip_noise = slip_noise / log.vehicle_speed
    parts, found, rms = [], {}, []
    friction, balance = samples.friction + values[zero_name] / scale, _force_zero(start, car)
    for stretch, on, side in zip(stretches, masks, labels):
        inside = told[on]
        part, zeros = _curve(curve, log, friction, slip_noise, stretch, inside, side, car, (zero_name, scale, balance))
        parts.append(part)
        rms.append(part.residual_rms)
        found = zeros | found
    if start.slow and start.motion is not None:
        delay = car.priors["speed_delay"]
        found["speed_delay"] = Quantity(start.motion.delay, start.motion.delay_spread, delay.value, delay.spread, "s")
    say(f"curve fit: {told_of(curve, np.array([part.coefficients for part in parts]))}")
    changes = [] if swept else changes_of(curve, some, stretches, [p.coefficients for p in parts])
    edges = [float(samples.time[0]), *(at for at, _ in changes), float(samples.time[-1])]
    if changes or len(parts) == 1:
        parts = [dataclasses.replace(part, start=edges[i], end=edges[i + 1]) for i, part in enumerate(parts)]
    misfit = {signal: float(np.sqrt(np.mean(np.square(rms))))}
    return Fitted(parts, [blend for _, blend in changes], found, misfit, "curve fit", True, [])


def _curve(curve: Curve, log, friction, slip_noise, stretch, inside, side, car: Car, zero_of):
    """The curve through some of the points, and the radius and the zero that they say are not as known."""
    name, scale, balance = zero_of
    priors, size = car.priors, len(curve.names)
    if name == "force_zero" and balance is not None and not priors[name].stated:
        priors[name] = dataclasses.replace(priors[name], spread=balance[1])
    ratio = log.wheel_speed[inside] / log.vehicle_speed[inside]
    guess = curve.near(np.maximum(stretch.coefficients, 1e-3))

    def fit(free: frozenset[str]) -> Fit:
        known = []
        for quantity, unit in (("radius", 1.0), (name, -scale)):
            prior = priors[quantity]
            spread = prior.spread / abs(unit) if quantity in free else 0.0
            mean = balance[0] if quantity in free and quantity == "force_zero" and balance is not None else prior.value
            known.append(Prior(np.array([mean / unit]), np.array([spread])))
        fit = fit_curve(curve, ratio, friction[inside], slip_noise[inside], guess, radius=known[0], zero=known[1])
        if balance is None or name in free:
            return fit
        return fit._replace(cost=fit.cost + ((priors[name].value - balance[0]) / balance[1]) ** 2)

    stated = [quantity for quantity in ("radius", name) if priors[quantity].stated and priors[quantity].spread > 0]
    others = [quantity for quantity in ("radius", name) if not priors[quantity].stated]
    _, best = selected(fit, stated, others)
    found = {}
    for i, (quantity, unit) in enumerate((("radius", 1.0), (name, -scale))):
        spread = float(np.sqrt(best.covariance[size + i, size + i])) * abs(unit)
        if spread > 0:
            prior = priors[quantity]
            value = float(best.shared[size + i]) * unit
            found[quantity] = Quantity(value, spread, prior.value, prior.spread, KINDS[quantity].unit)
    part = FittedStretch(
        start=float(log.time[inside[0]]),
        end=float(log.time[inside[-1]]),
        coefficients=best.shared[:size],
        covariance=best.covariance[:size, :size],
        peak_friction=peak_of(curve, best.shared[:size]),
        largest_slip=largest_slip(best.shared[size] * ratio - 1),
        residual_rms=float(np.sqrt(np.mean(best.residual**2))),
        samples=len(inside),
        side=side,
    )
    return part, found


def _force_zero(start: Start, car: Car) -> tuple[float, float] | None:
    """Zero of the force [N] and how well it is known by the balance of the wheel: the mean of what is over.

    F = -(J w' + gamma_b Pb) / R + zero, over blocks whose means differ by what the model lacks.
    """
    log, wheel = start.log, car.wheel
    if log.force is None or log.brake_pressure is None:
        return None
    asked = balanced_force(log, wheel)
    columns = np.stack([asked, np.ones_like(asked)], axis=1)
    slope, zero = np.linalg.lstsq(columns, log.force, rcond=None)[0]
    over = (log.force - slope * asked - zero)[: len(asked) // BLOCK * BLOCK].reshape(-1, BLOCK).mean(axis=1)
    spread = float(np.std(over) / np.sqrt(len(over)) * np.sqrt(1 + np.mean(asked) ** 2 / np.var(asked)))
    return float(zero), max(spread, ZERO_SHARE * float(wheel.load))


def _whole(samples: FrictionSamples, inside: np.ndarray) -> Stretch:
    """The whole log as a stretch, with a rough curve through some of its samples."""
    some = FrictionSamples(samples.time[inside], samples.slip[inside], samples.friction[inside], samples.source)
    rough = find_stretches(some, most=1)[0]
    return Stretch(0, len(samples.time), rough.coefficients, rough.residual)
