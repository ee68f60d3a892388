"""One table of all components, each held to what its kind promises: contract, round trip, bounds, lanes, single
precision, gradient."""

import json
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from absjax.contracts import require_contract
from absjax.controllers import BASELINES, CONTROLLERS, FOR_CARS, PREDICTIVE
from absjax.controllers.base import Controller
from absjax.observers import OBSERVERS
from absjax.observers.base import Design, Observer
from absjax.parameters import bounds_of, defaults_of
from absjax.plant import PLANTS
from absjax.plant.base import Plant
from absjax.plant.road import UniformRoad
from absjax.plant.wheel import Wheel
from absjax.signals import Signals
from absjax.speed import SPEED_ESTIMATORS
from absjax.speed.base import SpeedEstimator
from absjax.tyres import TYRES
from absjax.tyres.base import Tyre
from absjax.tyres.surfaces import surface

SIGNALS = Signals(
    vehicle_speed=18.0,
    vehicle_acceleration=-6.0,
    wheel_speed=52.0,
    acceleration_offset=-7.0,
    radius=0.3,
    pressure=60.0,
    stiffness=0.4,
    time=0.3,
)
WHEEL = Wheel()


class Component(NamedTuple):
    """A component of a registry: its class, scalar parameters to build it with, and numbers it works out."""

    kind: type
    contract: type
    values: dict[str, float]
    build: Callable[[dict[str, Any]], Any]
    worked_out: Callable[[Any], Any]


def of_a_tyre(tyre):
    slips = jnp.array([-0.5, -0.08, -0.01, 0.02])
    return jnp.concatenate([tyre.friction(slips), tyre.stiffness(slips), jnp.stack(tyre.peak())])


def of_a_controller(controller):
    state = controller.initial_state(SIGNALS)
    found = []
    for phase in range(len(controller.phases)):
        found += [controller.rate(SIGNALS, state, phase), *controller.guards(SIGNALS, state, phase)]
    return jnp.stack([jnp.where(jnp.isfinite(x), x, 0.0) for x in found])


def of_an_observer(design):
    observer = design.observer(WHEEL)
    state = observer.initial_state(SIGNALS.acceleration_offset)
    flow = observer.flow(state, -9.0, 18.0, 300.0)
    found = [*flow, observer.stiffness(state, -9.0)]
    return jnp.concatenate([jnp.ravel(jnp.asarray(x)) for x in jax.tree.leaves(found)])


def of_a_speed_estimator(estimator):
    state = estimator.initial_state(jnp.asarray(18.0), 2)
    for rims in ((17.9, 17.5), (17.6, 15.0)):
        state = estimator.update(state, -6.0, rims, 0.01)
    found = *jax.tree.leaves(state), estimator.speed_of(state), estimator.acceleration_of(state, -6.0)
    return jnp.stack([jnp.asarray(x) for x in found])


def of_a_plant(plant):
    state = plant.with_wheel_speed(plant.initial_state(jnp.asarray(18.0)), jnp.asarray(52.0))
    found = plant.flow(0.1, state, 60.0), plant.signals(0.1, state, 60.0)
    return jnp.stack([jnp.asarray(x) for x in jax.tree.leaves(found)])


TYRE_VALUES = {
    "burckhardt": {"c1": 0.9, "c2": 20.0, "c3": 0.3},
    "exponential_basis": {"theta0": 0.2, "theta1": 0.3, "theta2": 0.4, "rate1": 0.5, "rate2": 0.6},
    "magic_formula": {"stiffness_factor": 9.0, "shape_factor": 1.6, "peak_value": 0.9, "curvature_factor": 0.4},
}


def tyre(name, kind):
    values = TYRE_VALUES[name]
    return Component(kind, Tyre, values, lambda v: kind(**v), of_a_tyre)


def plant(kind):
    def build(values):
        own = {"speed": 18.0} if "speed" in bounds_of(kind) else {}
        return kind(Wheel(**values), UniformRoad(surface("wet_asphalt")), **own)

    wheel = {"inertia": 1.2, "radius": 0.3, "load": 2500.0, "brake_efficiency": 17.5}
    return Component(kind, Plant, wheel, build, of_a_plant)


def with_defaults(kind, contract, worked_out):
    """Those that lie on a bound, a little off it, so that they have neighbours on both sides."""
    values = {}
    for name, value in defaults_of(kind).items():
        bounds = bounds_of(kind)[name]
        values[name] = value + 0.1 * (value == bounds.low) - 0.1 * (value == bounds.high)
    return Component(kind, contract, values, lambda values: kind(**values), worked_out)


TABLE = {
    **{f"tyre {name}": tyre(name, kind) for name, kind in TYRES.items()},
    **{f"plant {name}": plant(kind) for name, kind in PLANTS.items()},
    **{
        f"controller {name}": with_defaults(kind, Controller, of_a_controller)
        for name, kind in {**CONTROLLERS, **FOR_CARS, **BASELINES, **PREDICTIVE}.items()
    },
    **{f"observer {name}": with_defaults(kind, Design, of_an_observer) for name, kind in OBSERVERS.items()},
    **{
        f"speed {name}": with_defaults(kind, SpeedEstimator, of_a_speed_estimator)
        for name, kind in SPEED_ESTIMATORS.items()
    },
}
every = pytest.mark.parametrize("component", TABLE.values(), ids=TABLE.keys())


def numbers(component, values):
    return component.worked_out(component.build(values))


COMPILED = {id(component): jax.jit(partial(numbers, component)) for component in TABLE.values()}
"""`numbers` of some values, as one program."""


def test_every_registered_component_is_in_the_table():
    controllers = CONTROLLERS, FOR_CARS, BASELINES, PREDICTIVE
    assert len(TABLE) == sum(map(len, (TYRES, PLANTS, *controllers, OBSERVERS, SPEED_ESTIMATORS)))


@every
def test_contract(component):
    built = component.build(component.values)
    require_contract(built, component.contract)
    if component.contract is Design:
        require_contract(built.observer(WHEEL), Observer)


@every
def test_round_trip_as_a_pytree_and_as_numbers(component):
    built = component.build(component.values)
    leaves, tree = jax.tree.flatten(built)
    again = jax.tree.unflatten(tree, leaves)
    assert type(again) is type(built) and again == built
    assert component.build(json.loads(json.dumps(component.values))) == built


@every
def test_bounds_are_kept_by_name(component):
    owner = Wheel if component.contract is Plant else component.kind
    tried = 0
    for name, bounds in bounds_of(owner).items():
        if name not in component.values:
            continue
        for limit, beyond, open_end in ((bounds.low, -1, bounds.open_low), (bounds.high, 1, False)):
            if not np.isfinite(limit):
                continue
            outside = limit if open_end else limit + beyond * max(1e-6, 1e-6 * abs(limit))
            with pytest.raises(ValueError, match=rf"{owner.__name__}\.{name} = "):
                component.build({**component.values, name: outside})
            tried += 1
        with pytest.raises(ValueError, match=rf"{owner.__name__}\.{name} = nan"):
            component.build({**component.values, name: float("nan")})
    assert tried or not bounds_of(owner)


@every
def test_lanes_against_one_by_one(component):
    factors = np.array([1.0, 1.02, 1.05])
    lanes = {name: value * factors for name, value in component.values.items()}
    one = COMPILED[id(component)]
    together = jax.vmap(one)(lanes)
    for i in range(len(factors)):
        alone = one({name: float(values[i]) for name, values in lanes.items()})
        np.testing.assert_allclose(together[i], alone, rtol=1e-12, atol=1e-12)


@every
def test_single_precision(component):
    double = np.asarray(numbers(component, component.values))
    single = numbers(component, jax.tree.map(jnp.float32, component.values))
    np.testing.assert_allclose(single, double, rtol=2e-4, atol=2e-4 * np.abs(double).max())


@every
def test_gradient_against_differences(component):
    one = COMPILED[id(component)]
    exact = jax.jit(jax.jacfwd(one))(component.values)
    for name, value in component.values.items():
        h = 1e-6 * max(abs(value), 1e-2)
        ends = [np.asarray(one({**component.values, name: value + e})) for e in (h, -h)]
        scale = max(np.abs(np.asarray(exact[name])).max(), 1.0)
        np.testing.assert_allclose(exact[name], (ends[0] - ends[1]) / (2 * h), rtol=1e-5, atol=1e-6 * scale)
