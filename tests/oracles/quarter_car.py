"""A quarter car by hand: v' = g mu(slip), J w' = -R N mu(slip) - gamma P, with Burckhardt's friction."""

import numpy as np

INERTIA, RADIUS, LOAD, BRAKE, GRAVITY = 1.2, 0.3, 2500.0, 17.5, 9.81
A, B = RADIUS**2 * LOAD / INERTIA, RADIUS * BRAKE / INERTIA


def coefficients(tyre):
    """c1, c2, c3 as floats."""
    return tuple(float(c) for c in (tyre.c1, tyre.c2, tyre.c3))


def friction(v, w, c):
    c1, c2, c3 = c
    slip = RADIUS * w / v - 1
    return np.sign(slip) * c1 * (1 - np.exp(-c2 * abs(slip))) - c3 * slip


def spin(v, w, pressure, c):
    """w'"""
    return (-RADIUS * LOAD * friction(v, w, c) - BRAKE * pressure) / INERTIA


def offset(v, w, pressure, c):
    """x2 = R w' - v'"""
    return RADIUS * spin(v, w, pressure, c) - GRAVITY * friction(v, w, c)
