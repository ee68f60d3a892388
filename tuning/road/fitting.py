"""What a log's fit by output error comes to: curves, quantities, misfit, and profiles of the intervals."""

from collections.abc import Collection, Sequence

import numpy as np
from scipy.stats import t as student

from tuning.logs.quantities import KINDS, Z95, Quantity
from tuning.road.fitted import Fitted, FittedStretch, changes_of, largest_slip, peak_of, samples_as_fitted
from tuning.road.noise import noise_of
from tuning.road.output_error import CAR
from tuning.road.settling import Settled
from tuning.road.shooting_fit import Task, fit_shooting


def fitted_of(found: Settled, beside: Sequence[Task] = (), common: Collection[str] = ()) -> Fitted:
    """Everything that the fit of a log says.

    Args:
        found: the log and its fit.
        beside: fits of other logs, where it was fitted with them.
        common: the quantities that they have in common.
    """
    curve, start, stretches, problem, fit = found.curve, found.start, found.stretches, found.problem, found.fit
    samples, size = samples_as_fitted(start, found.car, found.values)[1], len(curve.names)
    coefficients = found.coefficients
    own = {name: noise_of(start.log, name, problem.used) for name in problem.levels(fit.residual)}
    levels = problem.levels(fit.residual)
    profiles = _profiles(found, beside, common)
    changes = changes_of(curve, samples, stretches, coefficients)
    edges = [float(samples.time[0]), *(at for at, _ in changes), float(samples.time[-1])]
    parts = []
    for i, stretch in enumerate(stretches):
        block = slice(i * size, (i + 1) * size)
        lanes = problem.surface == i
        alone = problem._replace(weight=problem.weight * lanes[:, None, None])
        rms = [level / own[name] for name, level in alone.levels(fit.residual).items()]
        inside = np.zeros(len(samples.time), bool)
        inside[stretch.first : stretch.last] = True
        inside &= alone.used
        parts.append(
            FittedStretch(
                start=edges[i],
                end=edges[i + 1],
                coefficients=coefficients[i],
                covariance=fit.covariance[block, block] * _few(int(np.any(alone.weight > 0, axis=(1, 2)).sum()) - size),
                peak_friction=peak_of(curve, coefficients[i]),
                largest_slip=largest_slip(samples.slip[inside]),
                residual_rms=float(np.sqrt(np.mean(np.square(rms)))) if rms else 0.0,
                samples=int(inside.sum()),
                profile=profiles[i],
            )
        )
    return Fitted(
        parts,
        [blend for _, blend in changes],
        quantities_of(found),
        {name: level / own[name] for name, level in levels.items()},
        "output error",
        problem.imposed,
        [],
    )


def _profiles(found: Settled, beside: Sequence[Task], common: Collection[str]) -> list[dict[str, tuple[float, float]]]:
    """Profile of the sum of squares at the ends of each coefficient's interval, all else fitted anew, by surface."""
    fit, size, profiles = found.fit, len(found.curve.names), []
    for surface in range(len(found.stretches)):
        profile = {}
        for k, name in enumerate(found.curve.names):
            at = surface * size + k
            width = Z95 * float(np.sqrt(fit.plain[at, at]))
            if not 0 < width < abs(fit.shared[at]):
                continue
            sides = []
            for end in (-width, width):
                again = fit_shooting([found.task((at, end)), *beside], common)[0]
                sides.append(float(np.sqrt(max(again.cost - fit.cost, 0.0))) / Z95)
            profile[name] = (sides[0], sides[1])
        profiles.append(profile)
    return profiles


def quantities_of(found: Settled) -> dict[str, Quantity]:
    """Those that were free, or found before the fit."""
    fit, start, priors, told = found.fit, found.start, found.car.priors, {}
    first = found.coefficients.size
    for i, name in enumerate(CAR):
        value, spread = float(fit.shared[first + i]), float(np.sqrt(fit.covariance[first + i, first + i]))
        if name == "speed_delay":
            value += start.values[name]
            if spread == 0 and start.motion is not None and value != priors[name].value:
                spread = start.motion.delay_spread
        if spread > 0 and (name != "load" or priors[name].stated):
            prior = priors[name]
            told[name] = Quantity(float(value), float(spread), prior.value, prior.spread, KINDS[name].unit)
    return told


def _few(freedom: int) -> float:
    """By how much variances are raised since they come from few intervals: Student's quantile over the normal one."""
    return float((student.ppf(0.975, max(freedom, 3)) / Z95) ** 2)
