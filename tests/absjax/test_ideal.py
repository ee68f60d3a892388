"""No controller beats the ideal stop: a thousand random sets of every controller, on constant and changing roads."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.controllers.bosch import BoschLogic
from absjax.controllers.five_phase import FivePhase
from absjax.controllers.production import ProductionLogic
from absjax.controllers.slip import SlipControl
from absjax.controllers.stiffness import StiffnessControl
from absjax.controllers.tracking import AccelerationTracking
from absjax.controllers.two_phase import TwoPhase
from absjax.loop.closed_loop import ClosedLoop
from absjax.loop.driver import Driver
from absjax.loop.ideal import ideal_distance
from absjax.loop.stop import Outcome, stop
from absjax.plant.brake import Brake
from absjax.plant.quarter_car import QuarterCar
from absjax.plant.road import ChangingRoad
from absjax.plant.wheel import Wheel
from absjax.tyres.burckhardt import Burckhardt
from absjax.tyres.surfaces import SURFACES
from tests.attack.stops import random_controller

SETS, END = 1000, 3.0
CONTROLLERS = (
    FivePhase,
    AccelerationTracking,
    TwoPhase,
    StiffnessControl,
    SlipControl,
    BoschLogic,
    ProductionLogic,
)


def scattered_loop(controller, rng) -> ClosedLoop:
    """A third of the roads is of one surface; the others change twice, under a foot stronger than they are."""
    names = list(SURFACES)
    which = rng.integers(len(names), size=(3, SETS))
    which[1:, : SETS // 3] = which[0, : SETS // 3]
    surfaces = tuple(
        Burckhardt(*(np.array([float(getattr(SURFACES[names[i]], c)) for i in row]) for c in ("c1", "c2", "c3")))
        for row in which
    )
    first = rng.uniform(1.0, 15.0, SETS)
    road = ChangingRoad(surfaces, (first, first + rng.uniform(1.0, 10.0, SETS)), 0.5, "distance")
    largest = np.where(np.arange(SETS) < SETS // 3, rng.uniform(20.0, 150.0, SETS), rng.uniform(60.0, 150.0, SETS))
    driver = Driver(rng.uniform(100.0, 1500.0, SETS), rng.uniform(0.0, 0.2, SETS), largest)
    return ClosedLoop(QuarterCar(Wheel(), road), Brake(rate_limit=750.0, lag=5e-3), controller, END, driver=driver)


@pytest.mark.parametrize("model", CONTROLLERS)
def test_no_controller_beats_the_ideal(model):
    rng = np.random.default_rng(7)
    loop = scattered_loop(random_controller(model, rng, SETS, spread=0.7, room=0.0), rng)
    speed = jnp.asarray(rng.uniform(8.0, 25.0, SETS))
    stopped = stop(loop, speed, horizon=4.0, max_events=150, tile=SETS)
    ideal = np.asarray(ideal_distance(loop, speed, horizon=4.0))
    ended = np.asarray(stopped.outcome) == Outcome.STOPPED
    assert ended.sum() > SETS / 4 and np.isfinite(ideal[ended]).all()
    ratio = np.asarray(stopped.distance)[ended] / ideal[ended]
    assert ratio.min() > 1 - 1e-7 and ratio.min() < 1.05
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(stopped._replace(published_quantity=0.0)))
