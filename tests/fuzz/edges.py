"""Mutated logs of edges: each is read right, refused by name, or called doubtful. `python -m tests.fuzz.edges`

Every seed makes a wheel, a profile and disturbances, and two mutations of the file. A log is silently wrong if it is
called sound and speed or acceleration are off where they are called valid.
"""

import collections
import dataclasses
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tests.oracles.edge_simulator import WHEELS, Pickup, Profile
from tuning.logs.edge_speed import study_of
from tuning.logs.edges import read_edges
from tuning.logs.tables import LogError

COUNT = 200
LIMIT = 30
"""s; what takes longer hangs"""
SPEED, LARGEST = 0.1, 3.0
"""rad/s: rms and largest error of the speed where it is valid"""
ACCELERATION = (5.0, 0.03)
"""rad/s^2 and a share of the largest: rms error of the acceleration where it is valid"""


@dataclasses.dataclass
class Case:
    """A log in the making."""

    pickup: Pickup
    stamps: np.ndarray
    options: dict[str, Any]
    lines: list[str] | None = None
    origin: float | None = None
    """s of the simulator's clock at the log's zero, if the log has lost it"""
    jump: tuple[float, float] = (np.inf, 0.0)
    """instant from which on the log's clock is ahead, and by how much [s]"""
    made: tuple[str, ...] = ()


class Outcome(NamedTuple):
    seed: int
    made: tuple[str, ...]
    word: str
    """'right', 'refused', 'doubtful', 'refuted', 'SILENTLY WRONG', 'TRACEBACK', 'HANG'"""
    said: str


def _fewer(case: Case, random, many: int) -> None:
    first = int(random.integers(0, case.stamps.size - many))
    case.stamps = np.delete(case.stamps, slice(first, first + many))


def noise_edges(case: Case, random) -> None:
    low, high = int(case.stamps.min()), int(case.stamps.max())
    extra = random.integers(low, high, int(random.integers(1, 60)))
    if case.pickup.bits is None:
        case.stamps = np.sort(np.concatenate([case.stamps, extra]))


def burst(case: Case, random) -> None:
    if case.pickup.bits is None:
        start = int(random.choice(case.stamps))
        extra = start + random.integers(0, int(0.05 / case.pickup.clock), 100)
        case.stamps = np.sort(np.concatenate([case.stamps, extra]))


def block_lost(case: Case, random) -> None:
    _fewer(case, random, int(random.integers(5, 300)))


def few_lost(case: Case, random) -> None:
    _fewer(case, random, int(random.integers(1, 5)))


def block_again(case: Case, random) -> None:
    first = int(random.integers(0, case.stamps.size - 50))
    case.stamps = np.insert(case.stamps, first + 50, case.stamps[first : first + 50])


def rows_swapped(case: Case, random) -> None:
    i = int(random.integers(0, case.stamps.size - 1))
    case.stamps[[i, i + 1]] = case.stamps[[i + 1, i]]


def row_again(case: Case, random) -> None:
    i = int(random.integers(0, case.stamps.size))
    case.stamps = np.insert(case.stamps, i, case.stamps[i])


def clock_jumps(case: Case, random) -> None:
    if case.pickup.bits is None:
        i = int(random.integers(1, case.stamps.size))
        ahead = int(random.uniform(0.01, 0.8) / case.pickup.clock)
        case.stamps[i:] += ahead
        case.jump = (case.stamps[i] * case.pickup.clock, ahead * case.pickup.clock)


def wrong_teeth(case: Case, random) -> None:
    teeth, absent = WHEELS[case.pickup.wheel]
    case.options["teeth"] = int(random.choice([teeth - 1, teeth + 1, teeth - len(absent), 2 * teeth, teeth // 2, 43]))


def coarse(case: Case, random) -> None:
    if case.pickup.bits is None:
        by = int(random.choice([4, 20, 100, 500, 1000]))
        case.stamps = case.stamps // by * by


def as_seconds(case: Case, random) -> None:
    if case.pickup.bits is None:
        form = str(random.choice(["%.6f", "%.9f", "%.7g", "%.12e"]))
        name = str(random.choice(["Time[s]", "time_s", "t"]))
        case.lines = [name, *(form % (x * case.pickup.clock) for x in case.stamps.tolist())]
        case.options.pop("clock", None)


def as_milliseconds(case: Case, random) -> None:
    if case.pickup.bits is None:
        case.lines = ["time_ms", *(f"{x * case.pickup.clock * 1e3:.3f}" for x in case.stamps.tolist())]
        case.options.pop("clock", None)


def as_periods(case: Case, random) -> None:
    if case.pickup.bits is None and (np.diff(case.stamps) > 0).all():
        case.origin = float(case.stamps[0] * case.pickup.clock)
        case.jump = (case.jump[0] - case.origin, case.jump[1])
        case.lines = ["period_us", *(f"{x * case.pickup.clock * 1e6:.0f}" for x in np.diff(case.stamps).tolist())]
        case.options.pop("clock", None)


def as_levels(case: Case, random) -> None:
    if case.pickup.bits is None and case.pickup.both is None:
        rows = ["Time [s], Channel 0"]
        steps = np.append(np.diff(case.stamps), 1000)
        for x, step in zip(case.stamps.tolist(), steps.tolist()):
            rows += [f"{x * case.pickup.clock:.9f}, 1", f"{(x + 0.45 * step) * case.pickup.clock:.9f}, 0"]
        case.lines = rows
        case.options.pop("clock", None)


def _text(change: Callable[[list[str], Any], list[str]]):
    def mutation(case: Case, random) -> None:
        lines = case.lines or ["edge_tick", *map(str, case.stamps.tolist())]
        case.lines = change(lines, random)

    mutation.__name__ = change.__name__
    return mutation


@_text
def bad_cell(lines, random):
    i = int(random.integers(1, len(lines)))
    return [*lines[:i], str(random.choice(["", "abc", "NaN", "1e99", "-5", "0", "12.5", "9" * 17])), *lines[i + 1 :]]


@_text
def cut_off(lines, random):
    return [*lines[: int(random.integers(2, len(lines)))], lines[-1][:3]]


@_text
def header_lost(lines, random):
    return lines[1:]


@_text
def with_a_counter(lines, random):
    return [f"{x};{'row' if i == 0 else i}" for i, x in enumerate(lines)]


@_text
def blank_lines(lines, random):
    return [x for line in lines for x in ([line, ""] if random.uniform() < 0.01 else [line])]


@_text
def backwards(lines, random):
    return [lines[0], *reversed(lines[1:])]


@_text
def shuffled(lines, random):
    return [lines[0], *random.permutation(lines[1:]).tolist()]


@_text
def all_alike(lines, random):
    return [lines[0], *([lines[1]] * (len(lines) - 1))]


STAMPS = (
    noise_edges, burst, block_lost, few_lost, block_again, rows_swapped, row_again, clock_jumps, wrong_teeth, coarse,
)  # fmt: skip
FILES = (
    as_seconds, as_milliseconds, as_periods, as_levels, bad_cell, cut_off, header_lost, with_a_counter, blank_lines,
    backwards, shuffled, all_alike,
)  # fmt: skip


def case_of(seed: int) -> Case:
    """The log of a seed."""
    random = np.random.default_rng(seed)
    swing, turn = float(random.uniform(5, 35)), float(random.choice([0.5, 1.0, 2.0, 4.0]))
    pickup = Pickup(
        wheel=str(random.choice(list(WHEELS))),
        profile=Profile(75.0, swing, turn),
        duration=3.0,
        begin=float(random.uniform(0.0, 50.0)),
        bits=random.choice([None, None, None, 16, 32]),
        doubled=float(random.choice([0.0, 0.01, 0.04])),
        bounce=float(random.choice([20e-6, 60e-6, 300e-6])),
        missed=float(random.choice([0.0, 0.01, 0.04])),
        dropout=float(random.choice([0.0, 0.0, 0.1])),
        both=random.choice([None, None, 0.3, 0.4, 0.46]),
        tolerance=float(random.choice([0.003, 0.01])),
        seed=seed,
    )
    case = Case(pickup, pickup.stamps(), {"teeth": pickup.teeth, "clock": pickup.clock})
    for mutate in (random.choice(np.array(STAMPS)), random.choice(np.array(FILES))):
        if random.uniform() < 0.7:
            mutate(case, random)
            case.made = (*case.made, mutate.__name__)
    return case


def judged(seed: int, folder: Path) -> Outcome:
    """What becomes of the log of a seed."""
    case = case_of(seed)
    path = folder / "edges.csv"
    path.write_text("\n".join(case.lines or ["edge_tick", *map(str, case.stamps.tolist())]) + "\n")

    def late(*_):
        raise TimeoutError

    signal.signal(signal.SIGALRM, late)
    signal.alarm(LIMIT)
    try:
        found = study_of(read_edges(path, **case.options))
    except LogError as error:
        return Outcome(seed, case.made, "refused", str(error))
    except TimeoutError:
        return Outcome(seed, case.made, "HANG", "")
    except Exception as error:
        return Outcome(seed, case.made, "TRACEBACK", repr(error))
    finally:
        signal.alarm(0)
    errors = errors_of(case, found.turning)
    right = errors[0] < SPEED and errors[1] < LARGEST and errors[2] < ACCELERATION[0] + ACCELERATION[1] * errors[3]
    said = f"speed {errors[0]:.3g} rms, {errors[1]:.3g} at most, acceleration {errors[2]:.3g}, valid {errors[4]:.2f}; "
    said += f"{'; '.join(found.reasons)}"
    if found.verdict == "sound":
        return Outcome(seed, case.made, "right" if right else "SILENTLY WRONG", said)
    return Outcome(seed, case.made, found.verdict, said)


def errors_of(case: Case, turning) -> tuple[float, ...]:
    """Rms and largest error of the speed, rms of the acceleration, its largest value, and the share that is valid."""
    pickup, valid = case.pickup, turning.valid
    if not valid.any():
        return 0.0, 0.0, 0.0, 0.0, 0.0
    time = turning.time + (case.origin or 0.0)
    if pickup.bits is not None:
        lap = (1 << pickup.bits) * pickup.clock
        time = time + lap * np.round((pickup.begin - time[0]) / lap)
        # The first edge is within a lap of the beginning.
        time = time - lap * np.floor((time[0] - pickup.begin) / lap + 1e-9)
    jumped = turning.time >= case.jump[0] - 1e-9
    time = np.where(jumped, time - case.jump[1], time)
    speed, acceleration = pickup.truth(time)
    off, other = (turning.speed - speed)[valid], (turning.acceleration - acceleration)[valid]
    rms = (float(np.sqrt(np.mean(x**2))) for x in (off, other))
    first, second = rms
    return first, float(np.abs(off).max()), second, float(np.abs(acceleration).max()), float(valid.mean())


def main(count: int = COUNT, first: int = 0) -> int:
    """Run the seeds, and say what became of them; the number of those that went wrong."""
    with tempfile.TemporaryDirectory() as folder:
        outcomes = [judged(seed, Path(folder)) for seed in range(first, first + count)]
    for outcome in outcomes:
        print(f"{outcome.seed:4d} {outcome.word:14s} {', '.join(outcome.made) or 'none':32s} {outcome.said}")
    print(dict(collections.Counter(outcome.word for outcome in outcomes)))
    return sum(outcome.word.isupper() for outcome in outcomes)


if __name__ == "__main__":
    sys.exit(min(main(*map(int, sys.argv[1:])), 1))
