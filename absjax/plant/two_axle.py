"""A car on two axles: heave, pitch, the load that braking moves to the front, tyres that relax.

    m v' = sum Fx_i,                 Fx_i = Fz_i mu(l_i)
    m z'' = sum S_i,                 S_i = -k_i (z - x_i q) - d_i (z' - x_i q')
    Iy q'' = -h sum Fx_i - sum x_i S_i,    Fz_i = max(W_i + S_i, 0)
    sigma l_i' = (R w_i - v) - |v| l_i,    J w_i' = -R Fx_i - gamma_b Pb_i

z up and q nose down, from where the car is at rest; x_i the place of an axle ahead of the centre of gravity; W_f =
m g b / L. Without suspension the load follows the deceleration at once, Fz_f = W_f - (m h / L) v', linear in Fx;
without relaxation l_i = (R w_i - v) / v. The source prints no parameters: those here are of a mid-size car, wheels per
axle. Source: Aguado-Rojas 2019, section 3.6, eq. 3.36.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from absjax.parameters import model, parameter, part
from absjax.plant.axle import relaxing
from absjax.plant.base import Road
from absjax.plant.wheel import GRAVITY, Wheel
from absjax.signals import Signals

FRONT_AXLE = Wheel(inertia=2.4, radius=0.3, load=8175.0, brake_efficiency=35.0)
REAR_AXLE = Wheel(inertia=2.4, radius=0.3, load=6540.0, brake_efficiency=17.0)
"""Both wheels of an axle together, the load at rest."""

BODY_SCALES = 0.01, 0.1, 0.01, 0.1
"""Magnitudes of heave [m], its rate, pitch [rad] and its rate, of a car that brakes."""
SLIP_SCALE = 0.01
"""Of a relaxed slip."""


@model
class Suspension:
    """Springs and dampers, per axle: (front, rear)."""

    stiffness: tuple[Any, Any] = parameter("k, N/m", default=(50e3, 46e3), low=0.0, open_low=True)
    damping: tuple[Any, Any] = parameter("d, N s/m", default=(4.4e3, 4.0e3), low=0.0)


class BodyState(NamedTuple):
    """Heave and pitch; scalars per lane."""

    heave: Any
    """z [m]"""
    heave_rate: Any
    """m/s"""
    pitch: Any
    """q [rad]"""
    pitch_rate: Any
    """rad/s"""


class TwoAxleState(NamedTuple):
    """State of a two-axle car; scalars per lane, pairs (front, rear)."""

    speed: Any
    """v [m/s]"""
    wheel_speeds: tuple[Any, Any]
    """w [rad/s]"""
    distance: Any
    """travelled by the front axle, m"""
    body: BodyState | None
    """None without suspension"""
    slips: tuple[Any, Any] | None
    """l; None without relaxation"""


@model
class TwoAxle:
    """A car on two axles, braked straight ahead. Valid while v > 0.

    Raises:
        ValueError: at construction, unless the centre of gravity lies between the axles and there are two wheels and
            two roads.
    """

    title: ClassVar[str] = "two-axle car"
    places: ClassVar[tuple[str, ...]] = ("front", "rear")

    roads: tuple[Road, ...] = part("under the front and the rear axle")
    axles: tuple[Wheel, ...] = part(
        "both wheels of an axle as one; their load follows", default=(FRONT_AXLE, REAR_AXLE)
    )
    mass: Any = parameter("m, kg", default=1500.0, low=0.0, open_low=True)
    wheelbase: Any = parameter("L, m", default=2.7, low=0.0, open_low=True)
    to_front: Any = parameter("from the centre of gravity to the front axle, m", default=1.2, low=0.0, open_low=True)
    height: Any = parameter("h of the centre of gravity, m", default=0.55, low=0.0)
    pitch_inertia: Any = parameter("Iy, kg m^2", default=2400.0, low=0.0, open_low=True)
    suspension: Suspension | None = part("springs and dampers; None is a rigid one", default=Suspension())
    relaxation: Any = parameter("sigma, relaxation length, m; None: none, not 0", default=0.25, low=0.0, open_low=True)
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("to_front", "wheelbase", 1e-3),)

    def __post_init__(self):
        for name in ("axles", "roads"):
            if len(getattr(self, name)) != 2:
                raise ValueError(f"TwoAxle.{name} has {len(getattr(self, name))} entries; a car has two axles")

    @property
    def _ahead(self):
        """x_i of the axles [m]."""
        return self.to_front, self.to_front - self.wheelbase

    @property
    def _transfer(self):
        """m h / L, the load that a deceleration moves [N / (m/s^2)]."""
        return self.mass * self.height / self.wheelbase

    @property
    def _rest(self):
        """W_i, the loads at rest [N]."""
        weight = self.mass * GRAVITY / self.wheelbase
        return weight * (self.wheelbase - self.to_front), weight * self.to_front

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """The axles with their load at rest."""
        return tuple(dataclasses.replace(axle, load=load) for axle, load in zip(self.axles, self._rest))

    def initial_state(self, speed) -> TwoAxleState:
        """State of free rolling at `speed` [m/s], the body at rest."""
        zero = 0.0 * speed
        body = None if self.suspension is None else BodyState(zero, zero, zero, zero)
        rolling = tuple(speed / axle.radius for axle in self.axles)
        return TwoAxleState(speed, rolling, zero, body, None if self.relaxation is None else (zero, zero))

    def slips(self, state: TwoAxleState):
        """l of both axles, or lambda without relaxation."""
        if state.slips is not None:
            return state.slips
        return tuple(axle.slip(w, state.speed) for axle, w in zip(self.axles, state.wheel_speeds))

    def _used(self, time, state: TwoAxleState):
        """mu(l_i)."""
        places = self._places(state)
        return tuple(r.friction(slip, time, x) for r, slip, x in zip(self.roads, self.slips(state), places))

    def _places(self, state: TwoAxleState):
        """Where the axles are on the road [m]."""
        return state.distance, state.distance - self.wheelbase

    def _springs(self, body: BodyState):
        """S_i [N]."""
        assert self.suspension is not None
        pairs = zip(self.suspension.stiffness, self.suspension.damping, self._ahead)
        return tuple(
            -k * (body.heave - x * body.pitch) - d * (body.heave_rate - x * body.pitch_rate) for k, d, x in pairs
        )

    def loads(self, time, state: TwoAxleState):
        """Fz_i [N]."""
        if state.body is not None:
            springs = self._springs(state.body)
        else:
            used, rest = self._used(time, state), self._rest
            # v' = sum(W_i mu_i) / (m + (m h / L) (mu_f - mu_r))
            slowing = (used[0] * rest[0] + used[1] * rest[1]) / (self.mass + self._transfer * (used[0] - used[1]))
            springs = -self._transfer * slowing, self._transfer * slowing
        return tuple(jnp.maximum(rest + spring, 0.0) for rest, spring in zip(self._rest, springs))

    def flow(self, time, state: TwoAxleState, pressures) -> TwoAxleState:
        """d(state)/dt."""
        forces = tuple(load * used for load, used in zip(self.loads(time, state), self._used(time, state)))
        total = forces[0] + forces[1]
        turning = tuple(
            axle.acceleration(force, pressure) for axle, force, pressure in zip(self.axles, forces, pressures)
        )
        body = slips = None
        if state.body is not None:
            springs, (front, rear) = self._springs(state.body), self._ahead
            pitching = -self.height * total - front * springs[0] - rear * springs[1]
            body = BodyState(
                state.body.heave_rate,
                (springs[0] + springs[1]) / self.mass,
                state.body.pitch_rate,
                pitching / self.pitch_inertia,
            )
        if state.slips is not None:
            slips = tuple(
                relaxing(self.relaxation, state.speed, axle.radius * w - state.speed, slip)
                for axle, w, slip in zip(self.axles, state.wheel_speeds, state.slips)
            )
        return TwoAxleState(total / self.mass, turning, state.speed, body, slips)

    def scales(self, state: TwoAxleState) -> TwoAxleState:
        """The body and the relaxed slips rest at zero."""
        nothing = jax.tree.map(lambda leaf: 0.0 * leaf, state)
        body = None if state.body is None else BodyState(*(0.0 * rest + s for rest, s in zip(state.body, BODY_SCALES)))
        slips = None if state.slips is None else tuple(SLIP_SCALE + 0.0 * slip for slip in state.slips)
        return nothing._replace(body=body, slips=slips)

    def speed_of(self, time, state: TwoAxleState):
        """v [m/s]."""
        return state.speed

    def position(self, time, state: TwoAxleState):
        """Distance travelled [m]."""
        return state.distance

    def wheel_speeds_of(self, state: TwoAxleState):
        """w [rad/s]."""
        return state.wheel_speeds

    def with_wheel_speeds(self, state: TwoAxleState, wheel_speeds) -> TwoAxleState:
        """The state with other w [rad/s]."""
        return state._replace(wheel_speeds=tuple(wheel_speeds))

    def accelerations(self, time, state: TwoAxleState, slope: TwoAxleState):
        """v', and nothing across [m/s^2]."""
        return slope.speed, 0.0 * slope.speed

    def signals(self, time, state: TwoAxleState, slope: TwoAxleState, pressures) -> tuple[Signals, ...]:
        """Signals of the true state at each axle."""
        parts = zip(self.axles, self.roads, state.wheel_speeds, slope.wheel_speeds, self.slips(state), pressures)
        return tuple(
            Signals(
                vehicle_speed=state.speed,
                vehicle_acceleration=slope.speed,
                wheel_speed=w,
                acceleration_offset=axle.radius * turning - slope.speed,
                radius=axle.radius,
                pressure=pressure,
                stiffness=road.stiffness(slip, time, place),
                time=time,
            )
            for (axle, road, w, turning, slip, pressure), place in zip(parts, self._places(state))
        )

    def known_loads(self, longitudinal, lateral):
        """Fz_f = W_f - (m h / L) ax, Fz_r = W_r + (m h / L) ax (eq. 3.36)."""
        moved = self._transfer * longitudinal
        return tuple(rest + sign * moved for rest, sign in zip(self._rest, (-1.0, 1.0)))
