"""What stops make of a small change of the initial speed."""

import jax
import jax.numpy as jnp
import numpy as np

from absjax.controllers.tracking import AccelerationTracking
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.growth import growth, is_unstable
from absjax.loop.stop import stop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import SURFACES

NAMES = ("wet_asphalt", "snow")
HOW = {"horizon": 30.0, "step": 1e-3, "max_events": 300}


def test_growth_against_differences_and_where_tracking_is_unstable():
    curves = (np.array([float(getattr(SURFACES[name], c)) for name in NAMES]) for c in ("c1", "c2", "c3"))
    car = QuarterCar(Wheel(), UniformRoad(Burckhardt(*curves)))
    loop, speed = ClosedLoop(car, Brake(), AccelerationTracking(), stop_speed=3.0), jnp.full(2, 25.0)
    found = np.asarray(jax.jit(lambda v: growth(loop, v, **HOW))(speed))
    ends = jnp.concatenate([speed * (1 + 1e-6), speed * (1 - 1e-6)])
    both = ClosedLoop(
        jax.tree.map(lambda x: jnp.tile(x, 2) if jnp.ndim(x) else x, car), Brake(), AccelerationTracking(), 3.0
    )
    stops = stop(both, ends, **HOW).raise_if_failed()
    logs = np.log(np.asarray(stops.distance)).reshape(2, 2)
    np.testing.assert_allclose(found[0], (logs[0, 0] - logs[1, 0]) / 2e-6, rtol=1e-4)
    assert list(np.asarray(is_unstable(found))) == [False, True]


def test_growth_that_is_no_number_is_unstable():
    assert bool(is_unstable(jnp.nan)) and bool(is_unstable(-jnp.inf)) and not bool(is_unstable(2.3))
