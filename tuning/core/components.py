"""Components by name: those the project lists, and a user's own as `package.module:Class`."""

import importlib
from collections.abc import Mapping
from typing import Any, TypeVar

from absjax.contracts import require_contract
from absjax.parameters import bounds_of, defaults_of
from absjax.plant.wheel import Wheel
from tuning.core.config import ConfigError, choice

T = TypeVar("T")


def component(entry: str, name: str, members: Mapping[str, type[T]], contract: type | None = None) -> type[T]:
    """The class of a name.

    Args:
        entry: of a configuration, for messages.
        name: among `members`, or `package.module:Class` of a class that is written to the contract.
        contract: what a class that is not among the members has to have.

    Raises:
        ConfigError: if there is no such class, or it lacks what the contract asks for.
    """
    if ":" not in name:
        choice(entry, name, members)
        return members[name]
    module, _, wanted = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), wanted)
    except (ImportError, AttributeError, ValueError) as error:
        raise ConfigError(f"{entry}: {name!r} cannot be imported: {error}") from None
    if not isinstance(found, type):
        raise ConfigError(f"{entry}: {name!r} is not a class")
    if contract is not None:
        try:
            require_contract(found, contract, optional=True)
        except ValueError as error:
            raise ConfigError(f"{entry}: {error}") from None
    return found


def built(entry: str, kind: type[T], values: Mapping[str, Any], wheel: Wheel | None = None) -> T:
    """A component of given values, the others as by default; it is told the wheel if it has a part of that name.

    Raises:
        ConfigError: if a value has no field, or is not admissible.
    """
    for name in values:
        choice(entry, name, tuple(bounds_of(kind)))
    knows = wheel is not None and "wheel" in getattr(kind, "__dataclass_fields__", {})
    try:
        return kind(**values, **({"wheel": wheel} if knows else {}))
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{entry}: {error}") from None


def initial(kind: type, start: Mapping[str, float]) -> dict[str, float]:
    """Values of all scalar parameters of a component: those of `start`, the others as by default."""
    return {**defaults_of(kind), **start}
