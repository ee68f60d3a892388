"""Edges of pickups, by bisection of the angle: wheels with teeth missing, disturbances, timers; and the truth."""

import dataclasses

import numpy as np

WHEELS: dict[str, tuple[int, tuple[int, ...]]] = {
    "60": (60, ()),
    "48": (48, ()),
    "36-1": (36, (35,)),
    "60-2": (60, (58, 59)),
    "36-2-2": (36, (16, 17, 34, 35)),
}
"""Pitches, and places without a tooth; the gaps of 36-2-2 lie opposite each other."""


@dataclasses.dataclass(frozen=True)
class Profile:
    """w = mean + swing sin(2 pi f t), with f = 1 / turn; 40 to 110 rad/s."""

    mean: float = 75.0
    swing: float = 35.0
    turn: float = 4.0

    def angle(self, t):
        k = 2 * np.pi / self.turn
        return self.mean * t + self.swing / k * (1 - np.cos(k * np.asarray(t)))

    def speed(self, t):
        return self.mean + self.swing * np.sin(2 * np.pi / self.turn * np.asarray(t))

    def acceleration(self, t):
        k = 2 * np.pi / self.turn
        return self.swing * k * np.cos(k * np.asarray(t))


@dataclasses.dataclass(frozen=True)
class Pickup:
    """What a log is made with."""

    wheel: str = "60"
    profile: Profile = Profile()
    duration: float = 5.0
    """s"""
    begin: float = 3.0
    """instant of the clock at which the wheel begins to turn, s"""
    clock: float = 1e-6
    """s"""
    bits: int | None = None
    """of the counter; None: wide enough"""
    doubled: float = 0.0
    """share of edges with a second one behind"""
    bounce: float = 60e-6
    """s from the one to the other"""
    missed: float = 0.0
    """share of edges without a stamp"""
    dropout: float = 0.0
    """s without edges, from 0.4 of the duration on"""
    both: float | None = None
    """share of a pitch a tooth is wide, if falling edges are stamped too"""
    tolerance: float = 0.0
    """teeth are within so many cycles of their places"""
    seed: int = 0

    @property
    def teeth(self) -> int:
        return WHEELS[self.wheel][0]

    def edges(self) -> np.ndarray:
        """Instants of the edges [s], none of them disturbed."""
        teeth, absent = WHEELS[self.wheel]
        turned = float(self.profile.angle(self.duration)) * teeth / (2 * np.pi)
        place = np.arange(int(turned) + 1)
        place = place[~np.isin(place % teeth, absent)]
        error = np.random.default_rng(1000 + self.seed).uniform(-self.tolerance, self.tolerance, teeth)
        at = place + error[place % teeth] + 0.3
        if self.both is not None:
            at = np.sort(np.concatenate([at, at + self.both]))
        angle = at * 2 * np.pi / teeth
        low, high = np.zeros(angle.size), np.full(angle.size, self.duration + 1.0)
        for _ in range(60):
            middle = 0.5 * (low + high)
            ahead = self.profile.angle(middle) > angle
            low, high = np.where(ahead, low, middle), np.where(ahead, middle, high)
        return low[low < self.duration]

    def stamps(self) -> np.ndarray:
        """Ticks as they are logged."""
        random = np.random.default_rng(self.seed)
        t = self.edges()
        t = t[random.uniform(size=t.size) >= self.missed]
        if self.dropout:
            start = 0.4 * self.duration
            t = t[(t < start) | (t > start + self.dropout)]
        again = t[random.uniform(size=t.size) < self.doubled] + self.bounce
        t = np.sort(np.concatenate([t, again]))
        ticks = np.floor((self.begin + t) / self.clock).astype(np.int64)
        return ticks if self.bits is None else ticks % (1 << self.bits)

    def truth(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speed and acceleration at instants of the clock [s]."""
        t = time - self.begin
        return self.profile.speed(t), self.profile.acceleration(t)

    def text(self) -> str:
        """As a file."""
        return "edge_tick\n" + "\n".join(map(str, self.stamps().tolist())) + "\n"
