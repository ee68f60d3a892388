"""Several logs of one car: the car's quantities are the same in all of them, the roads are each log's own.

Logs that are fitted by output error are fitted in one: a Gauss-Newton of all surfaces, all zeros and delays, and the
quantities that they share. A log whose friction is measured counts with its likelihood, which is taken for Gaussian:

    1 / s_l^2 = 1 / posterior_l^2 - 1 / prior^2,    m_l = s_l^2 (value_l / posterior_l^2 - prior mean / prior^2)

It is fitted again with the product of the prior and the likelihoods of the *other* logs for its prior, so that nothing
counts twice.
"""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Prior, Quantity
from tuning.road.fitted import Say
from tuning.road.fitting import fitted_of, quantities_of
from tuning.road.fitting_by_curve import fitted_by_curve
from tuning.road.identify import Case, Identification
from tuning.road.settling import Settled, settled
from tuning.road.shooting_fit import fit_shooting

SHARED = ("radius", "inertia", "brake_efficiency")
"""What belongs to the car; zeros and delays are those of a log's sensors."""
CONTRADICTION = 4.0
"""Standard deviations by which a log's own value may be off that of the others."""


@dataclasses.dataclass(frozen=True)
class Likelihood:
    """What a log alone says of a quantity: mean and information."""

    mean: float
    information: float
    """1 / s^2; 0: nothing"""


def identify_together(
    logs: Sequence[BrakeLog],
    car: Car,
    kind: str = "burckhardt",
    shared: Sequence[str] = SHARED,
    *,
    progress: Say = lambda message: None,
) -> list[Identification]:
    """Identify the road of every log, the car's quantities with what all logs say of them.

    Args:
        logs: checked logs of the same car.
        car: what is known of it.
        kind: of the tyre curve, as for `identify`.
        shared: quantities, of `tuning.logs.quantities.KINDS`, that are the same for all logs.
        progress: called with a line of text as the work goes on.

    Returns:
        One result a log, in their order; a quantity in which a log contradicts the others is among its reasons.

    Raises:
        ValueError: if a shared quantity is unknown, or there are no logs.
        LogError: as for `identify`.
    """
    strange = [name for name in shared if name not in KINDS]
    if strange or not logs:
        raise ValueError(f"{strange[0]!r} is no quantity; there are {', '.join(KINDS)}" if strange else "no logs")
    priors = {name: car.priors[name] for name in shared if car.priors[name].spread > 0}
    free = _with(car, priors)
    cases = [Case.of(log, car, kind) for log in logs]
    with jax.enable_x64(True):
        alone = {
            i: settled(case.curve, case.start, free, progress) for i, case in enumerate(cases) if not case.by_curve
        }
        measured = [i for i, case in enumerate(cases) if case.by_curve]
        quantities = {i: quantities_of(found) for i, found in alone.items()}
        quantities |= {i: fitted_by_curve(cases[i].curve, cases[i].start, free, progress).quantities for i in measured}
        said = [{n: _likelihood(quantities[i].get(n), p) for n, p in priors.items()} for i in range(len(logs))]
        others = [
            {name: _product(prior, [s[name] for j, s in enumerate(said) if j != i]) for name, prior in priors.items()}
            for i in range(len(logs))
        ]
        fitted = {}
        for i in measured:
            fitted[i] = fitted_by_curve(cases[i].curve, cases[i].start, _with(car, others[i]), progress)
        if alone:
            known = {name: _product(prior, [said[i][name] for i in measured]) for name, prior in priors.items()}
            progress(f"{len(alone)} logs in one fit")
            joint = dict(zip(alone, _jointly(list(alone.values()), _with(car, known), list(priors))))
            for i, found in joint.items():
                beside = [other.task() for j, other in joint.items() if j != i]
                fitted[i] = fitted_of(found, beside, list(priors))
        results = [case.concluded(fitted[i]) for i, case in enumerate(cases)]
    for i, result in enumerate(results):
        against = [_contradiction(name, said[i][name], others[i][name], len(logs)) for name in priors]
        reasons = [*result.reasons, *filter(None, against)]
        verdict = "doubtful" if result.verdict == "sound" and reasons else result.verdict
        results[i] = dataclasses.replace(result, verdict=verdict, reasons=reasons)
    return results


def _jointly(found: list[Settled], car: Car, common: Sequence[str]) -> list[Settled]:
    """The logs with their fit in common."""
    found = [one._replace(car=car) for one in found]
    fits = fit_shooting([one.task() for one in found], common)
    return [one._replace(fit=fit) for one, fit in zip(found, fits)]


def _with(car: Car, priors: dict[str, Prior]) -> Car:
    """The car with values and standard deviations of some quantities."""
    wheel = {name: prior.value for name, prior in priors.items() if KINDS[name].wheel}
    values = {name: prior.value for name, prior in priors.items() if not KINDS[name].wheel}
    spreads = {name: prior.spread for name, prior in priors.items()}
    return dataclasses.replace(
        car,
        wheel=dataclasses.replace(car.wheel, **wheel),
        values={**car.values, **values},
        spreads={**car.spreads, **spreads},
    )


def _likelihood(found: Quantity | None, prior: Prior) -> Likelihood:
    if found is None or found.spread <= 0:
        return Likelihood(prior.value, 0.0)
    information = 1 / found.spread**2 - 1 / prior.spread**2
    if information <= 0:
        return Likelihood(prior.value, 0.0)
    return Likelihood((found.value / found.spread**2 - prior.value / prior.spread**2) / information, information)


def _product(prior: Prior, likelihoods: list[Likelihood]) -> Prior:
    information = 1 / prior.spread**2 + sum(one.information for one in likelihoods)
    mean = (prior.value / prior.spread**2 + sum(one.information * one.mean for one in likelihoods)) / information
    return Prior(mean, float(np.sqrt(1 / information)), True)


def _contradiction(name: str, own: Likelihood, others: Prior, logs: int) -> str | None:
    if own.information == 0 or logs < 2:
        return None
    spread = float(np.hypot(others.spread, 1 / np.sqrt(own.information)))
    if abs(own.mean - others.value) <= CONTRADICTION * spread:
        return None
    unit = KINDS[name].unit
    return (
        f"{name.replace('_', ' ')}: this log alone has {own.mean:.4g} {unit}, the others {others.value:.4g} {unit}: "
        "not the same car, or one of the logs is wrong"
    )
