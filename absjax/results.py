"""How things end: codes with messages, and one way to raise what has failed.

Modes below zero are the ends of lanes: `FINISHED`, `DIVERGED` and `UNDEFINED`; `UNUSED` fills what is empty in a log.
"""

import enum
from typing import Any, Self

import numpy as np

FINISHED = -1
"""Mode of a lane whose manoeuvre has ended: it flows no more. A jump returns it, or another mode below zero but
`DIVERGED`, to end a lane."""
DIVERGED = -2
"""Mode of a lane whose state has left the finite numbers; it keeps its last finite state."""
UNDEFINED = -4
"""Mode of a lane whose controller has come to where its law is not defined."""
UNUSED = -9
"""Source and target of the entries of a switch log that are not used."""


class RolloutError(RuntimeError):
    """Something did not end as it should."""


class EndCode(enum.IntEnum):
    """Base of the codes that say how something ended: a number, a message, and whether it counts as a failure."""

    message: str
    failed: bool

    def __new__(cls, value: int, message: str, failed: bool = False) -> Self:
        """A code."""
        code = int.__new__(cls, value)
        code._value_ = value
        code.message, code.failed = message, failed
        return code


def raise_if_failed(codes: Any, kind: type[EndCode], what: str = "lanes", hint: str = "") -> None:
    """Raise what has failed.

    Args:
        codes: of `kind`, a scalar or an array.
        what: there are many of.
        hint: what a user can do, appended to the message.

    Raises:
        RolloutError: if any code counts as a failure; says how many, which is the first, and what it means.
    """
    found = np.atleast_1d(np.asarray(codes))
    for code in kind:
        lanes = np.flatnonzero(found == code)
        if code.failed and lanes.size:
            raise RolloutError(
                f"{lanes.size} of {found.size} {what} {code.name}, the first is lane {lanes[0]}: {code.message}{hint}"
            )
