"""The fit every tuner shares, on problems whose least is known: descents, objectives, evolution, the journal."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tuning.core import interruption
from tuning.core.box import Box
from tuning.core.command import tuned
from tuning.core.config import ConfigError
from tuning.core.descent import Descent
from tuning.core.evolution import refine
from tuning.core.fit import SearchConfig, fit, unmoved
from tuning.core.journal import Journal, identity_of
from tuning.core.objective import Objective
from tuning.core.problem import Problem, in_chunks

BOX = Box(("size", "shift"), (0.1, -1.0), (10.0, 3.0))
LEAST = {"size": 2.0, "shift": -0.5}
MEAN = Objective()
SEARCH = SearchConfig(starts=3, screened=20, iterations=40, learning_rate=0.1, refinements=3, scatter=1.0)


def bowl(points):
    """Least at size 2 and shift -0.5."""
    values = BOX.values(points)
    return jnp.log(values["size"] / 2.0) ** 2 + (values["shift"] + 0.5) ** 2


def losses_around(centres, points):
    return jnp.stack([bowl(points + centre) for centre in centres])


@partial(jax.jit, static_argnames="objective")
def judged(centres, points, objective):
    return objective.costs(losses_around(centres, points))


@partial(jax.jit, static_argnames="objective")
def descended(centres, points, objective):
    def cost(x):
        return objective.costs(losses_around(centres, x), smooth=True)

    return cost(points), jax.grad(lambda x: cost(x).sum())(points)


class Bowls(Problem):
    """Bowls around scattered centres: losses (members, sets)."""

    population = 12
    widest = 0.3

    def __init__(self, objective=MEAN):
        self.box, self.members, self.objective = BOX, 5, objective
        self.given = BOX.point({"size": np.array([8.0]), "shift": np.array([2.0])})
        self.centres = 0.3 * np.random.default_rng(0).normal(size=(self.members, 2))
        self.asked = 0

    def losses(self, points, members=None):
        return losses_around(self.centres if members is None else self.centres[members], points)

    def costs_and_gradients(self, points, members):
        self.asked += 1
        centres = self.centres if members is None else self.centres[members]
        return descended(centres, points, self.objective)

    def judge(self, points):
        self.asked += 1
        return np.asarray(judged(self.centres, points, self.objective))


def test_values_and_points_are_each_others_inverse():
    values = {"size": np.array([0.3, 4.0]), "shift": np.array([-0.7, 2.0])}
    back = BOX.values(BOX.point(values))
    assert BOX.point(values).shape == (2, 2)
    for name in values:
        np.testing.assert_allclose(back[name], values[name], rtol=1e-12)
    low, high = BOX.limits
    np.testing.assert_allclose(BOX.values(low)["shift"], -1.0)
    assert BOX.on_limit(np.array([low[0], 0.0])) == ["size"] and BOX.on_limit(high) == ["size", "shift"]


@pytest.mark.parametrize("method, iterations", [("adam", 150), ("lbfgs", 25)])
def test_descent_finds_the_least_from_every_start(method, iterations):
    starts = np.stack([BOX.point({"size": s, "shift": t}) for s, t in ((0.5, 2.0), (8.0, -0.9))])
    compiled = []

    @jax.jit
    def costs_and_gradients(points):
        compiled.append(1)
        return bowl(points), jax.grad(lambda x: bowl(x).sum())(points)

    seen, descent = [], Descent(starts)
    descent.run(
        lambda _, points: costs_and_gradients(points),
        BOX,
        iterations=iterations,
        learning_rate=0.1,
        method=method,
        progress=lambda *x: seen.append(x),
    )
    for values in zip(*BOX.values(descent.best_points).values()):
        assert values == (pytest.approx(2.0, rel=0.02), pytest.approx(-0.5, abs=0.02))
    assert len(descent.history) == iterations and seen[-1][:2] == (iterations, iterations) and len(compiled) == 1


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
def test_descent_stays_in_the_box(method):
    seen = []

    def uphill(_, points):
        seen.append(points)
        return -points.sum(axis=1), -np.ones_like(points)

    start = BOX.point({"size": 9.0, "shift": 2.5})[None]
    Descent(start).run(uphill, BOX, iterations=40, learning_rate=0.2, method=method)
    low, high = BOX.limits
    assert all(np.all((low <= points) & (points <= high)) for points in seen)
    np.testing.assert_allclose(seen[-1][0], high)


@pytest.mark.parametrize("method", ["adam", "lbfgs"])
def test_descent_passes_over_a_gradient_that_is_not_a_number(method):
    calls = []

    def costs_and_gradients(_, points):
        calls.append(1)
        gradients = jax.grad(lambda x: bowl(x).sum())(jnp.asarray(points))
        return bowl(points), gradients * np.nan if len(calls) == 3 else gradients

    descent = Descent(BOX.point({"size": 8.0, "shift": 2.0})[None])
    descent.run(costs_and_gradients, BOX, iterations=120, learning_rate=0.1, method=method)
    assert float(descent.best[0]) < 1e-2


def test_descent_ends_when_nothing_gets_better():
    descent = Descent(np.zeros((1, 2)))
    descent.run(lambda _, x: (np.ones(1), np.ones((1, 2))), BOX, iterations=50, learning_rate=0.1, patience=4)
    assert len(descent.history) == 5


def test_evolution_refines():
    first = BOX.point({"size": 5.0, "shift": 1.0})[None]
    best, cost = refine(lambda x: np.asarray(bowl(x)), BOX, first, rounds=12, count=40, widest=0.5, seed=1)
    assert cost < 1e-2 and cost == pytest.approx(float(bowl(best)))


LOSSES = np.array([[1.0, 5.0], [2.0, 2.0], [3.0, 2.0], [4.0, 1.0]])


@pytest.mark.parametrize(
    "objective, costs",
    [
        (Objective("mean"), [2.5, 2.5]),
        (Objective("worst"), [4.0, 5.0]),
        (Objective("balanced"), [0.9 * 2.5 + 0.1 * 4, 0.9 * 2.5 + 0.1 * 5]),
        (Objective("cvar", 0.5), [3.5, 3.5]),
        (Objective("cvar", 0.3), [3.5, 3.5]),
        (Objective("mean_and_cvar", 0.5), [3.0, 3.0]),
        (Objective("cvar", 0.01), [4.0, 5.0]),
        (Objective("power"), np.mean(LOSSES**6, axis=0) ** (1 / 6)),
    ],
)
def test_objectives_by_hand(objective, costs):
    np.testing.assert_allclose(objective.costs(jnp.asarray(LOSSES)), costs, rtol=1e-12)
    np.testing.assert_allclose(objective.costs(jnp.asarray(LOSSES), smooth=True), costs, rtol=1e-3)


def test_the_worst_half_is_served_by_cvar():
    """Of bowls around scattered centres each objective finds a set that is best by its own measure."""
    search = SearchConfig(**{**SEARCH.to_json(), "refinements": 15})
    objectives = [Objective("mean"), Objective("cvar", 0.5), Objective("worst")]
    found = [fit(Bowls(objective), search).point for objective in objectives]
    for i, objective in enumerate(objectives):
        own = objective.costs(Bowls().losses(np.stack(found)))
        assert float(own[i]) <= float(own.min()) + 2e-4 and float(own[i]) < float(own.max()) - 1e-3


@pytest.mark.parametrize("changes", [{}, {"method": "lbfgs"}, {"batch": 2}, {"evolutions": 2}])
def test_a_fit_beats_its_start_and_repeats(changes):
    search = SearchConfig(**{**SEARCH.to_json(), **changes})
    problem = Bowls()
    first, second = fit(problem, search), fit(Bowls(), search)
    np.testing.assert_array_equal(first.point, second.point)
    assert first.cost == float(problem.judge(first.point[None])[0]) < 0.3 < float(problem.judge(problem.given)[0])
    assert first.values == {name: float(v) for name, v in BOX.values(first.point).items()}
    assert np.shape(first.history) == (40, 3) and not first.interrupted


def test_a_search_that_gives_its_start_back_says_so():
    there = {name: float(value) for name, value in BOX.values(Bowls().given[0]).items()}
    assert unmoved({"fixed": 0.3, **there}, {name: value * (1 + 1e-14) for name, value in there.items()})
    moved = {**there, BOX.names[-1]: 1.001 * there[BOX.names[-1]]}
    assert unmoved(there, fit(Bowls(), SEARCH).values) == unmoved(there, moved) == []


class Killed(BaseException):
    """What no fit catches, like the end of the process."""


def killed_after(problem, count):
    """A problem that ends the process after so many evaluations."""

    def ending(function):
        def evaluate(*arguments):
            if problem.asked >= count:
                raise Killed
            return function(*arguments)

        return evaluate

    problem.judge, problem.costs_and_gradients = ending(problem.judge), ending(problem.costs_and_gradients)
    return problem


@pytest.mark.parametrize("count, cut", [(1, 0), (15, 0), (41, 0), (43, 7)])
@pytest.mark.parametrize("changes", [{}, {"method": "lbfgs", "batch": 3}])
def test_a_run_that_was_killed_goes_on_to_the_identical_result(count, cut, changes, tmp_path):
    """In the screening, the descent, the evolution; and with the last record cut short."""
    search, path = SearchConfig(**{**SEARCH.to_json(), **changes}), tmp_path / "journal"
    whole = fit(Bowls(), search)
    with pytest.raises(Killed):
        fit(killed_after(Bowls(), count), search, journal=Journal(path, {"run": 1}))
    assert identity_of(path) == {"run": 1}
    if cut:
        path.write_bytes(path.read_bytes()[:-cut])
    rest = Bowls()
    resumed = fit(rest, search, journal=Journal(path, {"run": 1}, resume=True))
    np.testing.assert_array_equal(resumed.point, whole.point)
    assert (resumed.cost, resumed.history) == (whole.cost, whole.history)
    assert rest.asked == 45 - count + bool(cut)
    again = Bowls()
    fit(again, search, journal=Journal(path, {"run": 1}, resume=True))
    assert again.asked == 0


def test_a_journal_of_another_run_is_refused(tmp_path):
    path = tmp_path / "journal"
    with pytest.raises(ValueError, match="no such file; there is no run to resume"):
        Journal(path, {}, resume=True)
    fit(Bowls(), SEARCH, journal=Journal(path, {"config": {"seed": 0}}))
    with pytest.raises(ValueError, match=r"the run is of config = \{'seed': 0\}, not \{'seed': 1\}"):
        Journal(path, {"config": {"seed": 1}}, resume=True)
    with pytest.raises(ValueError, match="evaluation 1 is not that of this run"):
        other = SearchConfig(**{**SEARCH.to_json(), "seed": 5})
        fit(Bowls(), other, journal=Journal(path, {"config": {"seed": 0}}, resume=True))
    path.write_bytes(b"nothing of the kind, but long enough to hold a header of a record")
    with pytest.raises(ValueError, match="not the journal of a run"):
        Journal(path, {}, resume=True)


@pytest.mark.parametrize("count", [0, 1, 2, 20, 43])
def test_interrupted_it_returns_the_best_there_is(count):
    """Before the first iteration there is none."""
    problem = killed_after(Bowls(), count)

    def interrupting(function):
        def evaluate(*arguments):
            try:
                return function(*arguments)
            except Killed:
                raise KeyboardInterrupt from None

        return evaluate

    problem.judge, problem.costs_and_gradients = map(interrupting, (problem.judge, problem.costs_and_gradients))
    if count < 2:
        with pytest.raises(KeyboardInterrupt):
            fit(problem, SEARCH)
        return
    found = fit(problem, SEARCH)
    assert found.interrupted and len(found.history) == min(count - 1, 40)
    best = float(Objective().costs(Bowls().losses(found.point[None]))[0])
    assert best <= float(Objective().costs(Bowls().losses(BOX.valid(problem.given)))[0])


@pytest.mark.parametrize("changes", [{"batch": 6, "refinements": 2}, {"patience": 1, "refinements": 0}])
def test_what_is_said_to_be_kept_is_what_an_interruption_keeps(changes, tmp_path):
    """All along the search, whatever ends it; before its first iteration and after it there is nothing to write."""
    problem, said = ManyBowls(), []
    search = SearchConfig(**{**SEARCH.to_json(), **changes})

    def telling(function):
        def evaluate(*given):
            said.append(interruption.kept())
            return function(*given)

        return evaluate

    def run(progress, journal):
        problem.judge, problem.costs_and_gradients = telling(problem.judge), telling(problem.costs_and_gradients)
        fit(problem, search, progress=progress, journal=journal)
        said.append(interruption.kept())

    tuned("a command", search, tmp_path, run)
    before, *during, after = (line for line in said if line != "nothing is found yet")
    assert before == after == f"no result is written; every evaluation is kept in {tmp_path / 'journal'}"
    assert len(during) > 2 and all("the best set by then is judged and written" in line for line in during)


def test_more_than_there_is_is_refused():
    with pytest.raises(ConfigError, match="batch = 6 must be at most the 5 members"):
        fit(Bowls(), SearchConfig(**{**SEARCH.to_json(), "batch": 6}))


def test_chunks_have_one_shape_and_join_again():
    shapes = []

    def double(chunk):
        shapes.append(chunk.shape)
        return {"rows": 2 * chunk, "columns": chunk.T}

    points = np.arange(14.0).reshape(7, 2)
    joined = in_chunks(lambda chunk: double(chunk)["rows"], points, 3)
    np.testing.assert_array_equal(joined, 2 * points)
    np.testing.assert_array_equal(in_chunks(lambda chunk: double(chunk)["columns"], points, 3, axis=-1), points.T)
    assert set(shapes) == {(3, 2)}


def test_generations_before_the_descent_begin_it_where_it_is_low(tmp_path):
    """From one start, far off: evolution of what random starts are chosen by is what is descended from."""
    few = {"starts": 1, "screened": 4, "iterations": 1, "refinements": 0}
    begun = {n: fit(Bowls(), SearchConfig(generations=n, **few)).history[0][0] for n in (0, 12)}
    assert begun[12] < 0.15 < 3 < begun[0]
    path, search = tmp_path / "journal", SearchConfig(generations=3, **few)
    first, again = fit(Bowls(), search, journal=Journal(path)), Bowls()
    resumed = fit(again, search, journal=Journal(path, resume=True))
    assert again.asked == 0
    np.testing.assert_array_equal(resumed.point, first.point)
    several = SearchConfig(generations=12, **{**few, "starts": 3})
    costs = fit(Bowls(), several).history[0]
    assert costs[0] < 0.15 and costs[1] == begun[0]


class ManyBowls(Bowls):
    """Bowls that can be judged on some of them."""

    def __init__(self, centres=None, counted=None):
        super().__init__()
        drawn = 0.3 * np.random.default_rng(0).normal(size=(60, 2))
        self.centres, self.counted = drawn if centres is None else centres, [] if counted is None else counted
        self.members = len(self.centres)

    def on(self, members):
        return ManyBowls(self.centres[members], self.counted)

    def judge(self, points):
        self.counted.append(len(points) * self.members)
        return super().judge(points)


def test_generations_on_members_drawn_for_each_find_what_is_best_on_all(tmp_path):
    """At less than a third of the stops; what counts is judged on all, and a run goes on from its journal."""
    few = {"starts": 1, "screened": 4, "iterations": 1, "generations": 12, "refinements": 12}
    path, counts, found, told = tmp_path / "journal", {}, {}, []
    for batch in (None, 6):
        problem, journal = ManyBowls(), Journal(path)
        search = SearchConfig(batch=batch, **few)
        found[batch] = fit(problem, search, journal=journal, progress=lambda *x: told.append(x))
        counts[batch] = sum(problem.counted)
        assert found[batch].cost == float(problem.judge(found[batch].point[None])[0])
    least = float(ManyBowls().judge(BOX.point(LEAST)[None] - ManyBowls().centres.mean(axis=0))[0])
    assert all(least <= run.cost < least + 2e-3 for run in found.values())
    assert counts[6] < 0.3 * counts[None]
    assert [done for done, *_ in told[:25]] == list(range(1, 26)) and told[0][1] == 25
    again = ManyBowls()
    resumed = fit(again, search, journal=Journal(path, resume=True))
    assert not again.counted
    np.testing.assert_array_equal(resumed.point, found[6].point)
