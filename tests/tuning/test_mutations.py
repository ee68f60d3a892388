"""Configurations and car files with mistakes in them: each is read right, or refused by file and entry."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from tuning.cli import app
from tuning.controllers.config import TuningConfig
from tuning.encoder.config import EncoderConfig
from tuning.logs.car import wheel_from
from tuning.observers.config import ObserverConfig

BASES = {
    "tune-abs": {
        "controller": "five_phase",
        "start": {"eps1": 25.0, "eps2": 40.0},
        "limits": {"eps1": [12.0, 60.0]},
        "tune": ["eps1", "eps2"],
        "roads": ["dry_asphalt", [0.8, 12.0, 0.1], {"surfaces": ["ice", "snow"], "changes": [20.0]}],
        "speeds_kmh": [60.0, 120.0],
        "wheel": {"radius": 0.31},
        "lag": 0.004,
        "pedal_rate": 300.0,
        "iterations": 5,
        "seed": 3,
        "scatter": 0.4,
    },
    "tune-observer": {
        "observer": "unknown_road",
        "start": {"ratio": 1.5},
        "limits": {"ratio": [1.0, 2.0]},
        "wheel": {"load": 2600.0},
        "speeds": [12.0, 20.0],
        "noise": [0.1, 0.5],
        "runs": 4,
        "seed": 1,
    },
    "tune-encoder": {
        "start": {"speed_gain": 100.0},
        "events": [8, 12],
        "harmonics": [2, 3],
        "clock": 1e-6,
        "references": ["constant"],
        "encoders": 3,
    },
    "car": {"wheel_inertia": 1.2, "radius": 0.3, "load": 2500.0, "brake_efficiency": 17.5, "source": "a bench"},
}
READERS = {
    "tune-abs": TuningConfig.from_json,
    "tune-observer": ObserverConfig.from_json,
    "tune-encoder": EncoderConfig.from_json,
    "car": wheel_from,
}
WRONG = {
    "a boolean": True,
    "text": "[/red] many",
    "not a number": float("nan"),
    "infinite": float("inf"),
    "a list of texts": ["a", "b"],
    "a dictionary": {"a": 1},
    "an absurd length": [1.0] * 5000,
    "an absurd number": 10**400,
    "nested deeply": json.loads("[" * 60 + "]" * 60),
}
NULLABLE = {"lag", "clock"}


def places(data, path=()):
    """Paths of all entries, those of nested ones included."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def changed(data, path, value):
    copy = json.loads(json.dumps(data))
    at = copy
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return copy


def mutations():
    """(command, text of the file, entry that has to be named) for every kind of mistake at drawn places."""
    rng, found = np.random.default_rng(20), []
    for command, base in BASES.items():
        every = list(places(base))
        for kind, wrong in WRONG.items():
            for i in rng.choice(len(every), 5, replace=False):
                path = every[i]
                if command == "car" and path[0] == "source":
                    continue
                text = json.dumps(changed(base, path, wrong))
                found.append(pytest.param(command, text, path, id=f"{command}, {path}: {kind}"))
        for i in rng.choice(len(base), 4, replace=False):
            name = list(base)[i]
            typo = {(k if k != name else name + "s"): v for k, v in base.items()}
            found.append(pytest.param(command, json.dumps(typo), (name + "s",), id=f"{command}, {name}: misspelt"))
            if name not in NULLABLE and (command, name) != ("car", "source"):
                text = json.dumps({**base, name: None})
                found.append(pytest.param(command, text, (name,), id=f"{command}, {name}: null"))
            again = json.dumps(base)[:-1] + f', "{name}": 1}}'
            found.append(
                pytest.param(command, again, (f"the key '{name}' stands twice",), id=f"{command}, {name}: twice")
            )
        found.append(pytest.param(command, "[" * 50000, ("nested too deeply",), id=f"{command}: bottomless"))
        found.append(pytest.param(command, json.dumps([base]), ("dictionary",), id=f"{command}: a list"))
        found.append(pytest.param(command, "", ("not JSON",), id=f"{command}: empty"))
    return found


def negatives():
    for command, path in (
        *(("tune-abs", (n,)) for n in ("lag", "pedal_rate", "iterations", "seed", "scatter")),
        *(("tune-abs", ("wheel", "radius")), ("tune-abs", ("speeds_kmh", 0)), ("tune-abs", ("start", "eps1"))),
        *(("tune-observer", (n,)) for n in ("runs", "seed")),
        *(("tune-observer", ("noise", 1)), ("tune-observer", ("wheel", "load")), ("tune-encoder", ("events", 0))),
        *(("tune-encoder", (n,)) for n in ("clock", "encoders")),
        *(("car", (n,)) for n in ("wheel_inertia", "radius", "load", "brake_efficiency")),
    ):
        yield pytest.param(
            command, json.dumps(changed(BASES[command], path, -2)), path, id=f"{command}, {path}: negative"
        )


CASES = [*mutations(), *negatives()]


def test_there_are_as_many_as_there_should_be():
    assert len(CASES) >= 200


@pytest.mark.parametrize("command, text, path", CASES)
def test_a_mistake_is_refused_by_file_and_entry(command, text, path, tmp_path):
    file = tmp_path / "[bold] config.json"
    file.write_text(text)
    log = tmp_path / "log.csv"
    log.write_text("time_s\n")
    arguments = ["identify", str(log), "--car"] if command == "car" else [command, "--config"]
    done = CliRunner().invoke(app, [*arguments, str(file), "--out", str(tmp_path / "out")])
    said = done.output.replace("\n", " ")
    assert done.exit_code == 2 and (done.exception is None or isinstance(done.exception, SystemExit)), done.output
    assert str(file) in said
    named = [part for part in path if isinstance(part, str)]
    alias = {"wheel_inertia": "inertia"}
    about = said.partition(str(file))[2]
    assert any(name in about or alias.get(name, name) in about for name in named), said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", BASES)
def test_what_means_the_same_is_read_the_same(command, tmp_path):
    """A byte order mark, whole numbers for floats and the other way round, the order of the entries."""
    from tuning.core.files import read_json

    base, read = BASES[command], READERS[command]
    variants = {
        "mark": b"\xef\xbb\xbf" + json.dumps(base).encode(),
        "order": json.dumps(dict(reversed(base.items()))).encode(),
        "numbers": re.sub(r"(?<=\d)\.0(?=[,\]}])", "", json.dumps(base)).encode(),
        "floats": re.sub(r'("(?:iterations|seed|runs|encoders)": \d+)', r"\1.0", json.dumps(base)).encode(),
    }
    for name, text in variants.items():
        file = tmp_path / f"{name}.json"
        file.write_bytes(text)
        assert read(read_json(file)) == read(base), name


def test_a_folder_is_checked_before_work_begins(tmp_path):
    config = tmp_path / "here" / "config.json"
    config.parent.mkdir()
    config.write_text("{}")
    (tmp_path / "file").write_text("")
    (tmp_path / "used").mkdir()
    (tmp_path / "used" / "result.json").write_text("{}")
    for out, options, message in (
        (tmp_path / "here", (), "lies in it and may be overwritten"),
        (tmp_path / "here", ("--force",), "lies in it and may be overwritten"),
        (tmp_path / "file", (), "there is a file of that name"),
        (tmp_path / "file" / "below", (), "is not a folder that can be written to"),
        (tmp_path / "used", (), "the folder is not empty; choose another, or --force"),
        (tmp_path / "used", ("--resume",), "there is no run to resume"),
    ):
        done = CliRunner().invoke(app, ["tune-abs", "--config", str(config), "--out", str(out), *options])
        assert done.exit_code == 2 and message in done.output.replace("\n", " "), done.output
    assert (tmp_path / "used" / "result.json").read_text() == "{}"
