"""Steps of a hybrid automaton by hand: to the next switching by SciPy, and one Runge-Kutta step of a plain loop."""

from scipy.integrate import solve_ivp


def until_switching(flow, guards, t, y, end, **options):
    """DOP853 until the first of guards (t, y) -> values rises through zero, or the end: time, state, its index or
    None."""

    def event_of(i):
        def event(t, y):
            values = guards(t, y)
            return values[i] if i < len(values) else -1.0

        event.terminal, event.direction = True, 1
        return event

    events = [event_of(i) for i in range(len(guards(t, y)))]
    run = solve_ivp(flow, (t, end), y, "DOP853", events=events, **{"rtol": 1e-10, "atol": 1e-10, **options})
    fired = next((i for i, times in enumerate(run.t_events) if len(times)), None)
    return run.t[-1], run.y[:, -1].copy(), fired


def runge_kutta(flow, y, step):
    """One step of the classical scheme; flow(y)."""
    k1 = flow(y)
    k2 = flow(y + step / 2 * k1)
    k3 = flow(y + step / 2 * k2)
    return y + step / 6 * (k1 + 2 * k2 + 2 * k3 + flow(y + step * k3))
