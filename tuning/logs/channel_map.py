"""Which channel of a log is which signal, in which unit and of which sign: declared, or known by its name.

A channel is taken for a signal if it is declared so, or has the signal's own name (`COLUMNS`), or a name that common
exports give it (`tuning.logs.names`). What is known by name is said; where several channels fit, none is guessed.
A unit is declared, or stated by the name or the file.
"""

import dataclasses
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from tuning.core.config import ConfigError, Count, Entries, Positive, Real, Text, choice, config
from tuning.logs.names import RIG, RIG_MARKS, may_be, stated
from tuning.logs.recording import Channel, LogError, Recording
from tuning.logs.units import EXAMPLES, OWN, Unit, unit_of

T = TypeVar("T")
COLUMNS = {
    "time": "time_s",
    "wheel_speed": "wheel_speed_rad_s",
    "vehicle_speed": "vehicle_speed_m_s",
    "brake_pressure": "brake_pressure_bar",
    "acceleration": "longitudinal_acceleration_m_s2",
    "force": "longitudinal_force_n",
    "load": "vertical_load_n",
}
"""Column of each signal, unless declared otherwise."""
REQUIRED = ("time", "wheel_speed", "vehicle_speed")
BRAKING = ("brake_pressure", "acceleration", "force")
"""One of these is required too."""


@config
class Choice(Entries):
    """What a channel map says of a signal: value = sign factor (cell - offset) in the unit, at time - delay."""

    column: Text | None = None
    """name of the channel; found by its names if missing; empty: the signal is left out"""
    unit: Text | None = None
    """of the cells; as the file states it if missing"""
    sign: Literal[-1, 1, None] = None
    """-1 turns the signal; recognised if missing"""
    delay: Real = 0.0
    """by which the channel is late, s"""
    offset: Real = 0.0
    """cell that means zero"""
    factor: Positive = 1.0
    """of the cells"""
    teeth: Count | None = None
    """pulses in a revolution, where wheel speed is in Hz"""


@dataclasses.dataclass(frozen=True)
class Source:
    """Where a signal comes from."""

    signal: str
    channel: Channel
    unit: Unit
    choice: Choice

    def converted(self, values: np.ndarray, radius: float) -> np.ndarray:
        """Cells in the project's unit; slip as it is.

        Args:
            values: cells, (samples,).
            radius: of the wheel [m], for speeds of its rim.
        """
        scale = (self.choice.sign or 1) * self.choice.factor * self.unit.factor
        if self.unit.kind == "rim":
            scale /= radius
        if self.unit.kind == "pulses":
            scale *= 2 * np.pi / (self.choice.teeth or 1)
        return (values - self.choice.offset) * scale


def parse_columns(declarations: str | None) -> dict[str, str]:
    """`'wheel_speed=omega:rpm,time="t, s":ms'` as `{"wheel_speed": "omega:rpm", "time": '"t, s":ms'}`.

    Raises:
        LogError: if a part has no '=', or names no signal.
    """
    columns: dict[str, str] = {}
    for item in _parts(declarations or ""):
        signal, equals, column = item.partition("=")
        if not equals:
            raise LogError(f"column declaration {item!r} must read SIGNAL=COLUMN or SIGNAL=COLUMN:UNIT")
        columns[signal.strip()] = column.strip()
    return checked(columns)


def _parts(text: str) -> list[str]:
    """Parts between commas outside of quotation marks."""
    parts, quoted = [""], False
    for letter in text:
        quoted ^= letter == '"'
        if letter == "," and not quoted:
            parts.append("")
        else:
            parts[-1] += letter
    return [part for part in parts if part.strip()]


def checked(declared: Mapping[str, T]) -> dict[str, T]:
    """Declarations whose signals are known.

    Raises:
        LogError: naming one that is not.
    """
    for signal in declared:
        if signal not in COLUMNS:
            raise LogError(f"signal {signal!r} is unknown; there are {', '.join(COLUMNS)}")
    return dict(declared)


def read_channel_map(path: Path) -> dict[str, Choice]:
    """A channel map: a TOML file with a table, or a text as `--columns` has it, for each signal.

    Raises:
        LogError: naming file and entry.
    """
    if not path.is_file():
        raise LogError(f"{path}: no such file")
    try:
        data = tomllib.loads(path.read_text("utf-8-sig"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise LogError(f"{path}: not a TOML file: {error}") from None
    found = {}
    for signal, entries in data.items():
        try:
            choice("channel map", signal, COLUMNS)
            found[signal] = _choice(entries) if isinstance(entries, str) else Choice.from_json(entries)
        except ConfigError as error:
            raise LogError(f"{path}, {signal}: {error}") from None
    return found


def declarations(columns: str | None, channels: Path | None) -> dict[str, "str | Choice"]:
    """What --columns and --channels say together; --columns counts where both do.

    Raises:
        LogError: if one of them cannot be used.
    """
    return {**({} if channels is None else read_channel_map(channels)), **parse_columns(columns)}


def _choice(text: str) -> Choice:
    """`COLUMN`, `COLUMN:UNIT` or `"COLUMN":UNIT`; which of the first two it is only the log can tell."""
    if not text.startswith('"'):
        return Choice(column=text)
    name, _, rest = text[1:].partition('"')
    return Choice(column=name, unit=rest.lstrip(": ") or None)


def sources_of(
    recording: Recording, declared: Mapping[str, "str | Choice"], radius: float
) -> tuple[list[Source], list[str]]:
    """Where each signal comes from, and what is to be said of it.

    Raises:
        LogError: naming the file and what is missing, unknown or ambiguous.
    """
    own_time = any(channel.time is not None for channel in recording.channels)
    rig = RIG if set(recording.names) >= RIG_MARKS else {}
    found, notes, unsaid = [], [], []
    for signal in COLUMNS:
        given = declared.get(signal)
        wanted = _choice(given) if isinstance(given, str) else given or Choice()
        if wanted.column == "" and signal not in REQUIRED:
            continue
        if wanted.column is not None:
            channel, wanted = _declared(recording, signal, wanted)
            recognised = False
        else:
            channel = _recognised(recording, signal, rig)
            recognised = channel is not None and channel.name != COLUMNS[signal]
        if channel is None:
            if (signal in REQUIRED and not (signal == "time" and own_time)) or given is not None:
                there = ", ".join(recording.names)
                raise LogError(f"{recording.path}: no column {COLUMNS[signal]!r} for {signal}; there are {there}")
            continue
        unit, where = _unit(recording, signal, channel, wanted, rig)
        if unit is None and recognised and signal not in REQUIRED:
            unsaid.append(f"column {channel.name!r} may be {signal}, but states no unit; left out")
            continue
        if unit is None and recognised and signal != "time":
            raise LogError(
                f"{recording.path}: column {channel.name!r} may be {signal}, but states no unit; declare it as "
                f"{_declaration(signal, channel.name)}:UNIT, of {EXAMPLES[signal]}"
            )
        if unit is None:
            unit, where = Unit(OWN[signal], 1.0), "assumed"
        if unit.kind == "pulses" and wanted.teeth is None:
            raise LogError(
                f"{recording.path}, column {channel.name!r}: wheel_speed in {unit.text} needs the teeth of the "
                "encoder; declare them in a channel map (--channels)"
            )
        found.append(Source(signal, channel, unit, wanted))
        if recognised:
            notes.append(f"{signal} is column {channel.name!r} in {unit.text} ({where})")
        elif where not in ("declared", "own", "assumed") or (where == "declared" and unit.factor != 1):
            notes.append(f"column {channel.name!r} is in {unit.text} ({where})")
        if unit.kind == "rim":
            notes.append(f"{signal}: speed of the rim, divided by the radius {radius:g} m")
        if unit.kind == "slip":
            notes.append(f"{signal}: made of slip, vehicle speed and the radius {radius:g} m")
        notes += _said(signal, wanted)
    if not {source.signal for source in found} & set(BRAKING):
        names = [COLUMNS[signal] for signal in BRAKING]
        raise LogError(
            f"{recording.path}: none of {', '.join(BRAKING)} (columns {', '.join(map(repr, names))}); "
            f"there are {', '.join([*recording.names, *unsaid])}"
        )
    return found, [*notes, *unsaid]


def _said(signal: str, wanted: Choice) -> list[str]:
    told = {"sign": wanted.sign == -1 and "turned", "delay": wanted.delay and f"moved {wanted.delay:g} s earlier"}
    told["offset"] = wanted.offset and f"{wanted.offset:g} taken off its cells"
    told["factor"] = wanted.factor != 1 and f"its cells times {wanted.factor:g}"
    said = [text for text in told.values() if text]
    return [f"{signal}: {', '.join(said)}, as declared"] if said else []


def _declared(recording: Recording, signal: str, wanted: Choice) -> tuple[Channel, Choice]:
    """The channel declared; its name may hold colons, and a unit may follow it."""
    text = str(wanted.column)
    name, colon, unit = text.rpartition(":")
    if text not in recording.names and colon and wanted.unit is None:
        if name not in recording.names:
            name, _, unit = text.partition(":")
        text, wanted = name, dataclasses.replace(wanted, column=name, unit=unit)
    if text not in recording.names:
        there = ", ".join(recording.names)
        raise LogError(f"{recording.path}: no column {text!r} for {signal}; there are {there}")
    return recording.channel(text), wanted


def _recognised(recording: Recording, signal: str, rig: Mapping[str, tuple[str, str]]) -> Channel | None:
    """The channel of a signal's own name, or the only one of a name known for it.

    Raises:
        LogError: if there are several.
    """
    if COLUMNS[signal] in recording.names:
        return recording.channel(COLUMNS[signal])
    for name, (meant, _) in rig.items():
        if meant == signal and name in recording.names:
            return recording.channel(name)
    fitting = [name for name in recording.names if may_be(signal, name)]
    if len(fitting) > 1:
        raise LogError(
            f"{recording.path}: {', '.join(map(repr, fitting))} may each be {signal}; "
            f"declare one, as in {_declaration(signal, fitting[0])}"
        )
    return recording.channel(fitting[0]) if fitting else None


def _declaration(signal: str, name: str) -> str:
    """An entry of --columns."""
    quoted = f'"{name}"' if any(mark in name for mark in ",:=") else name
    return f"{signal}={quoted}"


def _unit(recording: Recording, signal: str, channel: Channel, wanted: Choice, rig) -> tuple[Unit | None, str]:
    """The unit of a channel, and who says so."""
    if wanted.unit:
        unit = unit_of(signal, wanted.unit)
        if unit is None:
            raise LogError(
                f"{recording.path}, column {channel.name!r}: unit {wanted.unit!r} is unknown; "
                f"{signal} may be in {EXAMPLES[signal]}"
            )
        return unit, "declared"
    if channel.name == COLUMNS[signal] and not channel.unit:
        return Unit(OWN[signal], 1.0), "own"
    if channel.unit:
        unit = unit_of(signal, channel.unit)
        if unit is None:
            raise LogError(
                f"{recording.path}, column {channel.name!r}: its unit {channel.unit!r} is none of {signal}, "
                f"as {EXAMPLES[signal]}; declare it as {_declaration(signal, channel.name)}:UNIT"
            )
        return unit, "as the file says"
    unit = stated(signal, channel.name)[1]
    if unit:
        return unit, "as its name says"
    if channel.name in rig and rig[channel.name][0] == signal:
        return unit_of(signal, rig[channel.name][1]), "as tyre rigs write it"
    return None, ""
