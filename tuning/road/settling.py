"""Which surfaces a log has and which of the car's quantities it tells, fitted by output error."""

from typing import NamedTuple

import numpy as np

from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Z95
from tuning.logs.quantities import Prior as Known
from tuning.road.arrow_fit import Fit, Prior
from tuning.road.changes import Stretch, find_stretches
from tuning.road.conditions import Start
from tuning.road.curve import Curve
from tuning.road.fitted import (
    GUARD,
    Say,
    anyones_guess,
    clear_of_changes,
    largest_slip,
    peak_slip_of,
    samples_as_fitted,
    told_of,
)
from tuning.road.noise import noise_of
from tuning.road.output_error import CAR, NUISANCE, SHARED, Shooting, shooting
from tuning.road.selection import TOGETHER, selected
from tuning.road.shooting_fit import Task, fit_shooting

SWEEPS = 3
"""Fits with the noise of the channels taken from the fit before."""
ROUNDS = 3
"""Searches for the changes, each with the quantities of the fit before."""
MATERIAL = 0.03
"""Share of the larger friction by which two curves have to differ somewhere to be two surfaces."""
LEAST_SHARE = 0.1
"""Of what a quantity of the wheel is known as: it may not be less."""
SMALLEST_PEAK_SLIP = 2e-3
"""No tyre has its peak at less: a curve that has it there was fitted to something else."""
DISTINCT = 0.25
"""The same share from which nobody asks whether one curve would do."""
FOUND_BADLY = 1.6
"""Residual over a channel's own noise from which any two surfaces are asked whether one curve would do."""
SELDOM = 0.05
"""Share of the slips of a surface that are less than its least ones."""
FEWEST_INTERVALS = 4
"""Shooting intervals of a surface; shorter ones go to a neighbour."""


class Settled(NamedTuple):
    """A log, the surfaces found in it, and their fit."""

    curve: Curve
    start: Start
    car: Car
    stretches: list[Stretch]
    problem: Shooting
    fit: Fit
    free: frozenset[str]
    """quantities that were fitted"""

    @property
    def coefficients(self) -> np.ndarray:
        """(surfaces, coefficients)"""
        return self.fit.shared[:-SHARED].reshape(len(self.stretches), -1)

    @property
    def values(self) -> dict[str, float]:
        """Of the car's quantities."""
        return {**self.start.values, **_values(self.fit.shared, self.start)}

    def task(self, moved: tuple[int, float] | None = None) -> Task:
        """The same fit once more, from where it ended; a parameter that is `moved`, and by how much, then stays."""
        shared, held = self.fit.shared.copy(), None
        if moved is not None:
            held = moved[0]
            shared[held] += moved[1]
        return task_of(self.problem, len(self.stretches), shared, self.fit.own, self.start, self.car, self.free, held)


def settled(curve: Curve, start: Start, car: Car, say: Say) -> Settled:
    """Find the surfaces, fit their curves and the quantities, and make one of surfaces that need no two."""
    values = dict(start.values)
    stretches, fit, problem, free = [], None, None, frozenset()
    for _ in range(ROUNDS):
        samples = samples_as_fitted(start, car, values)[1]
        found = find_stretches(samples)
        if fit is not None and _alike(found, stretches, samples.time):
            break
        say(f"{len(found)} surface{'s' if len(found) > 1 else ''} found in friction from {samples.source}")
        stretches = found
        guesses = [curve.near(np.maximum(stretch.coefficients, 1e-3)) for stretch in stretches]
        problem = _intervals(curve, start, stretches, values)
        fit, problem, free = _settled(problem, guesses, start, car, values)
        values |= _values(fit.shared, start)
    assert fit is not None and problem is not None
    several = len(stretches)
    stretches, fit, problem = _merged(curve, stretches, fit, problem, start, car, free)
    if len(stretches) < several:
        # Noise and quantities were those of surfaces that are not there.
        guesses = fit.shared[:-SHARED].reshape(len(stretches), -1)
        fit, problem, free = _settled(problem, guesses, start, car, {**values, **_values(fit.shared, start)})
    found = Settled(curve, start, car, stretches, problem, fit, free)
    say(f"output error: {told_of(curve, found.coefficients)} after {fit.iterations} iterations")
    return found


def _alike(found: list[Stretch], before: list[Stretch], time: np.ndarray) -> bool:
    if len(found) != len(before):
        return False
    return all(abs(time[a.first] - time[b.first]) < GUARD for a, b in zip(found, before))


def _intervals(curve: Curve, start: Start, stretches: list[Stretch], values: dict[str, float]) -> Shooting:
    log = start.log
    late = log.time <= log.time[-1] - max(values["speed_delay"], 0.0)
    masks = [inside & late for inside in clear_of_changes(log.time, stretches)]
    errors = None if start.motion is None else start.motion.errors
    return shooting(curve, log, masks, values["radius"], start.share, errors)


def _candidates(start: Start, car: Car) -> tuple[list[str], list[str]]:
    """Quantities that are free in any case, since the car file says how well it knows them, and those that may be."""
    imposed, told = start.share is not None, start.log.acceleration is not None
    cannot = {"load"}
    if imposed:
        cannot |= {"brake_efficiency", "inertia"}
    if imposed or not told:
        cannot |= {"slope", "acceleration_bias", "speed_delay"}
    if start.slow:
        cannot |= {"speed_delay"}
    if not start.transferred:
        cannot |= {"load_lag"}
    priors = car.priors
    always = [name for name in CAR if priors[name].stated and priors[name].spread > 0]
    if start.values["speed_delay"] != priors["speed_delay"].value:
        always.append("speed_delay")
    always = [name for name in always if name not in cannot or name in ("load", "brake_efficiency", "inertia")]
    maybe = [
        name
        for name in CAR
        if name not in always and not priors[name].stated and priors[name].spread > 0 and name not in cannot
    ]
    return always, maybe


def _prior(problem: Shooting, surfaces: int, start: Start, car: Car, free: frozenset[str]) -> Prior:
    """Nothing of the coefficients; of the car's quantities what is known, those not free fixed."""
    size, priors = len(problem.curve.names), car.priors
    means = {name: priors[name].value for name in CAR}
    means["speed_delay"] = means["speed_delay"] - start.values["speed_delay"]
    if "speed_delay" not in free and priors["speed_delay"].spread > 0:
        means["speed_delay"] = 0.0
    if not start.transferred:
        means["load_lag"] = 0.0
    spreads = [priors[name].spread if name in free else 0.0 for name in CAR]
    rest = _at_rest(problem, start, car)
    if rest is not None and "pressure_zero" in free:
        means["pressure_zero"], spreads[CAR.index("pressure_zero")] = rest.value, rest.spread
    if start.transferred and "load" not in free:
        spreads[CAR.index("load")] = _transfer_spread(start, car) * priors["load"].value
    course = np.full(len(NUISANCE), 1.0 if start.slow else 0.0)
    return Prior(
        np.concatenate([np.zeros(surfaces * size), [means[name] for name in CAR], 0 * course]),
        np.concatenate([np.full(surfaces * size, np.inf), spreads, course]),
    )


def _at_rest(problem: Shooting, start: Start, car: Car) -> Known | None:
    """Zero of the pressure by the rolling wheel, where nothing else tells it: the vehicle's deceleration counts not."""
    return None if car.priors["pressure_zero"].stated or not problem.imposed else start.rest


def _transfer_spread(start: Start, car: Car) -> float:
    """Standard deviation of the load, as a share, since the acceleration that moves it has a bias nobody knows."""
    if start.motion is None or car.axle is None:
        return 0.0
    return abs(car.axle.load_share(float(np.hypot(*start.motion.bias))) - 1)


def _settled(problem: Shooting, guesses, start: Start, car: Car, values) -> tuple[Fit, Shooting, frozenset[str]]:
    """The fit, with the noise of each channel as the fit of all that may be free has it, and what had to be free."""
    always, maybe = _candidates(start, car)
    begin = {**values, "speed_delay": values["speed_delay"] - start.values["speed_delay"]}
    shared = np.concatenate([*guesses, [begin[name] for name in CAR], np.zeros(len(NUISANCE))])
    own, everything = problem.start(), frozenset([*always, *maybe])
    for _ in range(SWEEPS):
        fit = _fit(problem, len(guesses), shared, own, start, car, everything)
        shared, own = fit.shared, fit.own
        problem = problem.with_noise(problem.levels(fit.residual))
    # With the vehicle's speed imposed a pull of the brake passes for a larger wheel.
    together = frozenset() if problem.imposed else TOGETHER
    rest = _at_rest(problem, start, car)

    def fit_with(names: frozenset[str]) -> Fit:
        found = _fit(problem, len(guesses), shared, own, start, car, names)
        if rest is None or "pressure_zero" in names:
            return found
        return found._replace(cost=found.cost + ((car.priors["pressure_zero"].value - rest.value) / rest.spread) ** 2)

    free, fit = selected(fit_with, always, maybe, together)
    return fit, problem, free


def task_of(
    problem: Shooting, surfaces: int, shared, own, start: Start, car: Car, free: frozenset[str], held: int | None = None
) -> Task:
    """What there is to fit with some quantities free; a parameter that is `held` stays where it starts."""
    least = [LEAST_SHARE * car.priors[name].value if KINDS[name].wheel else KINDS[name].low for name in CAR]
    lower = np.concatenate([np.tile(problem.curve.lower + 1e-6, surfaces), least, np.full(len(NUISANCE), -np.inf)])
    prior = _prior(problem, surfaces, start, car, free)
    if held is not None:
        prior.mean[held], prior.spread[held] = shared[held], 0.0
    return Task(problem, shared, own, lower, prior)


def _fit(*args) -> Fit:
    return fit_shooting([task_of(*args)])[0]


def _values(shared: np.ndarray, start: Start) -> dict[str, float]:
    found: dict[str, float] = dict(zip(CAR, map(float, shared[len(shared) - SHARED :])))
    found["speed_delay"] += start.values["speed_delay"]
    return found


def _merged(curve: Curve, stretches, fit: Fit, problem: Shooting, start: Start, car: Car, free: frozenset[str]):
    """Neighbours that one curve serves as well, or that differ by too little, made one."""
    size = len(curve.names)
    while len(stretches) > 1:
        coefficients = fit.shared[: len(stretches) * size].reshape(-1, size)
        best = None
        for i in range(len(stretches) - 1):
            intervals = [int(np.any(problem.weight[problem.surface == k] > 0, axis=(1, 2)).sum()) for k in (i, i + 1)]
            apart = _apart(curve, coefficients[i], coefficients[i + 1], [_visited(problem, k) for k in (i, i + 1)])
            # What rounding makes of the variance of a direction that nothing determines may be below zero.
            variance = np.where(np.diag(fit.plain) < 0, np.inf, np.diag(fit.plain))
            spreads = [np.sqrt(variance[k * size : (k + 1) * size]) for k in (i, i + 1)]
            strange = min(peak_slip_of(curve, coefficients[k]) for k in (i, i + 1)) < SMALLEST_PEAK_SLIP
            strange |= any(anyones_guess(coefficients[i + k], Z95 * spreads[k]) for k in (0, 1))
            short = min(intervals) < FEWEST_INTERVALS
            if apart > DISTINCT and not (strange or short or _misfits(problem, fit)):
                continue
            fewer = [*stretches[:i], _joined(stretches[i], stretches[i + 1]), *stretches[i + 2 :]]
            keep = i if _length(stretches[i]) >= _length(stretches[i + 1]) else i + 1
            guesses = [*coefficients[:i], coefficients[keep], *coefficients[i + 2 :]]
            other = problem._replace(surface=np.where(problem.surface > i, problem.surface - 1, problem.surface))
            shared = np.concatenate([*guesses, fit.shared[len(fit.shared) - SHARED :]])
            again = _fit(other, len(guesses), shared, fit.own, start, car, free)
            points = int(np.count_nonzero(problem.weight[np.isin(problem.surface, (i, i + 1))]))
            penalty = fit.inflation * (size + 1) * np.log(max(points, 2))
            if strange and not short and apart > MATERIAL:
                # It may never have seen small slips: then nothing but a surface of its own explains it.
                strange = not _misfits(other, again) or _misfits(problem, fit)
            needless = again.cost - fit.cost < penalty or apart < MATERIAL or strange or short
            if needless and (best is None or again.cost < best[1].cost):
                best = fewer, again, other
        if best is None:
            break
        stretches, fit, problem = best
    return stretches, fit, problem


def _misfits(problem: Shooting, fit: Fit) -> bool:
    """Whether the surfaces as they were found leave so much that they are not to be believed."""
    levels = problem.levels(fit.residual)
    return any(level > FOUND_BADLY * noise_of(problem.log, name, problem.used) for name, level in levels.items())


def _visited(problem: Shooting, surface: int) -> tuple[float, float]:
    """Least and largest slip of the intervals of a surface, about."""
    lanes = problem.index[(problem.surface == surface) & np.any(problem.weight > 0, axis=(1, 2))]
    slip = problem.radius * problem.log.wheel_speed[lanes] / problem.log.vehicle_speed[lanes] - 1
    return float(np.quantile(np.abs(slip), SELDOM)) if slip.size else 0.0, largest_slip(slip.ravel())


def _apart(curve: Curve, one, other, visited) -> float:
    """How far two curves are apart at slips that both have visited, as a share of the larger friction there."""
    least, most = max(low for low, _ in visited), max(min(high for _, high in visited), 0.01)
    slips = -np.linspace(min(least, most), most, 61)
    pair = [np.asarray(curve.tyre(map(float, c)).friction(slips)) for c in (one, other)]
    return float(np.abs(pair[0] - pair[1]).max() / np.abs(pair).max())


def _joined(first: Stretch, second: Stretch) -> Stretch:
    longer = first if _length(first) >= _length(second) else second
    return Stretch(first.first, second.last, longer.coefficients, first.residual + second.residual)


def _length(stretch: Stretch) -> int:
    return stretch.last - stretch.first
