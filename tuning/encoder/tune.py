"""The compensation of encoder errors tuned: numbers of events and harmonics by trying all, the rest by descent.

The cost is the mean logarithm of the rms errors, of speed and acceleration, over encoders and references; its
exponential against that of the measured signals is how many times smaller errors have become. Errors are against the
truth, so that the delay of a long window counts.
"""

import dataclasses
from collections.abc import Mapping
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from absjax.encoder.harmonics import HarmonicCompensation
from absjax.encoder.time_stamping import TimeStamping
from absjax.encoder.wheel_speed import WheelSpeedChain
from tuning.core.box import Box
from tuning.core.descent import Progress
from tuning.core.fit import fit
from tuning.core.journal import Journal
from tuning.core.objective import Objective
from tuning.core.problem import Problem
from tuning.core.version import VERSION
from tuning.encoder.bench import Bench, bench_of, ratio_rows
from tuning.encoder.chains import SIGNALS, measured_chain
from tuning.encoder.config import EncoderConfig


@dataclasses.dataclass(frozen=True)
class EncoderResult:
    """A tuned chain. `to_json` and `from_json` are each other's inverse."""

    parameters: dict[str, float]
    events: int
    harmonics: int
    grid: list[dict[str, float]]
    """cost of every pair of n and M at the start"""
    held_out: list[dict[str, Any]]
    """rms errors on encoders that were not tuned on"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    config: EncoderConfig
    version: str = VERSION
    interrupted: bool = False
    """whether the search was ended from the keyboard"""

    def chain(self) -> WheelSpeedChain:
        """The tuned chain."""
        return Form.of(self.config, self.events, self.harmonics).chain(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dataclasses.asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> "EncoderResult":
        """Read back what `to_json` gave."""
        return cls(**{**data, "config": EncoderConfig.from_json(data["config"])})


@dataclasses.dataclass(frozen=True)
class Form:
    """What of a chain is no number to be tuned: what a program depends on. Hashable."""

    teeth: int
    events: int
    harmonics: int
    filter_regressor: bool
    through_edges: bool

    @classmethod
    def of(cls, config: EncoderConfig, events: int, harmonics: int) -> "Form":
        """The form a configuration asks for, with n `events` and M `harmonics`."""
        return cls(config.teeth, events, harmonics, bool(config.filter_regressor), bool(config.through_edges))

    def chain(self, parameters: Mapping[str, Any], window=None, active=None) -> WheelSpeedChain:
        """The chain of given parameters; of n events only `window` are used, of M harmonics only `active`."""

        def compensation(signal):
            own = {name.removeprefix(f"{signal}_"): x for name, x in parameters.items() if name.startswith(signal)}
            how = self.filter_regressor, self.through_edges
            return HarmonicCompensation(signal, self.harmonics, *how, active=active, **own)

        stamping = TimeStamping(self.teeth, self.events, window=window)
        return WheelSpeedChain(stamping, *(compensation(signal) for signal in SIGNALS))


def training_benches(config: EncoderConfig) -> tuple[Bench, ...]:
    """The encoders tuned on, under every reference."""
    encoder = config.drawn(config.seed, config.encoders)
    return tuple(bench_of(encoder, name, config.duration, config.settle) for name in config.references)


def losses(benches: tuple[Bench, ...], chain: WheelSpeedChain):
    """Logarithms of the rms errors of a chain, (references * signals * encoders,); traceable."""
    return jnp.concatenate([jnp.log(error) for bench in benches for error in bench.errors(chain)])


@partial(jax.jit, static_argnames="form")
def _pair_cost(form: Form, benches, parameters, window, active):
    return losses(benches, form.chain(parameters, window, active)).mean()


def pair_costs(config: EncoderConfig, benches: tuple[Bench, ...], parameters: Mapping[str, float]):
    """Cost of every pair of n and M, one program for all: rows with `events`, `harmonics` and `cost`."""
    form = Form.of(config, max(config.events), max(config.harmonics))
    n, m = (np.ravel(x) for x in np.meshgrid(config.events, config.harmonics, indexing="ij"))
    costs = jax.lax.map(
        lambda pair: _pair_cost(form, benches, dict(parameters), *pair),
        (jnp.asarray(n, float), jnp.asarray(m, float)),
        batch_size=len(config.harmonics),
    )
    return [{"events": int(a), "harmonics": int(b), "cost": float(c)} for a, b, c in zip(n, m, costs)]


@partial(jax.jit, static_argnames=("form", "box", "objective", "gradients"))
def _costs(form: Form, benches, points, members, box: Box, fixed, objective: Objective, gradients: bool):
    if members is not None:
        benches = tuple(bench.of(members) for bench in benches)

    def cost(point):
        return objective.costs(losses(benches, form.chain({**fixed, **box.values(point)})), smooth=gradients)

    def one(point):
        if not gradients:
            return cost(point)

        # Forward mode: few parameters, and no state of the chain to be kept for thousands of samples.
        def along(direction):
            return jax.jvp(cost, (point,), (direction,))

        return jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(box.names)))

    return jax.lax.map(one, points)


@dataclasses.dataclass(frozen=True)
class EncoderProblem(Problem):
    """Parameters of the compensation, n and M chosen."""

    form: Form
    benches: tuple[Bench, ...]
    box: Box
    given: np.ndarray
    members: int
    fixed: dict[str, float]
    objective: Objective
    grid: list[dict[str, Any]]
    """cost of every pair of n and M at the start"""

    @classmethod
    def of(cls, config: EncoderConfig) -> "EncoderProblem":
        """The problem a configuration describes: with the best of its pairs of n and M."""
        benches, box, initial = training_benches(config), config.box(), config.initial()
        grid = pair_costs(config, benches, initial)
        best = min(grid, key=lambda row: row["cost"])
        form = Form.of(config, best["events"], best["harmonics"])
        objective = Objective(config.objective, config.tail)
        return cls(form, benches, box, box.point(initial)[None], config.encoders, initial, objective, grid)

    def costs_and_gradients(self, points, members):
        """Costs and gradients."""
        return _costs(self.form, self.benches, points, members, self.box, self.fixed, self.objective, gradients=True)

    def judge(self, points):
        """Costs."""
        same = (self.form, self.benches)
        return np.asarray(_costs(*same, points, None, self.box, self.fixed, self.objective, gradients=False))


def tune_encoder(
    config: EncoderConfig, *, progress: Progress = lambda i, n, cost: None, journal: Journal | None = None
) -> EncoderResult:
    """Tune the chain as the configuration says.

    Args:
        progress: called with iteration, iterations and the best cost so far.
        journal: where evaluations are kept, to go on from.
    """
    problem = EncoderProblem.of(config)
    fitted = fit(problem, config, progress=progress, journal=journal)
    parameters = problem.fixed | fitted.values
    form = problem.form
    rows = held_out_rows(config, form, problem.fixed, parameters)
    pair = form.events, form.harmonics
    return EncoderResult(parameters, *pair, problem.grid, rows, fitted.history, config, interrupted=fitted.interrupted)


def held_out_rows(config: EncoderConfig, form: Form, before, after) -> list[dict[str, Any]]:
    """Rms errors on encoders that were not tuned on: as measured, before the descent, tuned."""
    encoder = config.drawn(config.seed + config.encoders, config.held_out)
    chains = {
        "measured": measured_chain(form.teeth, form.events),
        "before": form.chain(before),
        "tuned": form.chain(after),
    }
    rows = []
    for name in config.references:
        rows += ratio_rows(bench_of(encoder, name, config.duration, config.settle), chains, reference=name)
    return rows
