"""Parameter classes: frozen dataclasses that are pytrees, with unit and bounds declared on the field.

A class decorated with :func:`model` is an immutable dataclass whose fields made by :func:`parameter`
are pytree leaves and whose other fields are static. Values are checked when a user constructs or
`dataclasses.replace`-s an instance; instances rebuilt by JAX transformations (gradients, tangents,
tracers) are not, because a gradient of a positive quantity may well be negative.
"""

import dataclasses
import math
from typing import Any, TypeVar, dataclass_transform

import jax
import numpy as np
from jax.core import Tracer

T = TypeVar("T")
OWN_CHECKS = "_own_checks"
"""Where a class keeps the `__post_init__` it was written with."""


@dataclasses.dataclass(frozen=True)
class Bounds:
    """Admissible interval of a parameter; `open_low` excludes the lower end itself."""

    low: float = -math.inf
    high: float = math.inf
    open_low: bool = False

    def __str__(self) -> str:
        left = "(" if self.open_low or math.isinf(self.low) else "["
        right = ")" if math.isinf(self.high) else "]"
        return f"{left}{self.low:g}, {self.high:g}{right}"


def parameter(
    doc: str,
    *,
    default: Any = dataclasses.MISSING,
    low: float = -math.inf,
    high: float = math.inf,
    open_low: bool = False,
    ndim: int = 0,
    trainable: bool = False,
    span: tuple[float, float] | None = None,
) -> Any:
    """Declare a field that is a pytree leaf: a parameter, or a state of more axes than a scalar.

    Args:
        doc: one line: symbol, unit, and shape where it is not a scalar.
        default: value when the field is not given; `None` marks an optional part that is absent.
        low: lower bound of every entry.
        high: upper bound of every entry.
        open_low: whether `low` itself is excluded.
        trainable: whether tuning and identification adjust it unless told otherwise.
        span: (low, high) between which a tuner looks; None: from a twentieth of where it starts to five times that.
        ndim: number of axes for one lane; a value with one more is an ensemble, lanes first.
    """
    return dataclasses.field(
        default=default,
        metadata={
            "doc": doc,
            "bounds": Bounds(low, high, open_low),
            "leaf": True,
            "ndim": ndim,
            "trainable": trainable,
            "span": span,
        },
    )


def concrete(value: Any) -> bool:
    """Whether `value` is known, not traced by a transformation: only then can it be checked."""
    return not isinstance(value, Tracer)


def _check(owner: str, field: dataclasses.Field, value: Any) -> None:
    if isinstance(value, tuple):
        for entry in value:
            _check(owner, field, entry)
        return
    if value is None or not concrete(value) or isinstance(value, jax.ShapeDtypeStruct):
        return
    bounds: Bounds = field.metadata["bounds"]
    try:
        if isinstance(value, str | list):
            raise TypeError
        numbers = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ValueError(f"{owner}.{field.name} = {value!r} is not a number; {field.metadata['doc']}") from None
    good = np.isfinite(numbers) & (numbers <= bounds.high)
    good &= (numbers > bounds.low) if bounds.open_low else (numbers >= bounds.low)
    if not good.all():
        shown = numbers[~good].flat[0]
        raise ValueError(
            f"{owner}.{field.name} = {shown:g} is outside {bounds} (finite numbers only); {field.metadata['doc']}"
        )


def _check_order(instance: Any) -> None:
    for low, high, margin in getattr(instance, "ordered", ()):
        a, b = getattr(instance, low), getattr(instance, high)
        if concrete(a) and concrete(b) and not np.all(np.less_equal(np.add(a, margin), b)):
            owner = type(instance).__name__
            raise ValueError(f"{owner}.{high} = {b} must be at least {low} + {margin:g} = {np.add(a, margin)}")


def part(doc: str, *, default: Any = dataclasses.MISSING) -> Any:
    """Declare a field that holds another model (a pytree itself), for example the road of a car."""
    if default is dataclasses.MISSING:
        return dataclasses.field(metadata={"doc": doc, "part": True})
    return dataclasses.field(default=default, metadata={"doc": doc, "part": True})


@dataclass_transform(frozen_default=True, field_specifiers=(parameter, part, dataclasses.field))
def model(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass and a pytree: `parameter` fields and nested models are children.

    A class may declare pairs of fields that have to keep an order, `ordered`: (lower, higher, by how much at least).
    `__post_init__` of a class and of those it inherits from all run, theirs first.

    Raises:
        ValueError: at construction, when a value is not a finite number inside its bounds, or two are out of order. The
            message names class, field, value and what is allowed.
    """
    setattr(cls, OWN_CHECKS, cls.__dict__.get("__post_init__"))

    def __post_init__(self):
        for field in dataclasses.fields(self):
            if field.metadata.get("leaf"):
                _check(type(self).__name__, field, getattr(self, field.name))
        for kind in reversed(type(self).__mro__):
            own_checks = kind.__dict__.get(OWN_CHECKS)
            if own_checks is not None:
                own_checks(self)
        _check_order(self)

    setattr(cls, "__post_init__", __post_init__)  # noqa: B010
    made: Any = dataclasses.dataclass(frozen=True)(cls)
    leaves = tuple(f.name for f in dataclasses.fields(made) if f.metadata.get("leaf") or f.metadata.get("part"))
    static = tuple(f.name for f in dataclasses.fields(made) if f.name not in leaves)

    def flatten(instance):
        children = tuple((jax.tree_util.GetAttrKey(name), getattr(instance, name)) for name in leaves)
        return children, tuple(getattr(instance, name) for name in static)

    def unflatten(aux, children):
        instance = object.__new__(made)
        for name, value in zip(leaves + static, tuple(children) + aux):
            object.__setattr__(instance, name, value)
        return instance

    jax.tree_util.register_pytree_with_keys(made, flatten, unflatten)
    return made


def bounds_of(instance_or_class: Any) -> dict[str, Bounds]:
    """Bounds of every `parameter` field, by name."""
    fields = dataclasses.fields(instance_or_class)
    return {f.name: f.metadata["bounds"] for f in fields if f.metadata.get("leaf")}


def span_of(instance_or_class: Any, name: str) -> tuple[float, float] | None:
    """Where a tuner looks for the value of a `parameter` field; None where nothing is declared."""
    return next(f.metadata["span"] for f in dataclasses.fields(instance_or_class) if f.name == name)


def defaults_of(cls: Any) -> dict[str, float]:
    """Default values of the scalar `parameter` fields that have one."""
    fields = {f.name: f.default for f in dataclasses.fields(cls) if f.metadata.get("leaf")}
    return {name: float(value) for name, value in fields.items() if isinstance(value, int | float)}


def trainable_names(instance_or_class: Any) -> tuple[str, ...]:
    """Names of the fields declared trainable, in order."""
    return tuple(f.name for f in dataclasses.fields(instance_or_class) if f.metadata.get("trainable"))


def is_model(value: Any) -> bool:
    """Whether `value` is an instance of a class made by :func:`model`."""
    return dataclasses.is_dataclass(value) and not isinstance(value, type)
