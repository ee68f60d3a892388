"""Observers on tyres that take a length to build up their force."""

import dataclasses
from typing import Any, TypeVar

T = TypeVar("T")


def on_tyres(observer: T, relaxation: Any) -> T:
    """An observer that knows the relaxation length of its tyres [m], None without; one that has no field for it does
    not know of it."""
    if not hasattr(observer, "relaxation"):
        return observer
    return dataclasses.replace(observer, relaxation=relaxation)  # pyright: ignore[reportArgumentType]
