"""Mutated brake logs: what loggers, spreadsheets and sensors make of a good one, and what may be answered to it.

A mutation takes a table of the project's own columns and gives a file, with what a user who knows the file would
declare. What a correct reader or identification may answer is one of

* ("same",): the road is that of the original
* ("doubtful",): a road, with a word that it is not to be trusted
* ("refused", word, ...): an error that holds these words

and several of them where more than one would be right.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

import tuning

TIME, WHEEL, VEHICLE, PRESSURE, ACCELERATION = (
    "time_s",
    "wheel_speed_rad_s",
    "vehicle_speed_m_s",
    "brake_pressure_bar",
    "longitudinal_acceleration_m_s2",
)
RADIUS = 0.3
SAME, DOUBTFUL = ("same",), ("doubtful",)
ROWS = 1600
"""Of the shipped stop: its dry part."""


class Mutant(NamedTuple):
    """A mutated log."""

    content: bytes
    answers: tuple[tuple[str, ...], ...]
    """those that are right"""
    columns: str | None = None
    """what a user would declare"""

    def written(self, folder: Path, name: str = "log.csv") -> Path:
        """The file."""
        path = folder / name
        path.write_bytes(self.content)
        return path

    @property
    def refused(self) -> tuple[str, ...] | None:
        """Words of the error, if there may be one."""
        return next((answer[1:] for answer in self.answers if answer[0] == "refused"), None)


Mutation = Callable[[np.random.Generator, pd.DataFrame], Mutant]
MUTATIONS: dict[str, Mutation] = {}


def mutation(function: Mutation) -> Mutation:
    """Enter a mutation under the name of its function."""
    MUTATIONS[function.__name__] = function
    return function


def original() -> pd.DataFrame:
    """The dry part of the shipped stop."""
    return pd.read_csv(Path(tuning.__file__).parent / "data" / "stop_dry_wet.csv").iloc[:ROWS]


def mutant(name: str, seed: int) -> Mutant:
    """The mutant of a name and a seed; the same ones always give the same."""
    return MUTATIONS[name](np.random.default_rng([seed, *name.encode()]), original())


def csv(table: pd.DataFrame, **options) -> bytes:
    """A table as a CSV file."""
    return table.to_csv(index=False, **options).encode()


def renamed(table: pd.DataFrame, **names: str) -> pd.DataFrame:
    """Other names for the signals, given as time, wheel, vehicle, pressure, acceleration."""
    own = dict(time=TIME, wheel=WHEEL, vehicle=VEHICLE, pressure=PRESSURE, acceleration=ACCELERATION)
    return table.rename(columns={own[name]: new for name, new in names.items()})


def stretch(rng: np.random.Generator, length: int) -> slice:
    """Somewhere in the braking."""
    first = int(rng.integers(400, ROWS - length - 200))
    return slice(first, first + length)


def held(values: np.ndarray, length: int) -> np.ndarray:
    """Each value held."""
    return np.asarray(values)[np.arange(len(values)) // length * length]


# Units


@mutation
def pressure_in_psi(rng, table):
    table[PRESSURE] /= 0.0689475729
    return Mutant(csv(renamed(table, pressure="Brake Pressure [psi]")), (SAME,))


@mutation
def pressure_in_kpa_declared(rng, table):
    table[PRESSURE] *= 100
    return Mutant(csv(renamed(table, pressure="p")), (SAME,), "brake_pressure=p:kPa")


@mutation
def pressure_in_mpa_undeclared(rng, table):
    table[PRESSURE] = (table[PRESSURE] / 10).round(3)
    return Mutant(csv(table), (("refused",), DOUBTFUL))


@mutation
def pressure_in_kpa_undeclared(rng, table):
    table[PRESSURE] *= 100
    return Mutant(csv(table), (("refused", PRESSURE, "kPa"),))


@mutation
def vehicle_speed_in_kmh(rng, table):
    table[VEHICLE] *= 3.6
    return Mutant(csv(renamed(table, vehicle="VehSpd (km/h)")), (SAME,))


@mutation
def vehicle_speed_in_kmh_undeclared(rng, table):
    table[VEHICLE] *= 3.6
    return Mutant(csv(table), (("refused", VEHICLE, "km/h"),))


@mutation
def wheel_speed_in_rpm(rng, table):
    table[WHEEL] *= 60 / (2 * np.pi)
    return Mutant(csv(renamed(table, wheel="nWheel_RR_rpm")), (SAME,))


@mutation
def rim_speed_in_mph(rng, table):
    table[WHEEL] *= RADIUS / 0.44704
    return Mutant(csv(renamed(table, wheel="WheelSpeed FL [mph]")), (SAME,))


@mutation
def rim_speed_undeclared(rng, table):
    table[WHEEL] *= RADIUS * 3.6
    return Mutant(csv(table), (("refused", WHEEL, "km/h"),))


@mutation
def acceleration_in_g(rng, table):
    table[ACCELERATION] /= 9.81
    return Mutant(csv(renamed(table, acceleration="InlineAcc [g]")), (SAME,))


@mutation
def acceleration_in_g_undeclared(rng, table):
    table[ACCELERATION] /= 9.81
    return Mutant(csv(table), (("refused", ACCELERATION, "is it in g?"),))


@mutation
def time_in_ms(rng, table):
    table[TIME] *= 1e3
    return Mutant(csv(renamed(table, time="timestamp_ms")), (SAME,))


@mutation
def time_in_ms_undeclared(rng, table):
    table[TIME] *= 1e3
    return Mutant(csv(table), (("refused", TIME, "Is time in s?"),))


@mutation
def time_since_1970_in_ms(rng, table):
    table[TIME] = 1.7e12 + rng.integers(10**9) + (table[TIME] * 1e3).round()
    return Mutant(csv(renamed(table, time="timestamp"), float_format="%.10g"), (("refused", "repeats"), SAME))


@mutation
def time_as_dates(rng, table):
    moments = pd.Timestamp("2024-02-29T23:59:59Z") + pd.to_timedelta(table[TIME], unit="s")
    table[TIME] = moments.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    return Mutant(csv(renamed(table, time="Time")), (SAME,))


# Signs


@mutation
def deceleration_positive(rng, table):
    table[ACCELERATION] *= -1
    return Mutant(csv(table), (SAME,))


@mutation
def pressure_negative(rng, table):
    table[PRESSURE] *= -1
    return Mutant(csv(table), (("refused", PRESSURE, "negative"),))


@mutation
def load_downwards(rng, table):
    table["Fz [kN]"] = -2.5 + 0.005 * rng.standard_normal(len(table))
    return Mutant(csv(table), (SAME,))


# Dialects


@mutation
def semicolons_and_decimal_commas(rng, table):
    return Mutant(csv(table, sep=";", decimal=","), (SAME,))


@mutation
def tabs(rng, table):
    return Mutant(csv(table, sep="\t", decimal=rng.choice([".", ","])), (SAME,))


@mutation
def bars(rng, table):
    return Mutant(csv(table, sep="|"), (SAME,))


@mutation
def quoted_everywhere(rng, table):
    text = csv(renamed(table, pressure="Brake, front: p [bar]"), quoting=1)
    return Mutant(text, (SAME,), 'brake_pressure="Brake, front: p [bar]"')


@mutation
def utf16(rng, table):
    return Mutant(table.to_csv(index=False, sep="\t").encode("utf-16"), (SAME,))


@mutation
def latin1(rng, table):
    table = table.assign(Kühlwassertemperatur=rng.integers(80, 90, len(table)))
    return Mutant(table.to_csv(index=False).encode("latin-1"), (SAME,))


@mutation
def mark_and_carriage_returns(rng, table):
    return Mutant(b"\xef\xbb\xbf" + csv(table).replace(b"\n", b"\r\n"), (SAME,))


@mutation
def header_block(rng, table):
    names = '"Time","WheelSpdFL","GPS Speed","BrakePress","InlineAcc"\n"s","rad/s","m/s","bar","m/s2"\n\n'
    block = f'"Format","Logger CSV"\n"Sample Rate","{rng.integers(1, 2000)}"\n"Comment","run, the second"\n\n'
    return Mutant((block + names).encode() + csv(table, header=False, quoting=1), (SAME,))


@mutation
def blank_and_comment_lines(rng, table):
    lines = csv(table).decode().split("\n")
    for at in sorted(rng.integers(2, len(lines) - 1, 30), reverse=True):
        lines.insert(int(at), rng.choice(["", "  ", "# a remark"]))
    return Mutant("\n".join(["# written by a logger", *lines]).encode(), (SAME,))


@mutation
def repeated_header(rng, table):
    lines = csv(table).decode().split("\n")
    for at in sorted(rng.integers(2, len(lines) - 1, 3), reverse=True):
        lines.insert(int(at), lines[0])
    return Mutant("\n".join(lines).encode(), (SAME,))


@mutation
def trailing_separators(rng, table):
    return Mutant(csv(table).replace(b"\n", b",\n"), (SAME,))


@mutation
def columns_nobody_asks_for(rng, table):
    beside = pd.DataFrame({"Lap": 1, "Gear": rng.integers(1, 6, len(table)), "Status": "ok", "Gear ": 2.5})
    text = csv(pd.concat([beside.rename(columns={"Gear ": "Gear"}), table], axis=1))
    return Mutant(text, (SAME,))


@mutation
def columns_in_another_order(rng, table):
    return Mutant(csv(table[list(rng.permutation(table.columns))]), (SAME,))


@mutation
def cut_off_in_the_last_line(rng, table):
    return Mutant(csv(table).rstrip(b"\n") + b"\n1.6,31.2", (SAME,))


# Sampling


@mutation
def messages_held(rng, table):
    length = int(rng.integers(5, 20))
    for name in table.columns.drop(TIME):
        table[name] = held(table[name], length)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def acceleration_held(rng, table):
    table[ACCELERATION] = held(table[ACCELERATION], 50)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def sparse_cells(rng, table):
    """Every channel in rows of its own, the others empty there."""
    names, rows = table.columns.drop(TIME), []
    for k, name in enumerate(names):
        rows.append(table[[TIME, name]].assign(**{TIME: (table[TIME] + k * 1e-4).round(6)}))
    text = csv(pd.concat(rows).sort_values(TIME)[[TIME, *names]])
    return Mutant(text, (SAME, DOUBTFUL))


@mutation
def jittered(rng, table):
    time = table[TIME] + 0.25e-3 * rng.standard_normal(len(table))
    table[TIME] = (np.maximum.accumulate(time) + 1e-7 * np.arange(len(table))).round(8)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def rows_lost(rng, table):
    kept = np.sort(rng.choice(len(table), len(table) - 16, replace=False))
    return Mutant(csv(table.iloc[np.union1d(kept, [0, len(table) - 1])]), (SAME,))


@mutation
def long_gap(rng, table):
    gone = stretch(rng, 300)
    return Mutant(csv(pd.concat([table.iloc[: gone.start], table.iloc[gone.stop :]])), (("refused", "a gap of 0.301"),))


@mutation
def cells_not_a_number(rng, table):
    for name in table.columns.drop(TIME):
        table.loc[rng.choice(np.arange(1, len(table) - 1), 20, replace=False), name] = np.nan
    return Mutant(csv(table, na_rep=str(rng.choice(["", "NaN", "nan"]))), (SAME,))


@mutation
def rows_repeated(rng, table):
    twice = rng.choice(len(table), 12, replace=False)
    return Mutant(csv(table.iloc[np.sort(np.concatenate([np.arange(len(table)), twice]))]), (SAME,))


@mutation
def instants_repeated(rng, table):
    at = int(rng.integers(10, len(table) - 10))
    table.loc[at, TIME] = table.loc[at - 1, TIME]
    return Mutant(csv(table), (("refused", TIME, f"row {at + 2}", "repeats the time before it"),))


@mutation
def rows_shuffled(rng, table):
    return Mutant(csv(table.iloc[rng.permutation(len(table))]), (("refused", TIME, "goes back in time"),))


@mutation
def too_short(rng, table):
    count = int(rng.integers(1, 199))
    return Mutant(csv(table.iloc[:count]), (("refused",),))


# Sensors


@mutation
def vehicle_speed_in_steps(rng, table):
    table[VEHICLE] = ((table[VEHICLE] * 3.6).round() / 3.6).round(4)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def wheel_speed_in_fine_steps(rng, table):
    table[WHEEL] = (table[WHEEL] * 100).round() / 100
    return Mutant(csv(table), (SAME,))


@mutation
def vehicle_speed_late(rng, table):
    late = int(rng.integers(20, 120))
    table[VEHICLE] = table[VEHICLE].shift(late).bfill()
    return Mutant(csv(table), (SAME, DOUBTFUL, ("refused",)))


@mutation
def pressure_off(rng, table):
    table[PRESSURE] += rng.choice([-1, 1]) * rng.uniform(4, 12)
    return Mutant(csv(table.round(3)), (SAME, DOUBTFUL, ("refused",)))


@mutation
def acceleration_clipped(rng, table):
    table[ACCELERATION] = table[ACCELERATION].clip(lower=-float(rng.uniform(7, 10)))
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def wheel_speed_clipped(rng, table):
    table[WHEEL] = table[WHEEL].clip(lower=float(rng.uniform(45, 60)))
    return Mutant(csv(table), (DOUBTFUL, ("refused",), SAME))


@mutation
def wheel_speed_stuck(rng, table):
    gone = stretch(rng, 200)
    table.iloc[gone, table.columns.get_loc(WHEEL)] = table[WHEEL].iloc[gone.start]
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def wheel_speed_lost(rng, table):
    gone = stretch(rng, int(rng.integers(2, 30)))
    table.iloc[gone, table.columns.get_loc(WHEEL)] = 0.0
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def spikes(rng, table):
    name = rng.choice([WHEEL, VEHICLE])
    at = rng.choice(np.arange(5, len(table) - 5, 7), 5, replace=False)
    table.loc[at, name] *= rng.choice([0.3, 1.7], 5)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def acceleration_noisy(rng, table):
    table[ACCELERATION] = (table[ACCELERATION] + rng.standard_normal(len(table))).round(3)
    return Mutant(csv(table), (SAME, DOUBTFUL))


@mutation
def pressure_dead(rng, table):
    table[PRESSURE] = 0.0
    return Mutant(csv(table), (("refused", PRESSURE, "is the sensor connected?"),))


# Files that are not what they should be


@mutation
def speeds_exchanged(rng, table):
    table[[WHEEL, VEHICLE]] = table[[VEHICLE, WHEEL]].to_numpy()
    return Mutant(csv(table), (("refused",),))


@mutation
def vehicle_speed_missing(rng, table):
    return Mutant(csv(table.drop(columns=VEHICLE)), (("refused", VEHICLE),))


@mutation
def acceleration_missing(rng, table):
    return Mutant(csv(table.drop(columns=ACCELERATION)), (SAME,))


@mutation
def pressure_missing(rng, table):
    return Mutant(csv(table.drop(columns=PRESSURE)), (SAME, DOUBTFUL, ("refused",)))


@mutation
def four_wheels(rng, table):
    names = {f"WheelSpeed_{w} [rad/s]": table[WHEEL] for w in ("FL", "FR", "RL", "RR")}
    return Mutant(csv(table.drop(columns=WHEEL).assign(**names)), (("refused", "WheelSpeed_FL", "WheelSpeed_RR"),))


@mutation
def header_missing(rng, table):
    return Mutant(csv(table, header=False), (("refused", "row 1", "header"),))


@mutation
def bad_cell(rng, table):
    at, name = int(rng.integers(len(table))), str(rng.choice(table.columns[1:]))
    bad = str(rng.choice(["x", "inf", "1.2.3", "--"]))
    table = table.astype(object)
    table.loc[at, name] = bad
    return Mutant(csv(table), (("refused", name, f"row {at + 2}", bad),))


@mutation
def letter(rng, table):
    return Mutant(b"Dear colleague,\nhere is the log you wanted.\n\nBest regards\n", (("refused",),))
