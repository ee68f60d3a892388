"""Gains by gradient, with the rightmost root or the delay margin as what counts or as a limit.

`PredictorGains`: alpha and beta of the pendulum for the quickest decay, the rightmost root over both equilibria.
`LoopGains`: K / v and the damping of the notch, as large as they can be (a loop that is quick, a filter that settles
quickly) while no margin over speeds and friction slopes falls below a limit.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.delay.margins import delay_margin
from absjax.delay.roots import predictor_root
from absjax.plant.wheel import Wheel
from tuning.core.box import Box
from tuning.core.config import Count, Positive, Whole, config
from tuning.core.fit import Fitted, SearchConfig, fit
from tuning.core.problem import Problem
from tuning.delay.chains import DELAY, EQUILIBRIA, PENDULUM
from tuning.delay.margins import RATIO, SLOPES

BREACH = 30.0
"""Charge for a margin that is short of its limit, on the square of the share by which it is."""
ROOM = 0.02
"""Share of the limit by which a margin has to exceed it before nothing is charged: the charge begins gently."""
DAMPING_WEIGHT = 0.3
"""What the logarithm of the damping counts against that of the gain."""
SPEEDS = (10.0, 20.0, 30.0, 40.0, 50.0)


@config
class GainSearch(SearchConfig):
    """How gains are searched for; JSON keys are the names of the fields, and those of `SearchConfig`.

    Attributes:
        least_margin: of every loop [s].
    """

    least_margin: Positive = 0.015
    starts: Count = 4
    screened: Count = 16
    iterations: Count = 120
    learning_rate: Positive = 0.05
    refinements: Whole = 20


class _Smooth(Problem):
    """A problem of a cost that JAX differentiates."""

    members = 1

    def __init__(self, box: Box, start: dict[str, float]):
        self.box, self.given = box, box.point(start)[None]
        self._all = jax.jit(jax.vmap(jax.value_and_grad(self.cost)))

    def cost(self, point) -> Any:
        """Of a point (parameters,)."""
        raise NotImplementedError

    def costs_and_gradients(self, points, members):
        """Of points (sets, parameters)."""
        return self._all(jnp.asarray(points))

    def judge(self, points):
        """The costs alone."""
        return np.asarray(self._all(jnp.asarray(points))[0])


class PredictorGains(_Smooth):
    """Real part of the rightmost root [1/s], over the delay, so that it is of order one."""

    def __init__(self):
        super().__init__(Box(("alpha", "beta"), (0.5, 0.5), (75.0, 75.0)), {"alpha": 5.0, "beta": 10.0})

    def cost(self, point):
        """h times the root of the worse equilibrium."""
        values = self.box.values(point)
        alpha, beta = (jnp.stack([values[name]] * 2) for name in ("alpha", "beta"))
        roots = jax.vmap(lambda at: predictor_root(PENDULUM.chain, at, alpha, beta, DELAY))(jnp.array(EQUILIBRIA))
        return DELAY * jnp.max(roots)


class LoopGains(_Smooth):
    """Gain and damping, charged where a margin is short of the limit."""

    def __init__(self, search: GainSearch):
        self.least = search.least_margin
        super().__init__(Box(("gain", "zd"), (5.0, 1e-3), (200.0, 1.0)), {"gain": 63.0, "zd": 0.1})

    def margins(self, gain, zd):
        """Margins (loops,) [s] of K = gain v over speeds and friction slopes."""
        theta, v = (jnp.asarray(x).ravel() for x in np.meshgrid([s.theta for s in SLOPES], SPEEDS))
        radius = float(Wheel().radius)
        return jax.vmap(lambda th, v: delay_margin(gain * v, v, th, v / radius, RATIO * zd, zd).margin)(theta, v)

    def cost(self, point):
        """The less the quicker."""
        values = self.box.values(point)
        margins = self.margins(values["gain"], values["zd"])
        short = jnp.maximum(1 + ROOM - margins / self.least, 0.0)
        return -jnp.log(values["gain"]) - DAMPING_WEIGHT * jnp.log(values["zd"]) + BREACH * jnp.sum(short**2)


def tuned_gains(search: GainSearch | None = None) -> list[dict[str, Any]]:
    """Both problems, before and after."""
    search = search or GainSearch()
    rows = []
    for label, problem in (("predictor", PredictorGains()), ("loop", LoopGains(search))):
        found: Fitted = fit(problem, search)
        if found.interrupted:
            raise KeyboardInterrupt
        start = problem.box.values(problem.given[0])
        for name, values in (("published", start), ("tuned", found.values)):
            gains = ", ".join(f"{k} {float(v):.4g}" for k, v in values.items())
            rows.append({"what": label, "gains": name, "values": gains, "reached": _reached(problem, values)})
    return rows


def _reached(problem: _Smooth, values: dict[str, Any]) -> str:
    if isinstance(problem, LoopGains):
        return f"least margin {1e3 * float(problem.margins(values['gain'], values['zd']).min()):.2f} ms"
    return f"rightmost root {float(problem.judge(problem.box.point(values)[None])[0]) / DELAY:.3f} /s"
