"""The sensitivity equations of a braked wheel: what a log should show, and its derivatives by what is fitted to it.

Beside the state x of a wheel, w and where it is not imposed v, its sensitivities S = dx / dp are rolled out,

    x' = f(x, p),     S' = (df / dx) S + df / dp

with f of `tuning.road.output_error`.
"""

from functools import partial

import jax
import jax.numpy as jnp

from absjax.plant.wheel import GRAVITY
from tuning.road.curve import Curve

OF_CAR = (
    "radius",
    "inertia",
    "brake_efficiency",
    "load",
    "pressure_zero",
    "pressure_lag",
    "load_lag",
    "slope",
)
"""The car's quantities that the equations of motion have."""


@partial(jax.jit, static_argnames=("curve", "imposed", "substeps"))
def linearised(
    curve: Curve,
    imposed: bool,
    substeps: int,
    period,
    coefficients,
    car,
    own,
    pressure,
    by_lag,
    share,
    by_load_lag,
    speed,
):
    """Outputs, three arrays (samples, lanes), and their derivatives, three arrays (samples, parameters, lanes).

    Parameters of a lane: the coefficients of its surface, then the quantities `OF_CAR`, what an imposed speed is off,
    and its own state. Lanes come last in all arrays: they are what the processor's vectors run along.

    Args:
        curve, imposed: of the intervals.
        substeps: Runge-Kutta steps of a sample.
        period: of the samples [s].
        coefficients: (coefficients, lanes).
        car: the quantities `OF_CAR`, of which the lags are in the signals already.
        own: (states, lanes).
        pressure, by_lag, share, by_load_lag: behind their lags, and by them, (samples, lanes).
        speed: of the vehicle, if it is imposed, (samples, lanes).
    """
    radius, inertia, efficiency, load, zero, _, _, slope = car
    (size, lanes), states, step = coefficients.shape, len(own), period / substeps
    first_of_car, offset, first_of_own = size, size + len(OF_CAR), size + len(OF_CAR) + imposed
    parameters = first_of_own + states

    def rows(first, *values):
        """(parameters, lanes): the values from row `first` on, else 0."""
        some = jnp.stack([jnp.broadcast_to(value, lanes) for value in values])
        after = parameters - first - len(values)
        return jnp.concatenate([jnp.zeros((first, lanes)), some, jnp.zeros((after, lanes))])

    def of_curve(slip, coefficients):
        mu = curve.tyre(coefficients).friction(slip)
        return mu, mu

    slopes_of_curve = jax.vmap(jax.jacfwd(of_curve, argnums=(0, 1), has_aux=True), in_axes=(0, 1), out_axes=((0, 1), 0))

    def friction(w, v, by_w, by_v):
        """mu(R w / v - 1), and its derivatives."""
        ratio = w / v
        (by_slip, by_coefficients), mu = slopes_of_curve(radius * ratio - 1, coefficients)
        return mu, by_slip * radius / v * (by_w - ratio * by_v) + rows(0, *by_coefficients, by_slip * ratio)

    def over_sample(state, ends):
        def flow(at, state):
            p, p_by_lag, n, n_by_lag, v = (x + at * rise for x, rise in ends)
            w, by_w = state[:2]
            v, by_v = (v, rows(offset, 1.0)) if imposed else state[2:]
            mu, by_mu = friction(w, v, by_w, by_v)
            spin = -(radius * load * n * mu + efficiency * p) / inertia
            by_spin = -(radius * load * n / inertia) * by_mu + rows(
                first_of_car,
                -load * n * mu / inertia,
                -spin / inertia,
                -p / inertia,
                -radius * n * mu / inertia,
                efficiency / inertia,
                -efficiency * p_by_lag / inertia,
                -radius * load * n_by_lag * mu / inertia,
            )
            braking = (GRAVITY * (mu + slope), GRAVITY * (by_mu + rows(first_of_car + OF_CAR.index("slope"), 1.0)))
            return (spin, by_spin) if imposed else (spin, by_spin, *braking)

        def over_step(state, k):
            at = k / substeps

            def moved(by, slopes):
                return [x + by * slope for x, slope in zip(state, slopes)]

            k1 = flow(at, state)
            k2 = flow(at + 0.5 / substeps, moved(0.5 * step, k1))
            k3 = flow(at + 0.5 / substeps, moved(0.5 * step, k2))
            k4 = flow(at + 1 / substeps, moved(step, k3))
            return tuple(x + step / 6 * (a + 2 * (b + c) + d) for x, a, b, c, d in zip(state, k1, k2, k3, k4)), None

        state, _ = jax.lax.scan(over_step, state, jnp.arange(substeps, dtype=own.dtype))
        return state, state

    ends = [(x[:-1], jnp.diff(x, axis=0)) for x in (pressure - zero, by_lag, share, by_load_lag, speed)]
    start = [part for i, x in enumerate(own) for part in (x, rows(first_of_own + i, 1.0))]
    _, path = jax.lax.scan(over_sample, tuple(start), ends)
    w, by_w, *vehicle = (jnp.concatenate([first[None], later]) for first, later in zip(start, path))
    v, by_v = (speed, jnp.broadcast_to(rows(offset, 1.0), by_w.shape)) if imposed else vehicle
    mu, by_mu = jax.vmap(friction)(w, v, by_w, by_v)
    return (w, v, GRAVITY * mu), (by_w, by_v, GRAVITY * by_mu)
