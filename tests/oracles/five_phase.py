"""The five-phase automaton by hand; `p` has its thresholds and rates, the phases are numbered as in the source."""


def rate(phase, rim, p):
    """bar/s; none in phase 0, where the driver brakes."""
    return [0.0, -p.u1, 0.0, p.u3, p.u4, 0.0][phase] / rim


def edges(phase, x2, p):
    """(guard, following phase) as published; a guard fires where it rises through zero, the first of them first."""
    onward = [-p.eps0 - x2, x2 - p.eps1, x2 - p.eps2, p.eps3 - x2, -p.eps4 - x2, -p.eps5 - x2][phase]
    ways = [(onward, 1 if phase == 5 else phase + 1)]
    return [*ways, (p.fallback * p.eps1 - x2, 4)] if phase == 2 else ways


def ways(phase, x2, spent, p, rim, v):
    """The same with what is the project's own: out of a release that lasts, of pressure applied to a wheel that stands,
    and of a hold the wheel recovers in; and no pressure from a release or its hold before the slip is back."""
    found = edges(phase, x2, p)
    recovered = rim - (1 + p.recovered_slip) * v if p.recovered_slip > -1 else 1e9
    if phase == 2:
        (onward, three), (fallen, four) = found
        return [(min(onward, recovered), three), (fallen, 1 if recovered < 0 else four)]
    stands = min(0.1 - rim, spent - 0.02), 1
    overdue = min(spent - p.longest_release, recovered), 4
    others = {1: overdue, 3: stands, 4: stands, 5: (x2 + p.fallback * p.eps4, 4)}
    return [*found, others[phase]] if phase in others else found
