"""The published scenario on two axles: speed, load and XBS estimated while the anti-lock controllers act.

From 180 km/h; the pedal at 0.25 s, the controllers from 0.75 s in front and from 0.5 s behind; dry asphalt, snow from
2.5 s, wet asphalt from 5 s; to 15 km/h. The accelerometer has a bias of 0.5 m/s^2. Each axle has an adaptive observer,
which runs along while the controller acts and knows the load from eq. 3.36. The pressure of
the pedal, 200 bar/s, is ours: what brings both axles near their peaks when the controllers begin.
Source: Aguado-Rojas 2019, section 3.6, Figs 3.15 to 3.19.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from absjax._numerics import tree_where
from absjax.controllers.base import Controller
from absjax.loop.channel import Channel
from absjax.loop.driver import Driver
from absjax.loop.sampled_vehicle import SampledVehicle
from absjax.loop.stop import Outcome, stop
from absjax.loop.vehicle_loop import VehicleLoop
from absjax.observers.adaptive import AdaptiveObserver, AdaptiveState
from absjax.observers.base import Sample
from absjax.observers.clamped import Clamped
from absjax.observers.designs import Adaptive
from absjax.observers.load import at_load
from absjax.observers.run import advance
from absjax.observers.tyres import on_tyres
from absjax.plant.brake import Brake
from absjax.plant.road import ChangingRoad
from absjax.plant.two_axle import TwoAxle
from absjax.speed.accelerometer import Accelerometer
from absjax.speed.base import SpeedEstimator
from absjax.tyres.surfaces import SURFACES
from tuning.observers.metrics import crossings, settling

SPEED, STOP = 180 / 3.6, 15 / 3.6
PEDAL = Driver(rate=200.0, delay=0.25)
BEGINS = 0.75, 0.5
SURFACES_PASSED, CHANGES, BLEND = ("dry_asphalt", "snow", "wet_asphalt"), (2.5, 5.0), 0.025
PERIOD, SUBSTEPS, HORIZON, EVENTS = 1e-3, 16, 14.0, 1200
C2, C2_C3 = (4.0, 120.0), (0.05, 60.0)
"""What roads have, but for ice: c and d of the adaptive observer are projected onto it."""
ROUND = 0.5
"""Time the source gives an estimate after a change of the road [s]."""
LENGTHS: dict[str, float | None] = {"none": None, "half": 0.5, "0.8": 0.8, "all": 1.0, "1.25": 1.25, "twice": 2.0}
"""Shares of the true relaxation length that observers are told; None: of a tyre without one."""
NEAR = 0.05
"""Distance in time within which a zero crossing of the estimate belongs to one of the true XBS [s]."""


class Ride(NamedTuple):
    """The scenario once through; arrays (samples,) of the instants after the first sample, of axles (2, samples)."""

    time: np.ndarray
    speed: np.ndarray
    """true v [m/s]"""
    told_speed: np.ndarray
    """v^ [m/s]"""
    rims: np.ndarray
    pressures: np.ndarray
    loads: np.ndarray
    """true Fz [N]"""
    known_loads: np.ndarray
    """from eq. 3.36 with the acceleration that is told [N]"""
    stiffness: np.ndarray
    """true XBS"""
    estimated: np.ndarray
    """XBS as the observers estimate it of what they are told; 0 before the controller acts"""
    from_truth: np.ndarray
    """as the same observers would from the true speed and acceleration"""
    active: np.ndarray
    """bool: while the controller of the axle acts"""


def scenario_loop(controllers: Sequence[Controller]) -> VehicleLoop:
    """The car, its road, its driver and the controllers of its axles."""
    tyres = tuple(SURFACES[name] for name in SURFACES_PASSED)
    road = ChangingRoad(tyres, CHANGES, BLEND, "time")
    channels = tuple(Channel(Brake(750.0, 5e-3), controller) for controller in controllers)
    return VehicleLoop(TwoAxle((road, road)), channels, STOP, PEDAL, BEGINS, follows_load=True)


def ride(
    loop: VehicleLoop,
    estimator: SpeedEstimator | None,
    bias: float = 0.5,
    noise: float = 0.1,
    design: Adaptive | None = None,
) -> Ride:
    """The scenario with the speed estimated, or known where there is no estimator.

    The observers know the relaxation length of the tyres; `rides_told` of others.

    Args:
        bias: of the accelerometer, where there is an estimator [m/s^2].
        noise: of it, standard deviation of a sample [m/s^2].
        design: of the observers.

    Raises:
        RuntimeError: if the car has not stopped by then.
    """
    unit, path = _driven(loop, estimator, bias, noise)
    return _ride(unit, loop, path, design or Adaptive(), 1.0)


def rides_told(
    loop: VehicleLoop, estimator: SpeedEstimator, shares: Mapping[str, float | None] = LENGTHS
) -> dict[str, Ride]:
    """The same by what the observers are told of the relaxation length: a share of it, or None of any."""
    unit, path = _driven(loop, estimator, 0.5, 0.1)
    return {name: _ride(unit, loop, path, Adaptive(), share) for name, share in shares.items()}


def _driven(loop: VehicleLoop, estimator: SpeedEstimator | None, bias: float, noise: float):
    """The control unit, and the path from the first sample on."""
    accelerometer = None if estimator is None else Accelerometer(bias, noise)
    unit = SampledVehicle(loop, (), estimator, accelerometer)
    result = stop(unit, jnp.asarray(SPEED), horizon=HORIZON, step=PERIOD, max_events=EVENTS, save_every=1)
    if Outcome(int(result.outcome)) is not Outcome.STOPPED:
        raise RuntimeError(f"the scenario ends {Outcome(int(result.outcome)).name}")
    path = result.rollout.path
    keep = np.asarray(path.valid) & (np.asarray(path.time) > 0.5 * PERIOD)
    return unit, jax.tree.map(lambda leaf: np.asarray(leaf)[keep], path)


def _ride(unit: SampledVehicle, loop: VehicleLoop, path, design: Adaptive, share: float | None) -> Ride:
    vehicle: Any = loop.vehicle
    length = None if share is None else share * vehicle.relaxation
    state, told = path.state.loop, path.state.unit.samples
    true = jax.vmap(loop.measured)(path.time, state, path.mode)
    acceleration, speed = (np.asarray(getattr(true[0], f"vehicle_{name}")) for name in ("acceleration", "speed"))
    told_speed, told_acceleration = speed, acceleration
    if unit.speed is not None:
        told_speed = np.asarray(unit.speed.speed_of(path.state.unit.speed))
        # y = R w' - a with the a that is told.
        told_acceleration = np.asarray(true[0].acceleration_offset + acceleration - told[0].y)
    active = np.stack([np.asarray(phase) for phase in loop.phases(path.mode)]) > 0
    known_loads = [_arrays(vehicle.known_loads(a, 0.0 * a)) for a in (told_acceleration, acceleration)]
    estimates = []
    for samples, loads in zip((told, tuple(map(Sample.of, true))), known_loads):
        pairs = zip(samples, loads, vehicle.wheels, active)
        observed = (
            _while_active(on_tyres(design.observer(w), length), s, load / w.load, on) for s, load, w, on in pairs
        )
        estimates.append(np.stack(list(observed)))
    return Ride(
        time=np.asarray(path.time),
        speed=speed,
        told_speed=told_speed,
        rims=_arrays(s.radius * s.wheel_speed for s in true),
        pressures=_arrays(s.pressure for s in true),
        loads=_arrays(jax.vmap(vehicle.loads)(path.time, state.vehicle)),
        known_loads=known_loads[0],
        stiffness=_arrays(s.stiffness for s in true),
        estimated=estimates[0],
        from_truth=estimates[1],
        active=active,
    )


def _arrays(values) -> np.ndarray:
    return np.stack([np.asarray(value) for value in values])


def _while_active(observer: AdaptiveObserver, samples: Sample, shares: np.ndarray, active: np.ndarray) -> np.ndarray:
    """XBS (samples,) as an observer estimates it from where the controller begins to act, 0 before."""
    first = int(np.argmax(active))
    found = stiffness_along(observer, jax.tree.map(lambda x: jnp.asarray(x)[first:], samples), shares[first:])
    return np.concatenate([np.zeros(first), np.asarray(found)])


@jax.jit
def stiffness_along(observer: AdaptiveObserver, samples: Sample, shares) -> jax.Array:
    """XBS (samples,) as an observer estimates it along samples, the load known as a share of that at rest."""
    first, shares = jax.tree.map(lambda x: x[0], samples), jnp.asarray(shares)

    def body(carry, after):
        before, state = carry
        sample, share = after
        loaded = at_load(observer, share)
        state = advance(loaded, state, before, sample, PERIOD, SUBSTEPS)
        finite = jnp.isfinite(sum(jax.tree.leaves(state)))
        state = projected(loaded, tree_where(finite, state, loaded.initial_state(sample.y)))
        return (sample, state), Clamped(loaded).stiffness(state, sample.y)

    rest = jax.tree.map(lambda x: x[1:], (samples, shares))
    _, path = lax.scan(body, (first, at_load(observer, shares[0]).initial_state(first.y)), rest)
    return jnp.concatenate([jnp.zeros_like(path[:1]), path])


def projected(observer: AdaptiveObserver, state: AdaptiveState) -> AdaptiveState:
    """The state with c, d and XBS where roads have them: a wheel that slips deep throws them far out."""
    gain, range_of = observer.wheel.slip_gain, Clamped(observer)
    c, d = jnp.clip(state.c, *C2), jnp.clip(state.d, *C2_C3)
    stiffness = jnp.clip(state.w2 - state.c / gain * state.w1, range_of.low, range_of.high)
    return state._replace(c=c, d=d, w2=stiffness + c / gain * state.w1)


def figures_of(ride: Ride, axle: int) -> dict[str, Any]:
    """What is told of an axle: speed, load, zero crossings of XBS, and how long its estimate takes after a change."""
    active, error = ride.active[axle], ride.estimated[axle] - ride.stiffness[axle]
    begins = np.array([[ride.time[active][0], *(change + BLEND for change in CHANGES)]])
    ends = np.array([[*CHANGES, ride.time[-1]]])
    settled = settling(ride.time, error[None], begins, ends)[0]
    true, found = (crossings(ride.time[active], xbs[axle][active]) for xbs in (ride.stiffness, ride.estimated))
    apart = np.array([np.min(np.abs(found - instant), initial=np.inf) for instant in true])
    inside = active & np.all([np.abs(ride.time - change - ROUND / 2) > ROUND / 2 for change in CHANGES], axis=0)
    soon = [active & (ride.time > b + ROUND) & (ride.time < e) for b, e in zip(begins[0, 1:], ends[0, 1:])]
    return {
        "speed error [%]": round(100 * float(np.mean(_relative(ride.told_speed, ride.speed)[active])), 2),
        "load error [%]": round(100 * float(np.mean(_relative(ride.known_loads[axle], ride.loads[axle])[active])), 2),
        "XBS error, rms": round(float(np.sqrt(np.mean(error[inside] ** 2))), 3),
        "crossings": len(true),
        "found [%]": round(100 * float(np.mean(apart < NEAR)), 1) if len(true) else None,
        "apart, median [ms]": round(1e3 * float(np.median(apart)), 1) if len(true) else None,
        "settles on dry [s]": round(float(settled[0]), 3),
        "on snow [s]": round(float(settled[1]), 3),
        "on wet [s]": round(float(settled[2]), 3),
        **{
            f"within 1 on {name} from {ROUND:g} s on [%]": round(100 * float(np.mean(np.abs(error[own]) < 1)), 1)
            for name, own in zip(("snow", "wet"), soon)
        },
    }


def _relative(value, true):
    return np.abs(value - true) / np.abs(true)
