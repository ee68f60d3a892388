"""Plant, driver, brake, observer and controller composed into one hybrid system for the rollout engine.

`ClosedLoop` locates every switching inside the step; `absjax.loop.sampled_loop` has the same under the clock of a
control unit. The controller and its observer act on the brake (`absjax.loop.channel`); around them three things switch
by themselves, all of them located and differentiated through:

    the wheel slides, locks, comes free                         `absjax.loop.wheel_lock`
    the manoeuvre ends at the stop speed, or the foot moves     here and `absjax.loop.driver`
    the pressure comes to rest on the pedal's or at zero, and leaves    `absjax.loop.pressure_limits`

What of it is remembered is in `absjax.loop.memory`.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from absjax._numerics import computed_once, tree_where
from absjax.contracts import require_contract
from absjax.controllers.base import Controller
from absjax.loop import pressure_limits, wheel_lock
from absjax.loop._modes import FREE, ON_PEDAL, Mode, decoded
from absjax.loop.channel import Channel, ChannelState
from absjax.loop.driver import HELD, NEVER, OFF, PRESSING, Driver, FreeRamp, Pedal
from absjax.loop.memory import Course, Memory, Sliding
from absjax.loop.wheel_lock import LOCKED
from absjax.observers.base import Observer
from absjax.parameters import model, parameter, part
from absjax.plant.base import Actuator, Plant
from absjax.results import FINISHED
from absjax.signals import Signals


class LoopState(NamedTuple):
    """State of a closed loop."""

    plant: Any
    brake: Any
    pedal: Any
    """`absjax.loop.driver.Pedal`; None without a driver"""
    observer: Any
    """None without one"""
    controller: Any
    """what the controller keeps"""
    memory: Memory

    @property
    def channel(self) -> ChannelState:
        """What belongs to the wheel."""
        return ChannelState(self.brake, self.observer, self.controller)

    def with_channel(self, channel: ChannelState) -> "LoopState":
        """The state with another state of what belongs to the wheel."""
        return self._replace(**channel._asdict())


@model
class ClosedLoop:
    """A braked plant under an anti-lock controller, switchings located.

    Mode: see `mode` and `phase`; `FINISHED` after the vehicle has fallen to `stop_speed`, `UNDEFINED` if the controller
    has come to where its law is not defined. A rollout from mode 0 begins with the pedal untouched.

    Raises:
        ValueError: at construction, if a part lacks what its contract asks for; names part and member.
    """

    plant: Plant = part("what is braked")
    brake: Actuator = part("the actuator")
    controller: Controller = part("the controller")
    stop_speed: Any = parameter(
        "vehicle speed that ends the manoeuvre, m/s; None: it never ends", default=None, low=0.0, open_low=True
    )
    observer: Observer | None = part("estimates XBS for the controller; None tells it the true one", default=None)
    driver: Driver | FreeRamp = part("who presses the pedal", default=Driver())

    def __post_init__(self):
        parts = (self.plant, Plant), (self.brake, Actuator), (self.controller, Controller), (self.observer, Observer)
        for component, contract in parts:
            if component is not None:
                require_contract(component, contract)

    @property
    def channel(self) -> Channel:
        """What belongs to the wheel."""
        return Channel(self.brake, self.controller, self.observer)

    @property
    def foot(self) -> Driver | None:
        """The driver, whose pedal limits the pressure; None under a free ramp."""
        return self.driver if isinstance(self.driver, Driver) else None

    def initial_state(self, speed) -> LoopState:
        """State of free rolling at `speed` [m/s] with the brake released."""
        return self._begin(self.plant.initial_state(speed), speed, 0.0 * speed, self.driver.initial_state(speed), 0)

    def braking(self, speed, slip, offset) -> LoopState:
        """State of braking at a slip lambda < 0 and an acceleration offset x2 [m/s^2], to begin in a mode of `mode`.

        The pressure is what they need, commanded and at the wheel; the pedal is held at its largest.
        """
        plant = self.plant.with_wheel_speed(
            self.plant.initial_state(speed), (1 + slip) * speed / self.plant.wheel.radius
        )
        released = self.plant.signals(0.0 * speed, plant, 0.0 * speed).acceleration_offset
        pressure = (released - offset) / self.plant.wheel.pressure_gain
        return self._begin(plant, speed, pressure, self.driver.pressed(speed), self.mode(0))

    def _begin(self, plant, speed, pressure, pedal, mode) -> LoopState:
        state = LoopState(plant, self.brake.initial_state(pressure), pedal, None, (), Memory.blank(speed))
        return self.with_controllers(0.0 * speed, state, mode)

    def with_controllers(self, time, state: LoopState, mode) -> LoopState:
        """The state with observer and controller at their start."""
        return state.with_channel(self.channel.begun(state.channel, self.measured(time, state, mode)))

    def mode(self, phase):
        """Mode of a phase in the middle of braking: the pressure free, the wheel turning, the pedal held."""
        return phase if self.foot is None else Mode(phase, FREE, 0, HELD).encoded(self._phases)

    def phase(self, mode):
        """The controller's phase in `mode`; an end is its own."""
        return jnp.where(jnp.asarray(mode) < 0, mode, self._parts(mode).phase)

    def locked(self, mode):
        """Whether the wheel is locked in `mode`."""
        return (jnp.asarray(mode) >= 0) & (self._parts(mode).wheel == LOCKED)

    def sliding(self, time, state: LoopState) -> Sliding:
        """How the wheel slid until now, what lasts included."""
        return state.memory.wheel.until(time, self.plant.speed_of(time, state.plant))

    def course(self, time, state: LoopState, mode) -> Course:
        """What is known of the manoeuvre until now."""
        memory = state.memory._replace(wheel=self.sliding(time, state))
        longest = memory.control.longest_until(time, memory.pedal_time)
        longest = 0.0 * longest if self.controller.cycle_phase is None else longest
        speed, position = self.plant.speed_of(time, state.plant), self.plant.position(time, state.plant)
        return Course(speed, position, memory, longest, (memory.wheel.slides.time,))

    @property
    def _phases(self) -> int:
        return len(self.controller.phases)

    def _parts(self, mode) -> Mode:
        return decoded(jnp.asarray(mode), self._phases)

    def wheel_pressure(self, state: LoopState):
        """Pressure at the wheel [bar]."""
        if self.foot is None:
            return self.brake.pressure(state.brake)
        return pressure_limits.at_the_wheel(self.foot, self.brake, state.brake, state.pedal)

    def measured(self, time, state: LoopState, mode) -> Signals:
        """What sensors without error see."""
        signals = self.plant.signals(time, state.plant, self.wheel_pressure(state))
        parts = self._parts(mode)
        standing = -signals.vehicle_acceleration
        offset = jnp.where(parts.wheel == LOCKED, standing, signals.acceleration_offset)
        signals = signals._replace(acceleration_offset=offset)
        if self.foot is None:
            return signals
        return signals._replace(pedal=jnp.where(parts.foot == OFF, 0.0, jnp.ones_like(offset)))

    def with_estimate(self, signals: Signals, state: LoopState) -> Signals:
        """What the controller is told: XBS as the observer estimates it."""
        return self.channel.with_estimate(signals, state.channel)

    def signals(self, time, state: LoopState, mode) -> Signals:
        """What the controller is told, measured without error."""
        return self.with_estimate(self.measured(time, state, mode), state)

    def command(self, signals: Signals, state: LoopState, mode):
        """The rate the actuator is asked for and can follow [bar/s]."""
        phase = self._parts(mode).phase
        rate = self.driver.asked(self.controller.rate(signals, state.controller, phase), phase, signals)
        return self.brake.limit(rate, state.brake)

    def driven(self, time, state: LoopState, mode, rate) -> LoopState:
        """d(state)/dt under a given rate [bar/s], the observer held."""
        parts, pedal = self._parts(mode), None
        if self.foot is not None:
            slope = self.foot.slope(parts.foot) + 0.0 * state.pedal.level
            rate = pressure_limits.granted(parts, rate, slope)
            pedal = Pedal(slope, None)
        plant = computed_once(self.plant.flow(time, state.plant, self.wheel_pressure(state)))
        plant = self.plant.with_wheel_speed(plant, wheel_lock.held(parts.wheel, self.plant.wheel_speed_of(plant)))
        observer, controller, memory = jax.tree.map(lambda _: None, (state.observer, state.controller, state.memory))
        return LoopState(plant, self.brake.flow(state.brake, rate), pedal, observer, controller, memory)

    @property
    def _ends(self) -> bool:
        """Whether there is a slot for the end of the manoeuvre and the moves of the foot."""
        return self.stop_speed is not None or self.foot is not None

    def limits(self, time, state: LoopState, mode, rate) -> tuple[Any, ...]:
        """Guards that are physical, not the controller's, in the order of the table above."""
        parts = self._parts(mode)
        turning = self.plant.flow(time, state.plant, self.wheel_pressure(state))
        speeds = self.plant.wheel_speed_of(state.plant), self.plant.wheel_speed_of(turning)
        guards = (wheel_lock.guard(parts.wheel, *speeds, self._deep(time, state)),)
        if self._ends:
            guards += (jnp.maximum(*self._ending(time, state, parts)),)
        if self.foot is not None:
            guards += (pressure_limits.guard(self.foot, state.brake, state.pedal, parts, rate),)
        return guards

    def _deep(self, time, state: LoopState):
        return wheel_lock.deep(self.plant.speed_of(time, state.plant), self.plant.wheel.radius)

    def meet_limit(self, time, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after guard `slot` of `limits` has fired."""
        parts = self._parts(mode)
        speeds = self.plant.wheel_speed_of(state.plant), self._deep(time, state)
        course = state.memory.wheel, time, self.plant.speed_of(time, state.plant)
        turning, wheel, does = wheel_lock.met(parts.wheel, *speeds, *course)
        plant = self.plant.with_wheel_speed(state.plant, turning)
        met = state._replace(plant=plant, memory=state.memory._replace(wheel=wheel))
        cases = [(met, parts._replace(wheel=does))]
        if self._ends:
            cases.append(self._end_or_move(time, state, parts))
        if self.foot is not None:
            brake, rests = pressure_limits.met(state.brake, state.pedal, parts)
            cases.append((state._replace(brake=brake), rests))
        chosen, following = cases[0]
        for i, case in enumerate(cases[1:], start=1):
            chosen, following = tree_where(slot == i, case, (chosen, following))
        return chosen, following.encoded(self._phases)

    def _ending(self, time, state: LoopState, parts: Mode):
        """How far the vehicle is below the stop speed, and the guard of the foot."""
        speed = self.plant.speed_of(time, state.plant)
        end = NEVER + 0.0 * speed if self.stop_speed is None else self.stop_speed - speed
        return end, NEVER if self.foot is None else self.foot.guard(time, state.pedal, parts.foot)

    def _end_or_move(self, time, state: LoopState, parts: Mode):
        end, foot = self._ending(time, state, parts)
        ends = end >= foot
        finished = parts._replace(phase=jnp.full_like(parts.phase, FINISHED))
        if self.foot is None:
            return state, finished
        moved, following = self._moved(self.foot, time, state, parts)
        return tree_where(ends, state, moved), tree_where(ends, finished, following)

    def _moved(self, driver: Driver, time, state: LoopState, parts: Mode) -> tuple[LoopState, Mode]:
        """State and mode after the foot has moved, or the pedal has arrived where it rests."""
        pedal, does = driver.move(time, state.pedal, parts.foot)
        first = (does == PRESSING) & (state.pedal.moves == 0)
        memory = state.memory.pressed(first, time, self.plant.position(time, state.plant))
        moved, following = state._replace(pedal=pedal, memory=memory), parts._replace(foot=does)
        if driver.changes:
            # A lifted pedal is back at zero: control begins anew.
            anew = self.with_controllers(time, moved._replace(brake=moved.brake._replace(commanded=pedal.level)), 0)
            released = (does == OFF) & (parts.foot != OFF)
            begins = following._replace(phase=0 * parts.phase, pressure=0 * parts.phase + ON_PEDAL)
            moved, following = tree_where(released, (anew, begins), (moved, following))
        return moved, following

    def switch(self, signals: Signals, state: LoopState, mode, slot) -> tuple[LoopState, jax.Array]:
        """State and mode after the controller's guard `slot` has fired on `signals`."""
        time, parts = signals.time, self._parts(mode)
        channel, following, cycles = self.channel.switch(signals, state.channel, parts.phase, slot)
        control = state.memory.control.switched(time, self.plant.speed_of(time, state.plant), cycles)
        memory = state.memory._replace(control=control)
        pressure = ON_PEDAL if self.foot is None else FREE
        state = state.with_channel(channel)._replace(memory=memory)
        return state, parts._replace(phase=following, pressure=pressure).encoded(self._phases)

    def importance(self, time, state: LoopState, mode):
        """Share (v / v0)^2 of the distance that is still ahead, with v0 the speed of the first switching."""
        return jnp.minimum((self.plant.speed_of(time, state.plant) / state.memory.control.onset_speed) ** 2, 1.0)

    def scales(self, state: LoopState) -> LoopState:
        """Those of the channel; of all else every share counts."""
        return jax.tree.map(lambda leaf: 0.0 * leaf, state).with_channel(self.channel.scales(state.channel))

    def flow(self, time, state: LoopState, mode) -> LoopState:
        """d(state)/dt."""
        signals = self.signals(time, state, mode)
        return self.flow_under(time, state, mode, signals, self.command(signals, state, mode))

    def flow_under(self, time, state: LoopState, mode, signals: Signals, rate) -> LoopState:
        """d(state)/dt under a given rate [bar/s], the observer told the signals."""
        slope = self.driven(time, state, mode, rate)
        if self.observer is None:
            return slope
        held = (slope.brake, None if self.foot is None else Pedal(slope.pedal.level, 0.0 * slope.pedal.level))
        _, pressure_rate = jax.jvp(
            lambda brake, pedal: self.wheel_pressure(state._replace(brake=brake, pedal=pedal)),
            (state.brake, state.pedal),
            held,
        )
        observer = self.observer.flow(state.observer, signals.acceleration_offset, signals.vehicle_speed, pressure_rate)
        return slope._replace(observer=observer)

    def guards(self, time, state: LoopState, mode):
        """The controller's slots, then the limits."""
        signals = self.signals(time, state, mode)
        own = self.controller.guards(signals, state.controller, self._parts(mode).phase)
        return own + self.limits(time, state, mode, self.command(signals, state, mode))

    def jump(self, time, state: LoopState, mode, slot):
        """The controller switches, or one of the limits is met."""
        slots = self.controller.slots
        switched, phase = self.switch(self.signals(time, state, mode), state, mode, slot)
        limited, other = self.meet_limit(time, state, mode, slot - slots)
        own = slot < slots
        return tree_where(own, switched, limited), jnp.where(own, phase, other)
