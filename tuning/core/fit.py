"""One fit for all tuning problems: many starts screened, descended together, and evolution from the best.

Every evaluation is written to a journal as it is made (`tuning.core.journal`), so that a run that ends early loses
nothing. Interrupted from the keyboard, it returns the best there is; before the first iteration there is none, and
`KeyboardInterrupt` goes on.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from tuning.core.config import Count, Entries, Limits, Names, NonNegative, Positive, Values, Whole, config, require
from tuning.core.descent import Descent, Method, Progress
from tuning.core.evolution import Evolution
from tuning.core.interruption import answering
from tuning.core.journal import Journal
from tuning.core.objective import Name
from tuning.core.problem import Problem

Judge = Callable[..., np.ndarray]
"""Costs (sets,) of points (sets, parameters), on some members of the ensemble if such are given."""
NARROWER = 0.4
"""The last evolution begins so much narrower where there was one before the descent: the valley is found."""


ROUNDING = 1e-9
"""Of a value that goes through the scales of the box and back, as a share."""


@config
class SearchConfig(Entries):
    """What every tuning has: from where, within which limits, for what, and how. JSON keys are the names of the fields.

    Attributes:
        start: parameters to start from; the default ones where not given.
        tune: names of the parameters to tune; those declared trainable when empty.
        limits: (low, high) by parameter; where not given, what the component declares.
        objective: over the losses of the ensemble: 'mean', 'worst', 'balanced' (a weighted mean of both), 'cvar' (the
            mean of the worst), 'mean_and_cvar' (half of each), 'power' (a power mean).
        tail: share of the ensemble that is the worst, for 'cvar' and 'mean_and_cvar'.
        starts: descents run together; screened: random starts they are chosen from.
        scatter: standard deviation of the random starts, on the scales of `tuning.core.box`.
        generations: of evolution from the best of the random starts, on what they are chosen by; what it finds is the
            first of the starts.
        iterations, learning_rate, seed: of the descent.
        method: 'adam' (cosine decay), or 'lbfgs' (backtracking).
        batch: members of the ensemble drawn for each iteration, the same for all starts; where a problem can be judged
            on some, for each generation and for screening too. What counts in the end is judged on all. None takes all.
        patience: iterations without a better cost after which the descent ends; None: it goes on to the last.
        refinements: generations of evolution from the winner of the descents, on what counts in the end.
        evolutions: how often that is tried, with other draws.
        population: points of a generation; None: as many as the problem takes.
    """

    start: Values = dataclasses.field(default_factory=dict)
    tune: Names = ()
    limits: Limits = dataclasses.field(default_factory=dict)
    objective: Name = "mean"
    tail: Annotated[Positive, Field(le=1)] = 0.2
    starts: Count = 8
    screened: Count = 256
    scatter: NonNegative = 0.5
    generations: Whole = 0
    iterations: Count = 60
    learning_rate: Positive = 0.01
    seed: Whole = 0
    method: Method = "adam"
    batch: Count | None = None
    patience: Count | None = None
    refinements: Whole = 40
    evolutions: Count = 1
    population: Annotated[Count, Field(ge=4)] | None = None

    def __post_init__(self):
        require("screened", self.screened, self.screened >= self.starts, "at least as many as starts")

    @property
    def rounds(self) -> int:
        """Generations and iterations in all."""
        return self.generations + self.iterations + self.refinements * self.evolutions


@dataclasses.dataclass(frozen=True)
class Fitted:
    """What a fit found."""

    point: np.ndarray
    """(parameters,)"""
    values: dict[str, float]
    """of the tuned parameters"""
    cost: float
    """as it is judged in the end"""
    history: list[list[float]]
    """cost of each start, by iteration"""
    on_limit: list[str]
    """tuned parameters that lie on one of their limits"""
    interrupted: bool
    """whether it was ended from the keyboard"""


def fit(
    problem: Problem,
    search: SearchConfig,
    *,
    progress: Progress = lambda i, n, cost: None,
    journal: Journal | None = None,
) -> Fitted:
    """Search for the best point of a problem.

    Args:
        progress: called with the iterations and generations done, those there are, and the best cost so far.
        journal: where evaluations are kept.

    Raises:
        ValueError: if a journal is of another run, or there are fewer starts or members than asked for.
    """
    require("starts", search.starts, search.starts >= len(problem.given), f"at least the {len(problem.given)} given")
    if search.batch is not None:
        require("batch", search.batch, search.batch <= problem.members, f"at most the {problem.members} members")
    return _Fit(problem, search, progress, journal or Journal()).run()


def unmoved(start: Mapping[str, float], found: Mapping[str, float]) -> list[str]:
    """A sentence where a search gives back the values it started from, but for rounding."""
    same = all(np.isclose(value, start[name], rtol=ROUNDING, atol=0.0) for name, value in found.items())
    return ["no better set was found than the start"] if same else []


class _Fit:
    def __init__(self, problem: Problem, search: SearchConfig, progress: Progress, journal: Journal):
        self.problem, self.search, self.journal = problem, search, journal
        self.descent, self.evolution = Descent(problem.given), None
        self.in_batches = search.batch is not None and problem.on(np.arange(1)) is not None
        self.progress, self.done = progress, 0

    def run(self) -> Fitted:
        interrupted = False
        try:
            with answering(lambda: bool(self.descent.history)):
                self._search()
        except KeyboardInterrupt:
            if not self.descent.history:
                raise
            interrupted = True
        if self.evolution is not None:
            point, cost = self.evolution.point, self.evolution.cost
        else:
            best = int(np.argmin(self.descent.best))
            point, cost = self.descent.best_points[best], float(self.descent.best[best])
        box = self.problem.box
        values = {name: float(value) for name, value in box.values(point).items()}
        return Fitted(point, values, cost, self.descent.history, box.on_limit(point), interrupted)

    def _search(self) -> None:
        search, problem = self.search, self.problem
        starts = self._starts()
        self.descent = Descent(starts)
        self.descent.run(
            self._costs_and_gradients,
            problem.box,
            iterations=search.iterations,
            learning_rate=search.learning_rate,
            method=search.method,
            patience=search.patience,
            progress=lambda i, n, cost: self._tell(cost),
        )
        self.done = search.generations + search.iterations
        last = () if search.batch is None else (self.descent.points,)
        candidates = np.concatenate([self.descent.best_points, starts, *last])
        self.evolution = Evolution(problem.box, candidates, self._judge(candidates))
        self._evolve(
            self.evolution,
            self._judge,
            rounds=search.refinements,
            widest=problem.widest * (NARROWER if search.generations else 1.0),
            seed=search.seed + 1,
            evolutions=search.evolutions,
        )

    def _tell(self, cost: float) -> None:
        """Tell of an iteration or a generation that is done."""
        self.done += 1
        self.progress(self.done, self.search.rounds, cost)

    def _evolve(self, evolution: Evolution, costs: Judge, *, seed: int, **how) -> None:
        """Evolve from where `evolution` is, each generation on members of its own where that can be done."""
        generations = itertools.count()

        def of_generation(points: np.ndarray) -> np.ndarray:
            return costs(points, self._drawn(seed, next(generations), 1))

        evolution.run(
            of_generation if self.in_batches else costs,
            judge=costs if self.in_batches else None,
            count=self.search.population or self.problem.population,
            seed=seed,
            told=self._tell,
            **how,
        )

    def _drawn(self, *seed: int) -> np.ndarray:
        """Members of a batch."""
        return np.sort(np.random.default_rng(seed).choice(self.problem.members, self.search.batch, replace=False))

    def _judge(self, points: np.ndarray, members: np.ndarray | None = None) -> np.ndarray:
        return self._costs("judge", points, members)

    def _screen(self, points: np.ndarray, members: np.ndarray | None = None) -> np.ndarray:
        return self._costs("screen", points, members)

    def _costs(self, measure: Literal["judge", "screen"], points: np.ndarray, members: np.ndarray | None) -> np.ndarray:
        if members is None:
            return self.journal.evaluate(getattr(self.problem, measure), points)[0]
        return self.journal.evaluate(lambda x, some: getattr(self.problem.on(some), measure)(x), points, members)[0]

    def _costs_and_gradients(self, iteration: int, points: np.ndarray):
        batch = self.search.batch
        if batch is None:
            costs, gradients = self.journal.evaluate(lambda x: self.problem.costs_and_gradients(x, None), points)
            return costs, gradients
        members = self._drawn(self.search.seed, iteration)
        costs, gradients = self.journal.evaluate(self.problem.costs_and_gradients, points, members)
        return costs, gradients

    def _starts(self) -> np.ndarray:
        """The given starts, and the best of the screened random ones around the first."""
        search, given = self.search, self.problem.box.valid(self.problem.given)
        if search.starts == len(given) and not search.generations:
            return given
        draws = np.random.default_rng(search.seed).normal(size=(search.screened, given.shape[1]))
        points = self.problem.box.valid(given[0] + draws * search.scatter)
        some = self._drawn(search.seed) if self.in_batches else None
        ranked = np.concatenate([given, points[np.argsort(self._screen(points, some))]])
        if search.generations:
            ranked = np.concatenate([self._evolved(ranked[: len(given) + 1])[None], ranked])
        return ranked[: search.starts]

    def _evolved(self, points: np.ndarray) -> np.ndarray:
        """What evolution makes of the best of them, on what starts are chosen by."""
        search, problem = self.search, self.problem
        found = Evolution(problem.box, points, self._screen(points))
        self._evolve(found, self._screen, rounds=search.generations, widest=problem.widest, seed=search.seed)
        return found.point
