"""What stops make of a small change of the initial speed."""

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.tracking import AccelerationTracking
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.growth import is_unstable, stop_and_growth
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import SURFACES

NAMES = ("wet_asphalt", "snow")
HOW = {"horizon": 30.0, "step": 1e-3, "max_events": 800}


def test_growth_against_differences_and_where_tracking_is_unstable():
    curves = (np.array([float(getattr(SURFACES[name], c)) for name in NAMES]) for c in ("c1", "c2", "c3"))
    car = QuarterCar(Wheel(), UniformRoad(Burckhardt(*curves)))
    car = jax.tree.map(lambda x: jnp.tile(x, 3) if jnp.ndim(x) else x, car)
    loop = ClosedLoop(car, Brake(), AccelerationTracking(), stop_speed=3.0)
    # One program: the stops themselves, and those from a little more and a little less.
    speed = jnp.repeat(25.0 * jnp.array([1.0, 1 + 1e-6, 1 - 1e-6]), 2)
    stops, found = jax.jit(lambda v: stop_and_growth(loop, v, **HOW))(speed)
    stops.raise_if_failed()
    logs = np.log(np.asarray(stops.distance)).reshape(3, 2)
    np.testing.assert_allclose(found[0], (logs[1, 0] - logs[2, 0]) / 2e-6, rtol=1e-4)
    assert list(np.asarray(is_unstable(found[:2]))) == [False, True]


def test_growth_that_is_no_number_is_unstable():
    assert bool(is_unstable(jnp.nan)) and bool(is_unstable(-jnp.inf)) and not bool(is_unstable(2.3))
