"""Fits of shooting intervals, of one log or of several that have some of the car's quantities in common."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from tuning.road.arrow_fit import Fit, Part, Prior, joint_fit
from tuning.road.output_error import CAR, NUISANCE, SHARED, Shooting


class Task(NamedTuple):
    """Intervals of a log, and where their fit begins; of the shared parameters, surfaces x coefficients, then the
    quantities of `CAR`, then `NUISANCE`."""

    problem: Shooting
    shared: np.ndarray
    """start (parameters,)"""
    own: np.ndarray
    """start (lanes, states)"""
    lower: np.ndarray
    """lower bounds (parameters,)"""
    prior: Prior
    """of all; a spread of 0 keeps a parameter at its mean"""

    @property
    def free(self) -> np.ndarray:
        """What is fitted, bool (parameters,)."""
        return self.prior.spread > 0

    @property
    def begun(self) -> np.ndarray:
        """Start, with what is not fitted at its mean, (parameters,)."""
        return np.where(self.free, self.shared, self.prior.mean)

    @property
    def names(self) -> list[str]:
        """Of the parameters that are fitted; those of the coefficients are empty."""
        every = [""] * (len(self.shared) - SHARED) + [*CAR, *NUISANCE]
        return [name for name, free in zip(every, self.free) if free]

    def part(self, at: np.ndarray) -> Part:
        """What is fitted, as a part of a joint fit."""
        whole, free = self.begun, self.free
        surfaces = (len(self.shared) - SHARED) // len(self.problem.curve.names)
        evaluate_whole = self.problem.evaluate(surfaces, free)

        def evaluate(some, own):
            point = whole.copy()
            point[free] = some
            return evaluate_whole(point, own)

        return Part(evaluate, self.own, at)


def fit_shooting(tasks: Sequence[Task], common: Collection[str] = ()) -> list[Fit]:
    """Fit what is free, all tasks at once.

    Args:
        tasks: of one log each.
        common: quantities of `CAR` that are the same in all logs in which they are free; the search begins at their
            mean, with the prior of the first.

    Returns:
        A fit of each; values and covariance are of all its parameters, with 0 for what was not free.
    """
    places: dict[str, int] = {}
    known: list[list[tuple[float, ...]]] = []
    """by parameter, what each log has: start, lower bound, mean and spread before"""
    tables = []
    for task in tasks:
        has = np.stack([task.begun, task.lower, task.prior.mean, task.prior.spread], axis=1)[task.free]
        at = []
        for name, row in zip(task.names, has):
            place = places.setdefault(name, len(known)) if name in common else len(known)
            if place == len(known):
                known.append([])
            known[place].append(tuple(row))
            at.append(place)
        tables.append(np.array(at, int))
    start = np.array([np.mean([row[0] for row in rows]) for rows in known])
    first = np.array([rows[0] for rows in known])
    parts = [task.part(at) for task, at in zip(tasks, tables)]
    fits = joint_fit(parts, start, lower=first[:, 1], prior=Prior(first[:, 2], first[:, 3]))
    return [fit.of_all(task.begun, task.free) for task, fit in zip(tasks, fits)]
