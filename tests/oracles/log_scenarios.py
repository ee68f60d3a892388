"""What is driven, on what road, with which car, and through which sensors it is logged."""

import dataclasses
import math

import numpy as np

GRAVITY = 9.81
NAMES = ("dry_asphalt", "wet_asphalt", "dry_concrete", "dry_cobblestones", "wet_cobblestones", "snow")
BURCKHARDT = {
    "dry_asphalt": (1.2801, 23.99, 0.52),
    "wet_asphalt": (0.857, 33.822, 0.347),
    "dry_concrete": (1.1973, 25.168, 0.5373),
    "dry_cobblestones": (1.3713, 6.4565, 0.6691),
    "wet_cobblestones": (0.4004, 33.708, 0.1204),
    "snow": (0.1946, 94.129, 0.0646),
    "ice": (0.05, 306.39, 0.0),
}
"""[A] Table 2.1"""


@dataclasses.dataclass(frozen=True)
class Surface:
    """Burckhardt's friction sign(slip) [c1 (1 - exp(-c2 |slip|)) - c3 |slip|]."""

    c1: float
    c2: float
    c3: float

    @property
    def peak_slip(self) -> float:
        """Slip (> 0) of the largest friction, at most 1: c1 c2 exp(-c2 s) = c3."""
        return min(math.log(self.c1 * self.c2 / self.c3) / self.c2, 1.0) if self.c3 > 0 else 1.0

    @property
    def peak_friction(self) -> float:
        return self.c1 * (1 - math.exp(-self.c2 * self.peak_slip)) - self.c3 * self.peak_slip


SURFACES = {name: Surface(*c) for name, c in BURCKHARDT.items()}


@dataclasses.dataclass(frozen=True)
class Car:
    """One wheel and what it carries; for a two-axle car, one wheel of an axle."""

    inertia: float = 1.2
    """kg m^2"""
    radius: float = 0.3
    """m"""
    load: float = 2500.0
    """N, standing still"""
    brake_efficiency: float = 17.5
    """N m/bar"""


@dataclasses.dataclass(frozen=True)
class Channel:
    """How one quantity reaches the log: x(t - delay) + bias + noise, rounded to quantum, held for period."""

    noise: float = 0.0
    """standard deviation of white noise, new with every sample of the channel"""
    quantum: float = 0.0
    """0: not rounded"""
    period: float = 0.0
    """s between samples of the channel, held in between; 0: that of the log"""
    delay: float = 0.0
    """s"""
    bias: float = 0.0
    lowest: float = -math.inf
    """less is not shown"""


@dataclasses.dataclass(frozen=True)
class Sensors:
    """Channels with the noise measured on the shipped logs (fourth differences)."""

    wheel_speed: Channel = Channel(0.03, lowest=0.0)
    vehicle_speed: Channel = Channel(0.01)
    brake_pressure: Channel = Channel(0.2, quantum=0.05)
    acceleration: Channel = Channel(0.1)
    force: Channel = Channel(30.0)
    load: Channel = Channel(0.0)

    def scaled(self, factor: float) -> "Sensors":
        """With `factor` times the noise, and quanta alike."""
        return Sensors(
            **{
                field.name: dataclasses.replace(channel, noise=factor * channel.noise, quantum=factor * channel.quantum)
                for field in dataclasses.fields(self)
                for channel in [getattr(self, field.name)]
            }
        )

    def gps(self) -> "Sensors":
        """Vehicle speed at 10 Hz, 100 ms late."""
        return dataclasses.replace(
            self, vehicle_speed=dataclasses.replace(self.vehicle_speed, period=0.1, delay=0.1, noise=0.03)
        )


@dataclasses.dataclass(frozen=True)
class AntiLock:
    """Pedal and anti-lock control of a wheel, each 1 ms, on its true slip and x2 = R w' - v'.

    Apply until the slip is beyond release_at; release until the wheel spins up with x2 > recovery; hold until the slip
    is back at apply_at, or the wheel no longer spins up.
    """

    pedal_at: float = 0.05
    """s"""
    pedal_rate: float = 250.0
    """bar/s, up to the first release"""
    pedal_pressure: float = 150.0
    """bar, never exceeded"""
    fast_rate: float = 600.0
    """bar/s, applying up to `fast_until` of the pressure that was too much"""
    fast_until: float = 0.85
    slow_rate: float = 100.0
    """bar/s, applying beyond"""
    release_rate: float = 750.0
    """bar/s"""
    release_at: float = 1.6
    """in units of the surface's peak slip, as apply_at"""
    release_beyond: float = 0.1
    """of slip, the most that release_at lies beyond the peak: on stones it would be the lock"""
    apply_at: float = 0.5
    recovery: float = 15.0
    """m/s^2"""
    lag: float = 0.004
    """s, first order, between commanded and logged pressure"""


@dataclasses.dataclass(frozen=True)
class Brake:
    """First-order lag and pure delay [s] between the logged pressure and the one that acts."""

    lag: float = 0.0
    delay: float = 0.0


@dataclasses.dataclass(frozen=True)
class Road:
    """Surfaces one after the other: the coefficients go over linearly in `blend` seconds from the time of a change."""

    surfaces: tuple[Surface, ...] = (SURFACES["dry_asphalt"],)
    changes: tuple[float, ...] = ()
    """s, one fewer than surfaces"""
    blend: float = 0.02
    slope: float = 0.0
    """rad, downhill > 0"""

    def __post_init__(self):
        if len(self.changes) != len(self.surfaces) - 1 or list(self.changes) != sorted(self.changes):
            raise ValueError(f"{len(self.surfaces)} surfaces and changes {self.changes}: one fewer, increasing")


LOGGED = ("wheel_speed", "vehicle_speed", "brake_pressure", "acceleration")


@dataclasses.dataclass(frozen=True)
class Logging:
    """What is logged, how often, how long, and what the car file says."""

    columns: tuple[str, ...] = LOGGED
    """of the fields of `Sensors`"""
    sensors: Sensors = Sensors()
    period: float = 1e-3
    """s"""
    duration: float = 4.0
    """s, at most"""
    end_speed: float = 3.0
    """m/s: the log ends when the car is slower"""
    declared: Car | None = None
    """the car as its file has it; None: as it is"""
    seed: int = 0
    """of the noise"""


@dataclasses.dataclass(frozen=True)
class Stop:
    """A quarter car brakes: v' = g (mu(slip) + sin slope), J w' = -R load mu - gamma_b P."""

    speed: float = 33.3
    """m/s"""
    road: Road = Road()
    car: Car = Car()
    control: AntiLock = AntiLock()
    brake: Brake = Brake()
    logging: Logging = Logging()
    rig: bool = False
    """the same wheel on a drum of constant speed"""


@dataclasses.dataclass(frozen=True)
class TwoAxleStop:
    """Two equal sides with one anti-lock control per axle; the road changes under the rear one a wheelbase later.

    The axle's wheel carries load -+ side_mass (cg_height / wheelbase) v'(tyres), after a first-order lag.
    """

    speed: float = 33.3
    road: Road = Road()
    front: Car = Car(load=4280.0, brake_efficiency=40.0)
    rear: Car = Car(load=3080.0, brake_efficiency=20.0)
    wheelbase: float = 2.7
    cg_height: float = 0.55
    pitch_lag: float = 0.0
    """s"""
    logged_axle: str = "front"
    control: AntiLock = AntiLock()
    brake: Brake = Brake()
    logging: Logging = Logging()


@dataclasses.dataclass(frozen=True)
class RigSweep:
    """A tyre rig: speed imposed, slip swept to and fro as low .. high by a cosine, load by a slower one.

    The brake carries the torque R Fx + J w' where it is negative, the drive where it is positive.
    """

    speed: float = 18.0
    surface: Surface = SURFACES["dry_asphalt"]
    car: Car = Car()
    slip: tuple[float, float] = (-0.6, 0.0)
    """lowest and highest; > 0 drives"""
    sweep: float = 1.0
    """s, to and fro"""
    load_swing: float = 0.0
    """relative, with a period of three sweeps"""
    logging: Logging = Logging((*LOGGED, "force", "load"))


def on_two_axles(stop: Stop, **changes) -> TwoAxleStop:
    """The same stop by a two-axle car, declared as it is unless `changes` say otherwise."""
    same = {name: getattr(stop, name) for name in ("speed", "road", "control", "brake")}
    logging = dataclasses.replace(stop.logging, declared=None)
    return TwoAxleStop(**{**same, "logging": logging, **changes})


Scenario = Stop | TwoAxleStop | RigSweep


@dataclasses.dataclass(frozen=True)
class Scatter:
    """Relative standard deviations (normal, cut at three) of the true car about its file, and absolute ones beside."""

    radius: float = 0.0
    brake_efficiency: float = 0.0
    load: float = 0.0
    inertia: float = 0.0
    brake_lag: float = 0.0
    """s, half-normal, on top"""
    pressure_zero: float = 0.0
    """bar"""
    accelerometer_bias: float = 0.0
    """m/s^2"""
    slope: float = 0.0
    """rad"""


def random_stops(
    n: int,
    seed: int,
    *,
    surfaces: tuple[int, ...] = (1, 2, 3),
    names: tuple[str, ...] = NAMES,
    coefficients: float = 0.05,
    contrast: float = 0.15,
    speeds: tuple[float, float] = (15.0, 35.0),
    shortest: float = 0.5,
    car: Car | None = None,
    brake: Brake | None = None,
    scatter: Scatter | None = None,
    control: AntiLock | None = None,
    logging: Logging | None = None,
) -> list[Stop]:
    """Random stops of one car.

    Args:
        surfaces: how many a stop may have, drawn evenly; fewer where the stop is too short for them.
        names: of `SURFACES`.
        coefficients: relative scatter (log-normal) of c1, c2, c3.
        contrast: neighbours' peak frictions differ by this part of the larger at least.
        speeds: initial, drawn evenly [m/s].
        shortest: time a surface has at least [s].
        scatter: of the true car about `car`, which the file has.
        logging: duration is the longest; sensors and columns of all.
    """
    rng = np.random.default_rng(seed)
    car, brake, scatter = car or Car(), brake or Brake(), scatter or Scatter()
    control, logging = control or AntiLock(), logging or Logging()

    def normal():
        return float(np.clip(rng.standard_normal(), -3, 3))

    def surface():
        c = BURCKHARDT[names[rng.integers(len(names))]]
        return Surface(*(x * math.exp(coefficients * normal()) for x in c))

    def road(speed, count):
        chain = [surface()]
        while len(chain) < count:
            new = surface()
            peaks = sorted([chain[-1].peak_friction, new.peak_friction])
            if peaks[0] < (1 - contrast) * peaks[1]:
                chain.append(new)
        drops = (speed - logging.end_speed) * rng.dirichlet(np.full(count, 5.0))
        times = [min(d / (0.95 * GRAVITY * s.peak_friction), logging.duration / count) for d, s in zip(drops, chain)]
        if count > 1 and min(times) < shortest:
            return road(speed, count - 1)
        changes = control.pedal_at + 0.15 + np.cumsum(times)[:-1]
        return Road(tuple(chain), tuple(float(round(t, 3)) for t in changes), slope=scatter.slope * normal())

    def stop():
        speed = float(rng.uniform(*speeds))
        factor = {f.name: 1 + getattr(scatter, f.name) * normal() for f in dataclasses.fields(Car)}
        true = Car(**{name: getattr(car, name) * x for name, x in factor.items()})
        sensors = logging.sensors
        zero, bias = scatter.pressure_zero * normal(), scatter.accelerometer_bias * normal()
        sensors = dataclasses.replace(
            sensors,
            brake_pressure=dataclasses.replace(sensors.brake_pressure, bias=sensors.brake_pressure.bias + zero),
            acceleration=dataclasses.replace(sensors.acceleration, bias=sensors.acceleration.bias + bias),
        )
        return Stop(
            speed=speed,
            road=road(speed, int(surfaces[rng.integers(len(surfaces))])),
            car=true,
            control=control,
            brake=dataclasses.replace(brake, lag=brake.lag + abs(scatter.brake_lag * normal())),
            logging=dataclasses.replace(logging, sensors=sensors, declared=car, seed=int(rng.integers(2**31))),
        )

    return [stop() for _ in range(n)]
