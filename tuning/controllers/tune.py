"""An anti-lock controller tuned over a batch of roads, speeds and pedals: its problem, the fit, and the result."""

from collections.abc import Callable

import jax
import numpy as np

from absjax.loop.growth import is_unstable
from absjax.loop.step_check import differs
from tuning.cars.lifting import lifting
from tuning.controllers.batch import at_half_step, scored
from tuning.controllers.config import TuningConfig
from tuning.controllers.cycles import certify_cycles
from tuning.controllers.phase_times import short_phases
from tuning.controllers.problem import ControllerProblem, problem_of
from tuning.controllers.result import ResultRow, TuningResult
from tuning.controllers.rows import rows_of
from tuning.controllers.running import RunningProblem, running_problem
from tuning.controllers.splits import SplitFigures, all_splits
from tuning.core.descent import Progress
from tuning.core.fit import fit, unmoved
from tuning.core.journal import Journal
from tuning.core.report import cell

WHICH = ("untuned", "tuned")


def tune_abs(
    config: TuningConfig,
    *,
    progress: Progress = lambda i, n, cost: None,
    journal: Journal | None = None,
    say: Callable[[str], None] = lambda text: None,
) -> TuningResult:
    """Tune a controller as the configuration says.

    Args:
        config: what to tune.
        progress: called with iteration, iterations and the best cost so far.
        journal: where evaluations are kept, to go on from.
        say: told of what costs have in them that is no distance, and of every step in which what was found is judged.

    Raises:
        ConfigError: naming the entry that cannot be used.
    """
    problem = problem_of(config) if config.setting == "located" else running_problem(config)
    fitted = fit(problem, config, progress=_telling(problem, progress, say), journal=journal)
    parameters, splits = problem.setup.initial | fitted.values, []
    if config.setting != "located":
        splits = all_splits(problem.setup, {"untuned": problem.setup.initial, "tuned": parameters}, say)
    rows, breached = score(problem, parameters, say), None
    if problem.regulation is not None:
        say("screening after the regulation ...")
        breached = problem.regulation.breached(parameters)
    say("lengths of the phases ...")
    short = short_phases(problem.setup, problem.batch, parameters)
    if config.vehicle is None:
        say("limit cycles ...")
    return TuningResult(
        parameters=parameters,
        rows=rows,
        splits=splits,
        warnings=[
            *unmoved(problem.setup.initial, parameters),
            *with_charge(problem, fitted.cost),
            *lifting(config.vehicle, config.roads),
            *short,
            *unstable_stops(rows),
            *of_another_step(rows),
            *worse_apart(splits, config.began),
        ],
        breached=breached,
        cycles=certify_cycles(problem.setup, parameters),
        cost=fitted.cost,
        history=fitted.history,
        on_limit=fitted.on_limit,
        config=config,
        interrupted=fitted.interrupted,
    )


def charged_for(problem: ControllerProblem | RunningProblem) -> str:
    """What a set is charged `problem.charge` for; nothing where it is not charged."""
    causes = {
        "a stop that does not end, or that locks, slides or takes a cycle for longer than allowed": isinstance(
            problem, RunningProblem
        ),
        "a limit cycle beyond largest_contraction": problem.setup.config.largest_contraction is not None,
        "a row of the regulation that is breached": problem.regulation is not None,
    }
    return ", or for ".join(cause for cause, charged in causes.items() if charged)


def with_charge(problem: ControllerProblem | RunningProblem, cost: float) -> list[str]:
    """A sentence if the cost of a set has a charge in it."""
    causes = charged_for(problem)
    if not causes or cost < problem.charge:
        return []
    return [f"no set was found without a charge: the cost of {cost:.4f} has one in it, for {causes}"]


def _telling(problem: ControllerProblem | RunningProblem, progress: Progress, say: Callable[[str], None]) -> Progress:
    """`progress` that says, with the first cost that has a charge in it, what that is."""
    told = []

    def tell(done: int, total: int, cost: float) -> None:
        progress(done, total, cost)
        causes = charged_for(problem)
        if causes and cost >= problem.charge and not told:
            told.append(cost)
            say(f"a cost from {problem.charge:g} on has a charge in it, for {causes}: any set without is better")

    return tell


def score(
    problem: ControllerProblem | RunningProblem, parameters: dict[str, float], say: Callable[[str], None]
) -> list[ResultRow]:
    """The stops of the configured start and of tuned parameters, located, and those sampled."""
    setup, batch = problem.setup, problem.batch
    tuned = {name: parameters[name] for name in problem.box.names}
    both = {name: np.array([setup.initial[name], value]) for name, value in tuned.items()}
    say("stops on every road from every speed, located and sampled ...")
    located, sampled = scored(batch, both), scored(batch, both, *setup.sampled_grid())
    say("the same at half the grid step ...")
    halved, growths = at_half_step(batch, tuned)
    another = differs(jax.tree.map(lambda leaf: leaf[:, 1], located.stops), halved)
    vehicle = setup.config.vehicle
    cars = ("",) if vehicle is None or len(vehicle.each) == 1 else tuple(one.name for one in vehicle.each)
    rows = [
        ResultRow(
            road=row.name,
            speed_kmh=row.speed_kmh,
            pedal_bar_s=row.pedal_rate,
            ideal=float(batch.ideal[i]),
            published_ideal=row.published_ideal,
            published=None if vehicle is not None else row.published(setup.config.controller),
            untuned=located.figures(i, 0),
            tuned=located.figures(i, 1),
            sampled=sampled.figures(i, 1),
            growth=float(growths[i]) if np.isfinite(growths[i]) else None,
            at_half_step=float(halved.distance[i]) if another[i] else None,
            car=cars[row.which],
        )
        for i, row in enumerate(rows_of(setup.config))
    ]
    return sorted(rows, key=lambda row: (cars.index(row.car), row.speed_kmh, row.ideal or 0.0))


def unstable_stops(rows: list[ResultRow]) -> list[str]:
    """A sentence for every row whose tuned stop is unstable."""
    return [
        f"{row.where}: the tuned stop is unstable, a small change of the initial speed changes "
        f"the distance {_times(row.growth)} (2 times is regular); with any other circumstance it is another, and its "
        "gradient says little"
        for row in rows
        if row.growth is None or is_unstable(row.growth)
    ]


def of_another_step(rows: list[ResultRow]) -> list[str]:
    """A sentence for every row whose tuned stop is another at half the grid step."""
    return [
        f"{row.where}: at half the grid step the tuned stop is another, {row.at_half_step:.3f} for "
        f"{cell(row.tuned.distance, 3)} m: the errors of the steps decide on which side of a switching it passes"
        for row in rows
        if row.at_half_step is not None
    ]


def worse_apart(splits: list[SplitFigures], began: str) -> list[str]:
    """A sentence where validation refutes a set: one it was not tuned on breaks a limit, or it is no better than what
    the search began with.

    Args:
        began: what that is called (`tuning.controllers.config.TuningConfig.began`).
    """
    untuned, tuned = ({row.which: row for row in splits if row.split == "validation"}.get(w) for w in WHICH)
    if untuned is None or tuned is None:
        return []
    found, name = [], "the start" if began == "start" else f"the {began} one"
    if not tuned.feasible:
        found.append(f"in validation {_broken(tuned)}")
    if untuned.mean is not None and (tuned.mean is None or tuned.mean >= untuned.mean):
        means = " and ".join("-" if mean is None else f"{100 * (mean - 1):.1f}" for mean in (tuned.mean, untuned.mean))
        but = "" if untuned.feasible else f"; of {name} {_broken(untuned)}, which no distance makes good"
        found.append(f"in validation the tuned set is no shorter than {name}, {means} % above ideal in the mean{but}")
    return found


def _broken(figures: SplitFigures) -> str:
    """How often a set breaks each limit."""
    return (
        f"{figures.unfinished} of {figures.stops} stops do not end, {figures.locked} lock above 15 km/h, "
        f"{figures.slid or 0} slide, {figures.stuck} stick"
    )


def _times(growth: float | None) -> str:
    if growth is None:
        return "beyond all bounds"
    return f"{abs(growth):.3g} times as much" + (", the other way" if growth < 0 else "")
