"""Several logs of one car: what each says of the car's quantities counts for the others, the roads are each log's own.

A log's likelihood of a quantity is taken for Gaussian, and quantities for independent:

    1 / s_l^2 = 1 / posterior_l^2 - 1 / prior^2,    m_l = s_l^2 (value_l / posterior_l^2 - prior mean / prior^2)

Each log is fitted again with the product of the prior and the likelihoods of the *other* logs for its prior, so that
nothing counts twice.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from tuning.logs.brake_log import BrakeLog
from tuning.logs.car import Car
from tuning.logs.quantities import KINDS, Prior
from tuning.road.identify import Identification, identify

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
    progress=lambda message: None,
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
    """
    strange = [name for name in shared if name not in KINDS]
    if strange or not logs:
        raise ValueError(f"{strange[0]!r} is no quantity; there are {', '.join(KINDS)}" if strange else "no logs")
    priors = {name: car.priors[name] for name in shared if car.priors[name].spread > 0}
    free = _with(car, priors)
    alone = [identify(log, free, kind, progress=progress) for log in logs]
    said = [{name: _likelihood(result, name, prior) for name, prior in priors.items()} for result in alone]
    results = []
    for i, log in enumerate(logs):
        others = {
            name: _product(prior, [s[name] for j, s in enumerate(said) if j != i]) for name, prior in priors.items()
        }
        result = identify(log, _with(car, others), kind, progress=progress)
        against = [_contradiction(name, said[i][name], others[name], len(logs)) for name in priors]
        reasons = [*result.reasons, *filter(None, against)]
        verdict = "doubtful" if result.verdict == "sound" and reasons else result.verdict
        results.append(dataclasses.replace(result, verdict=verdict, reasons=reasons))
    return results


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


def _likelihood(result: Identification, name: str, prior: Prior) -> Likelihood:
    found = result.quantities.get(name)
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
