"""What a loop and a tuner ask of an anti-lock controller."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Protocol

from absjax.signals import Signals
from absjax.tyres.base import Tyre


class Controller(Protocol):
    """An anti-lock controller: an automaton on signals that commands a pressure rate.

    A class made by `absjax.parameters.model`; its tunable parameters are scalars with default values. A part named
    `wheel` is the wheel and the brake as the controller knows them. Inherit from this class to have what is optional.

    Phase 0 is the driver's: there it asks for an open valve. It begins to act while `Signals.pedal` says that the
    pedal is pressed, and begins anew, in phase 0, when a lifted pedal is back at zero.
    A phase of `absjax.results.UNDEFINED` ends the lane: the law is not defined any more.
    """

    title: ClassVar[str]
    """for tables and figures"""
    grid_step: ClassVar[float]
    """grid step that does for the default parameters, s"""
    phases: ClassVar[tuple[str, ...]]
    """their names"""
    slots: ClassVar[int]
    """how many guards it has"""
    cycle_phase: ClassVar[int | None]
    """the phase whose entry counts a cycle; None for a controller that does not cycle"""
    thresholds: ClassVar[tuple[str, ...]] = ()
    """optional: fields that are thresholds on a measured acceleration, which noise keeps from being small"""
    ordered: ClassVar[tuple[tuple[str, str, float], ...]] = ()
    """optional: fields that have to keep an order, (lower, higher, by how much at least)"""

    @abstractmethod
    def initial_state(self, signals: Signals) -> Any:
        """What it keeps from one switching to the next, a pytree of float scalars; () for nothing."""
        ...

    @abstractmethod
    def rate(self, signals: Signals, state: Any, phase: Any) -> Any:
        """Commanded dPb/dt [bar/s]."""
        ...

    @abstractmethod
    def guards(self, signals: Signals, state: Any, phase: Any) -> tuple[Any, ...]:
        """One value per slot; a slot fires when its value rises through zero."""
        ...

    @abstractmethod
    def switch(self, signals: Signals, state: Any, phase: Any, slot: Any) -> tuple[Any, Any]:
        """What it keeps, and the phase, after the guard of `slot` has fired."""
        ...

    @classmethod
    def spans_on(cls, roads: Mapping[str, Sequence[Tyre]]) -> dict[str, tuple[float, float]]:
        """Optional: where a tuner looks, of parameters for which that depends on the roads, tyre curves by name."""
        return {}

    def require_roads(self, roads: Mapping[str, Sequence[Tyre]]) -> None:
        """Optional: check that it can work on roads, tyre curves by name.

        Raises:
            ValueError: naming parameter and road.
        """

    def mark_on(self, tyres: Sequence[Tyre]) -> str:
        """Optional: a mark for what is special about a stop on these tyre curves; none as a rule."""
        return ""
