"""Configurations: dataclasses read from JSON by the types of their fields, every wrong entry refused by name."""

import dataclasses
import difflib
from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeVar, dataclass_transform, get_type_hints

import pydantic
import pydantic.dataclasses
from pydantic import BeforeValidator, Field, TypeAdapter

T = TypeVar("T")
LONGEST = 1000
"""Most entries of a list, and characters of a name."""
KINDS = {"string": "name", "number": "number"}
"""What entries that have to be given are, by the word of a JSON schema."""
LENGTHS = {"too_short": ("min_length", "at least"), "too_long": ("max_length", "at most")}
"""Where the error of a list has its bound, and on which side of that it has to be."""


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names the entry."""


def _whole(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError("must be an integer, not a boolean")
    return int(value) if isinstance(value, float) and value.is_integer() else value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Whole = Annotated[int, Field(strict=True, ge=0, le=10**7), BeforeValidator(_whole)]
Count = Annotated[int, Field(strict=True, ge=1, le=10**7), BeforeValidator(_whole)]
Text = Annotated[str, Field(strict=True, max_length=LONGEST)]
Flag = Annotated[bool, Field(strict=True)]
Names = Annotated[tuple[Text, ...], Field(max_length=LONGEST)]
Reals = Annotated[tuple[Real, ...], Field(max_length=LONGEST)]
Values = Annotated[dict[Text, Real], Field(max_length=LONGEST)]
Limits = Annotated[dict[Text, tuple[Real, Real]], Field(max_length=LONGEST)]


class Entries:
    """Base of configurations: from and to what JSON holds. Keys are the names of the fields."""

    @classmethod
    def from_json(cls, data: Any) -> Self:
        """Build from a dictionary as JSON gives it.

        Raises:
            ConfigError: naming the entry that is unknown, of the wrong kind or out of range.
        """
        if not isinstance(data, Mapping):
            raise ConfigError(f"a configuration is a dictionary, not {type(data).__name__}")
        known = [field.name for field in dataclasses.fields(cls)]  # pyright: ignore[reportArgumentType]
        for name in data:
            choice("configuration", name, known)
        return cls(**data)

    def to_json(self) -> dict[str, Any]:
        """A plain dictionary that `from_json` reads back."""
        return dataclasses.asdict(self)  # pyright: ignore[reportArgumentType]


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def config(cls: type[T]) -> type[T]:
    """Make `cls` a frozen dataclass whose values are checked by the types of its fields.

    Raises:
        ConfigError: at construction, naming the entry.
    """
    options = pydantic.ConfigDict(extra="forbid", arbitrary_types_allowed=True)
    checked: Any = pydantic.dataclasses.dataclass(frozen=True, config=options)(cls)
    plain = checked.__init__

    def __init__(self, *arguments, **entries):
        try:
            plain(self, *arguments, **entries)
        except pydantic.ValidationError as error:
            raise ConfigError(said(error, cls)) from None

    checked.__init__ = __init__
    return checked


def said(error: pydantic.ValidationError, cls: type | None = None) -> str:
    """What of the entries cannot be used, in a line; of a list not that it is short without them.

    Args:
        cls: whose fields the entries are, which tells what a missing one should be.
    """
    found = error.errors()
    within = {one["loc"][:-1] for one in found}
    told = [one for one in found if one["type"] != "too_short" or one["loc"] not in within]
    return "; ".join(_sentence(one, cls) for one in told[:5])


def _sentence(error: Any, cls: type | None) -> str:
    """A pydantic error as a sentence that names the entry."""
    cause = error.get("ctx", {}).get("error")
    entry = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in error["loc"]).lstrip(".")
    if not entry:
        return str(cause or error["msg"])
    if error["type"] == "unexpected_keyword_argument":
        return f"configuration: {entry!r} is unknown"
    if error["type"] == "missing":
        return f"{entry} is missing" + (_wanted(cls, entry) if cls else "")
    message = error["msg"].replace("Input should be", "must be").replace("a valid tuple", "a list")
    if error["type"] in LENGTHS:
        bound, side = LENGTHS[error["type"]]
        count = error["ctx"][bound]
        entries = f"{count} {'entry' if count == 1 else 'entries'}"
        message = f"must have {entries} {side}, not {error['ctx']['actual_length']}"
    return f"{entry} = {shown(error['input'])}: {cause or message}"


def _wanted(cls: type, entry: str) -> str:
    """What a field should be, as its type has it; nothing where that allows anything."""
    hints = get_type_hints(cls, include_extras=True)
    schema = TypeAdapter(hints[entry]).json_schema() if entry in hints else {}
    kind, each = KINDS.get(schema.get("type", "")), KINDS.get(schema.get("items", {}).get("type", ""))
    if schema.get("type") == "array":
        return ", a list" + (f" of {each}s" if each else "")
    return f", a {kind}" if kind else ""


def shown(value: Any) -> str:
    """A value for a message, cut to a line."""
    text = repr(value)
    return text if len(text) <= 80 else text[:76] + " ..."


def choice(entry: str, value: Any, allowed) -> None:
    """Refuse a value that is not among those allowed."""
    if not isinstance(value, str) or value not in allowed:
        near = difflib.get_close_matches(str(value)[:LONGEST], list(allowed), 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise ConfigError(f"{entry}: {shown(value)} is unknown; there are {', '.join(allowed)}{hint}")


def require(entry: str, value: Any, holds: bool, what: str) -> None:
    """Refuse a value for which a condition does not hold."""
    if not holds:
        raise ConfigError(f"{entry} = {shown(value)} must be {what}")
