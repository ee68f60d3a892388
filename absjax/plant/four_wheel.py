"""A steered car on four wheels: planar motion, loads that braking and cornering move, combined slip, relaxation.

    m (vx' - r vy) = sum FX,    m (vy' + r vx) = sum FY,    Iz r' = sum x_i FY_i - y_i FX_i
    J w_i' = -R Fx_i - gamma_b Pb_i,    sigma lx' = (R w - wx) - |wx| lx,    sigma ly' = -wy - |wx| ly

(wx, wy) is the velocity over a wheel's centre in the axes of the wheel, (FX, FY) the force in those of the car; ISO
axes: x forward, y left, r positive to the left. Loads are quasi-static, with ax = sum FX / m and ay = sum FY / m

    Fz_i = W_i -+ (m h / 2 L) ax -+ p (m h / T) ay

where p is the axle's share of the roll moment. At given slips forces are linear in Fz and Fz in (ax, ay), which makes
two linear equations of the accelerations. A load is at least 0: a wheel that lifts carries nothing, and what the others
carry is what the equations without that limit say.
"""

import dataclasses
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import computed_once, safe_divide
from absjax.parameters import model, parameter, part
from absjax.plant.axle import relaxing
from absjax.plant.base import Road
from absjax.plant.combined_slip import Used, used
from absjax.plant.steering import FixedSteering, Steering
from absjax.plant.two_axle import SLIP_SCALE
from absjax.plant.wheel import GRAVITY, Wheel
from absjax.signals import Signals

FRONT = Wheel(inertia=1.2, radius=0.3, load=4087.5, brake_efficiency=17.5)
REAR = Wheel(inertia=1.2, radius=0.3, load=3270.0, brake_efficiency=8.5)
"""A wheel of each axle, the load at rest."""
SIDE_SCALES = 0.1, 0.02, 0.02
"""Magnitudes of vy [m/s], r [rad/s] and the yaw angle [rad] of a car that brakes."""
SLOWEST = 0.1
"""Speed over the ground below which slip without relaxation is taken over this [m/s]: a car that spins."""
LEAST_DETERMINANT = 1e-3
"""Of the equations of the accelerations over m^2; below it they have no solution, and loads are those at rest."""


class PlanarMotion(NamedTuple):
    """Motion of the body; scalars per lane."""

    longitudinal: Any
    """vx [m/s]"""
    lateral: Any
    """vy [m/s]"""
    yaw_rate: Any
    """r [rad/s]"""
    yaw: Any
    """yaw angle since time 0 [rad]"""
    distance: Any
    """travelled by the front axle along the path [m]"""

    @property
    def side_slip(self):
        """atan2(vy, vx) [rad]."""
        return jnp.arctan2(self.lateral, self.longitudinal)


class FourWheelState(NamedTuple):
    """State of a four-wheel car; scalars per lane, tuples front left, front right, rear left, rear right."""

    motion: PlanarMotion
    wheel_speeds: Any
    """w [rad/s]"""
    along: Any
    """lx; None without relaxation"""
    across: Any
    """ly; None without relaxation"""
    steering: Any


class Contact(NamedTuple):
    """A wheel on the road."""

    over_ground: Any
    """wx, along the wheel [m/s]"""
    sideways: Any
    """wy, across it [m/s]"""
    used: Used
    forward: Any
    """FX / Fz"""
    leftward: Any
    """FY / Fz"""


@model
class FourWheel:
    """A steered car on four braked wheels. Valid while it moves forward.

    Raises:
        ValueError: at construction, unless the centre of gravity lies between the axles and there are four wheels and
            four roads.
    """

    title: ClassVar[str] = "four-wheel car"
    places: ClassVar[tuple[str, ...]] = ("front left", "front right", "rear left", "rear right")

    roads: tuple[Road, ...] = part("under each wheel")
    corners: tuple[Wheel, ...] = part("the wheels; their load follows", default=(FRONT, FRONT, REAR, REAR))
    mass: Any = parameter("m, kg", default=1500.0, low=0.0, open_low=True)
    yaw_inertia: Any = parameter("Iz, kg m^2", default=2600.0, low=0.0, open_low=True)
    wheelbase: Any = parameter("L, m", default=2.7, low=0.0, open_low=True)
    to_front: Any = parameter("from the centre of gravity to the front axle, m", default=1.2, low=0.0, open_low=True)
    track_front: Any = parameter("T in front, m", default=1.55, low=0.0, open_low=True)
    track_rear: Any = parameter("T behind, m", default=1.55, low=0.0, open_low=True)
    height: Any = parameter("h of the centre of gravity, m", default=0.55, low=0.0)
    roll_split: Any = parameter("share of the roll moment that the front axle takes", default=0.55, low=0.0, high=1.0)
    relaxation: Any = parameter("sigma, relaxation length, m; None: none, not 0", default=0.25, low=0.0, open_low=True)
    steering: Steering = part("who steers", default=FixedSteering())
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = (("to_front", "wheelbase", 1e-3),)

    def __post_init__(self):
        for name in ("corners", "roads"):
            if len(getattr(self, name)) != 4:
                raise ValueError(f"FourWheel.{name} has {len(getattr(self, name))} entries; a car has four wheels")

    @property
    def ahead(self):
        """x_i of the wheels [m]."""
        rear = self.to_front - self.wheelbase
        return self.to_front, self.to_front, rear, rear

    @property
    def left(self):
        """y_i of the wheels [m]."""
        front, rear = self.track_front / 2, self.track_rear / 2
        return front, -front, rear, -rear

    @property
    def _rest(self):
        """W_i, the loads at rest [N]."""
        weight = self.mass * GRAVITY / (2 * self.wheelbase)
        front, rear = weight * (self.wheelbase - self.to_front), weight * self.to_front
        return front, front, rear, rear

    @property
    def _transfers(self):
        """dFz_i / d(ax, ay) [N / (m/s^2)]."""
        along = self.mass * self.height / (2 * self.wheelbase)
        front = self.roll_split * self.mass * self.height / self.track_front
        rear = (1 - self.roll_split) * self.mass * self.height / self.track_rear
        return (-along, -front), (-along, front), (along, -rear), (along, rear)

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """The wheels with their load at rest."""
        return tuple(dataclasses.replace(wheel, load=load) for wheel, load in zip(self.corners, self._rest))

    def initial_state(self, speed) -> FourWheelState:
        """State of free rolling straight ahead at `speed` [m/s]."""
        zero = 0.0 * speed
        slips = None if self.relaxation is None else (zero,) * 4
        rolling = tuple(speed / wheel.radius for wheel in self.corners)
        steering = self.steering.initial_state(speed)
        return FourWheelState(PlanarMotion(speed, zero, zero, zero, zero), rolling, slips, slips, steering)

    def _turned(self, time, state: FourWheelState):
        """cos and sin of the angle of each wheel; None for one that is not steered."""
        angle = self.steering.angle(time, state.steering)
        steered = jnp.cos(angle), jnp.sin(angle)
        return steered, steered, None, None

    def velocities(self, time, state: FourWheelState):
        """(wx, wy) over the centre of each wheel, in its axes [m/s]."""
        motion, found = state.motion, []
        for x, y, turned in zip(self.ahead, self.left, self._turned(time, state)):
            along, across = motion.longitudinal - motion.yaw_rate * y, motion.lateral + motion.yaw_rate * x
            if turned is not None:
                cosine, sine = turned
                along, across = cosine * along + sine * across, cosine * across - sine * along
            found.append((along, across))
        return found

    def _slips(self, state: FourWheelState, velocities):
        if state.along is not None:
            return tuple(zip(state.along, state.across))
        found = []
        for wheel, w, (over, sideways) in zip(self.corners, state.wheel_speeds, velocities):
            speed = jnp.maximum(jnp.abs(over), SLOWEST)
            found.append(((wheel.radius * w - over) / speed, -sideways / speed))
        return tuple(found)

    def slips(self, time, state: FourWheelState):
        """(lx, ly) of each wheel."""
        return self._slips(state, self.velocities(time, state))

    def _places(self, state: FourWheelState):
        """Where the wheels are on their roads [m]."""
        front, rear = state.motion.distance, state.motion.distance - self.wheelbase
        return front, front, rear, rear

    def contacts(self, time, state: FourWheelState) -> tuple[Contact, ...]:
        """Each wheel on its road."""
        velocities, found = self.velocities(time, state), []
        parts = zip(
            self.roads, self._slips(state, velocities), velocities, self._turned(time, state), self._places(state)
        )
        for road, (along, across), (over, sideways), turned, place in parts:
            share = used(road, along, across, time, place)
            forward, leftward = share.along, share.across
            if turned is not None:
                cosine, sine = turned
                forward, leftward = cosine * forward - sine * leftward, sine * forward + cosine * leftward
            found.append(Contact(over, sideways, share, forward, leftward))
        return computed_once(tuple(found))

    def _loads(self, contacts: tuple[Contact, ...]):
        """Fz_i [N] before the limit at 0."""
        # m a = sum_i (W_i + c_i . a) p_i, over m: (1 - C) a = b.
        shares = [(contact.forward / self.mass, contact.leftward / self.mass) for contact in contacts]
        b = [sum(load * share[i] for load, share in zip(self._rest, shares)) for i in range(2)]
        c = [
            [sum(moved[k] * share[i] for moved, share in zip(self._transfers, shares)) for k in range(2)]
            for i in range(2)
        ]
        determinant = (1 - c[0][0]) * (1 - c[1][1]) - c[0][1] * c[1][0]
        solvable = determinant > LEAST_DETERMINANT
        forward = safe_divide(b[0] * (1 - c[1][1]) + b[1] * c[0][1], determinant, solvable)
        leftward = safe_divide(b[1] * (1 - c[0][0]) + b[0] * c[1][0], determinant, solvable)
        return tuple(
            load + along * forward + across * leftward for load, (along, across) in zip(self._rest, self._transfers)
        )

    def loads(self, time, state: FourWheelState):
        """Fz_i [N]."""
        return tuple(jnp.maximum(load, 0.0) for load in self._loads(self.contacts(time, state)))

    def lifted(self, time, state: FourWheelState):
        """Whether each wheel carries nothing."""
        return tuple(load <= 0.0 for load in self._loads(self.contacts(time, state)))

    def flow(self, time, state: FourWheelState, pressures) -> FourWheelState:
        """d(state)/dt."""
        contacts, motion = self.contacts(time, state), state.motion
        loads = computed_once([jnp.maximum(load, 0.0) for load in self._loads(contacts)])
        forward = [load * contact.forward for load, contact in zip(loads, contacts)]
        leftward = [load * contact.leftward for load, contact in zip(loads, contacts)]
        moment = sum(x * fy - y * fx for x, y, fx, fy in zip(self.ahead, self.left, forward, leftward))
        turning = tuple(
            wheel.acceleration(load * contact.used.along, pressure)
            for wheel, load, contact, pressure in zip(self.corners, loads, contacts, pressures)
        )
        along = across = None
        if state.along is not None:
            parts = list(zip(self.corners, state.wheel_speeds, contacts, state.along, state.across))
            along = tuple(
                relaxing(self.relaxation, at.over_ground, wheel.radius * w - at.over_ground, slip)
                for wheel, w, at, slip, _ in parts
            )
            across = tuple(relaxing(self.relaxation, at.over_ground, -at.sideways, slip) for _, _, at, _, slip in parts)
        body = PlanarMotion(
            sum(forward) / self.mass + motion.yaw_rate * motion.lateral,
            sum(leftward) / self.mass - motion.yaw_rate * motion.longitudinal,
            moment / self.yaw_inertia,
            motion.yaw_rate,
            jnp.sqrt(motion.longitudinal**2 + motion.lateral**2),
        )
        steering = self.steering.flow(time, state.steering, motion.yaw_rate, motion.yaw)
        return FourWheelState(body, turning, along, across, steering)

    def scales(self, state: FourWheelState) -> FourWheelState:
        """Motion to the side, relaxed slips and the driver's hands rest at zero."""
        nothing = jax.tree.map(lambda leaf: 0.0 * leaf, state)
        lateral, yaw_rate, yaw = (scale + 0.0 * state.motion.yaw for scale in SIDE_SCALES)
        slips = None if state.along is None else tuple(SLIP_SCALE + 0.0 * slip for slip in state.along)
        motion = nothing.motion._replace(lateral=lateral, yaw_rate=yaw_rate, yaw=yaw)
        return nothing._replace(motion=motion, along=slips, across=slips, steering=self.steering.scales(state.steering))

    def speed_of(self, time, state: FourWheelState):
        """vx [m/s]: a car that spins comes to any stop speed while it still moves forward, where the model is valid."""
        return state.motion.longitudinal

    def position(self, time, state: FourWheelState):
        """Distance travelled [m]."""
        return state.motion.distance

    def wheel_speeds_of(self, state: FourWheelState):
        """w [rad/s]."""
        return state.wheel_speeds

    def with_wheel_speeds(self, state: FourWheelState, wheel_speeds) -> FourWheelState:
        """The state with other w [rad/s]."""
        return state._replace(wheel_speeds=tuple(wheel_speeds))

    def accelerations(self, time, state: FourWheelState, slope: FourWheelState):
        """ax = vx' - r vy, ay = vy' + r vx [m/s^2]."""
        motion, change = state.motion, slope.motion
        along = change.longitudinal - motion.yaw_rate * motion.lateral
        return along, change.lateral + motion.yaw_rate * motion.longitudinal

    def signals(self, time, state: FourWheelState, slope: FourWheelState, pressures) -> tuple[Signals, ...]:
        """Signals of the true state at each wheel."""

        def over_ground(time, state):
            return tuple(along for along, _ in self.velocities(time, state))

        speeds, slowing = jax.jvp(over_ground, (time, state), (jnp.ones_like(time), slope))
        parts = zip(
            self.corners, self.contacts(time, state), speeds, slowing, state.wheel_speeds, slope.wheel_speeds, pressures
        )
        return tuple(
            Signals(
                vehicle_speed=speed,
                vehicle_acceleration=change,
                wheel_speed=w,
                acceleration_offset=wheel.radius * turning - change,
                radius=wheel.radius,
                pressure=pressure,
                stiffness=contact.used.stiffness,
                time=time,
            )
            for wheel, contact, speed, change, w, turning, pressure in parts
        )

    def known_loads(self, longitudinal, lateral):
        """Fz_i = W_i -+ (m h / 2 L) ax -+ p (m h / T) ay."""
        return tuple(
            rest + along * longitudinal + across * lateral for rest, (along, across) in zip(self._rest, self._transfers)
        )
