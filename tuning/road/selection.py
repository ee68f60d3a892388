"""Which of the car's quantities a log says are not what they are known as.

What the car file gives with a standard deviation is free within it. Of the others the fewest are freed that make the
fit as good as all of them would: each costs precision, and all of them together leave the road open, since a drag of
the brake, a slope and a bias of the accelerometer look alike.
"""

from collections.abc import Callable, Iterable

from tuning.road.arrow_fit import Fit

LEAST = 0.2
"""Share of what all of them would bring that one has to bring."""
TOGETHER = frozenset({"radius", "inertia", "brake_efficiency", "pressure_zero"})
"""Where one of these is not as known, the others are not believed either, if the log tells them all."""
WORTH = 12.0
"""Fall of the sum of squares that a freed quantity has to bring; times the fit's inflation."""


def selected(
    fit: Callable[[frozenset[str]], Fit],
    always: Iterable[str],
    candidates: Iterable[str],
    together: frozenset[str] = frozenset(),
) -> tuple[frozenset[str], Fit]:
    """The quantities to be free, and the fit with them.

    Args:
        fit: the fit with given quantities free, residuals weighted alike for all.
        always: free in any case.
        candidates: that may be freed.
        together: those that are freed all at once, if one of them is.
    """
    free, left = frozenset(always), list(candidates)
    best = fit(free)
    whole = fit(free | frozenset(left))
    while left and best.cost - whole.cost > WORTH * whole.inflation:
        trials = {name: fit(free | {name}) for name in left}
        name = min(trials, key=lambda n: trials[n].cost)
        if best.cost - trials[name].cost <= LEAST * (best.cost - whole.cost):
            break
        added = together & frozenset(left) if name in together else frozenset([name])
        best = trials[name] if added == {name} else fit(free | added)
        free, left = free | added, [other for other in left if other not in added]
    return free, best
