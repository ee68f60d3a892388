"""Mutated brake logs through the identification: `python -m tests.fuzz.identify [--logs N --seed S]`.

Each is read right, refused by name, or comes with a verdict; what is silently wrong, ends in a traceback or does not
end within a minute is printed.
"""

import argparse
import collections
import signal
import tempfile
import traceback
from pathlib import Path

from tests.fuzz.mutate import MUTATIONS, RADIUS, mutant
from tuning.logs.brake_log import read_log
from tuning.logs.channel_map import declarations
from tuning.logs.tables import LogError
from tuning.road.identify import identify

PEAK, AT = 1.1700, 0.1700
"""Peak friction and peak slip of the original."""
NEAR, BESIDE = 0.02, 0.01
LONGEST = 60


def near(result) -> bool:
    """Whether a result is the road of the original, or has the truth in its intervals."""
    segment = max(result.segments, key=lambda s: s.end - s.start)
    low, high = segment.ci95["peak_friction"]
    close = abs(segment.peak_friction / PEAK - 1) < NEAR and abs(segment.peak_slip - AT) < BESIDE
    return close or (low <= PEAK <= high and not segment.identifiable["peak_friction"])


def outcome(name: str, seed: int, folder: Path) -> str:
    """'right', 'refused', 'doubtful', 'refuted'; else 'silent', 'wrongly refused' or 'traceback', and what was seen."""
    made = mutant(name, seed)
    path = made.written(folder)
    kinds = {answer[0] for answer in made.answers}
    try:
        result = identify(read_log(path, declarations(made.columns, None), radius=RADIUS))
    except LogError as error:
        if "refused" in kinds or "doubtful" in kinds:
            return "refused"
        return f"wrongly refused: {str(error)[-120:]}"
    except Exception:
        return "traceback: " + traceback.format_exc(limit=-2)
    if result.verdict != "sound":
        return result.verdict
    return (
        "right"
        if near(result)
        else f"silent: {result.segments[0].peak_friction:.4f} at {result.segments[0].peak_slip:.4f}"
    )


def _late(*_):
    raise TimeoutError(f"more than {LONGEST} s")


def main() -> None:
    """Print how many went how, and each that went wrong."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--logs", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    signal.signal(signal.SIGALRM, _late)
    names, counts = list(MUTATIONS), collections.Counter()
    with tempfile.TemporaryDirectory() as folder:
        for i in range(options.logs):
            name, seed = names[i % len(names)], options.seed + i // len(names)
            signal.alarm(LONGEST)
            found = outcome(name, seed, Path(folder))
            signal.alarm(0)
            counts[found.partition(":")[0]] += 1
            if ":" in found:
                print(f"{name}, seed {seed}: {found}", flush=True)
    print(f"{options.logs} logs: " + ", ".join(f"{kind} {count}" for kind, count in counts.most_common()))


if __name__ == "__main__":
    main()
