"""The command line, run as a user runs it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import tuning
from tuning.cli import app
from tuning.core.command import configuration
from tuning.observers.config import ObserverConfig

DATA = Path(tuning.__file__).parent / "data"


def run(*arguments):
    command = [sys.executable, "-m", "tuning", *map(str, arguments)]
    environment = {name: value for name, value in os.environ.items() if name != "XLA_FLAGS"}
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)


def require_page(folder, *said):
    """A report that says how it was called, holds every figure, and names the words given."""
    page = (folder / "report.html").read_text("utf-8")
    assert page.count("data:image/png;base64,") == len(list(folder.rglob("*.png"))) > 0
    for words in ("python -m tuning ", *said):
        assert words in page, words


def test_identify_writes_result_and_figures(tmp_path):
    done = run("identify", DATA / "rig_65kmh.csv", "--out", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "load 2850 N" in done.stdout and "curve fit" in done.stdout
    result = json.loads((tmp_path / "result.json").read_text())
    assert {"segments", "log", "version"} <= set(result) and len(result["segments"]) == 1
    assert result["segments"][0]["peak_friction"] == pytest.approx(1.0332, rel=0.02)
    for figure in ("friction_curve.png", "log.png"):
        assert (tmp_path / figure).read_bytes().startswith(b"\x89PNG")
    require_page(tmp_path, "sound", "friction_curve.png", f"identify {DATA / 'rig_65kmh.csv'}", "brake_efficiency")
    assert str(tmp_path / "report.html") in done.stdout.replace("\n", "")


def test_describe_says_what_a_log_holds(tmp_path):
    """Names in brackets and other marks are shown as they are."""
    name = "<b>Müller & Söhne<b>.csv"
    log = pd.read_csv(DATA / "stop_dry_wet.csv")
    log = log.set_axis(["Time [s]", "nWheel[/red] [rad/s]", "vCar [m/s]", "pBrake [bar]", "$a_x$ [m/s^2]"], axis=1)
    log["$a_x$ [m/s^2]"] = log["$a_x$ [m/s^2]"].clip(-8)
    log.to_csv(tmp_path / name, index=False)
    columns = ("--columns", "wheel_speed=nWheel[/red] [rad/s],acceleration=$a_x$ [m/s^2]")
    command = ["describe", str(tmp_path / name), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, [*command, *columns])
    assert done.exit_code == 0, done.output
    said = " ".join(done.output.split())
    assert "wheel_speed: column 'nWheel[/red] [rad/s]' in rad/s" in said
    assert "verdict: doubtful acceleration: sits at -8 m/s^2 in 41% of its samples" in said
    result = json.loads((tmp_path / "out" / "result.json").read_text())
    assert result["signals"]["acceleration"]["clipped"] == [-8.0] and result["step"] == pytest.approx(1e-3)
    assert result["signals"]["wheel_speed"]["rate"] == pytest.approx(1000)
    assert (tmp_path / "out" / "description.png").read_bytes().startswith(b"\x89PNG")
    require_page(
        tmp_path / "out",
        "signals: &lt;b&gt;Müller &amp; Söhne&lt;b&gt;.csv",
        "nWheel[/red]",
        "<strong>doubtful</strong>",
    )
    assert "<b>" not in (tmp_path / "out" / "report.html").read_text("utf-8")
    done = CliRunner().invoke(app, [*command, "--force", "--columns", "time=Zeit [s]"])
    assert (
        done.exit_code == 2
        and "no column 'Zeit [s]' for time; there are Time [s], nWheel[/red] [rad/s]," in done.output
    )
    assert "[s]" in CliRunner().invoke(app, ["identify", "--help"]).output


def test_identify_takes_a_channel_map(tmp_path):
    table = pd.read_csv(DATA / "rig_65kmh.csv").iloc[:1200].rename(columns={"vehicle_speed_m_s": "belt"})
    table["belt"] *= 3.6
    table.to_csv(tmp_path / "rig.csv", index=False)
    (tmp_path / "map.toml").write_text('vehicle_speed = "belt:km/h"\n')
    arguments = [str(tmp_path / "rig.csv"), "--load", "2850", "--channels", str(tmp_path / "map.toml")]
    done = CliRunner().invoke(app, ["identify", *arguments, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert len(json.loads((tmp_path / "out" / "result.json").read_text())["segments"]) >= 1


def test_tune_observer_on_a_log_prints_the_certificate_and_can_go_on(tmp_path):
    config = {"observer": "constant", "starts": 1, "screened": 1, "iterations": 2, "refinements": 0}
    (tmp_path / "config.json").write_text(json.dumps(config))
    log = ("--log", DATA / "rig_65kmh.csv")
    done = run("tune-observer", "--config", tmp_path / "config.json", *log, "--out", tmp_path / "a")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "certified; slowest rate" in done.stdout and "held out" in done.stdout
    assert "rig_65kmh.csv: what the adaptive observer asks of a run: holds" in done.stdout
    assert {path.name for path in (tmp_path / "a").glob("*.png")} == {"history.png", "log.png"}
    result = json.loads((tmp_path / "a" / "result.json").read_text())
    require_page(tmp_path / "a", "certified; slowest rate", "config, of result.json", "held out")
    following = ObserverConfig.from_json(configuration(tmp_path / "a" / "result.json"))
    assert following.start == result["parameters"] and following.observer == "constant"
    assert configuration(None) == {} and configuration(tmp_path / "config.json") == config

    # As kill -9 leaves it at a third: the journal cut short in the middle of a record, and nothing else.
    whole, cut = tmp_path / "a" / "journal", tmp_path / "b" / "journal"
    cut.parent.mkdir()
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 3])
    done = run("tune-observer", *log, "--out", tmp_path / "b", "--resume")
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads((tmp_path / "b" / "result.json").read_text()) == result
    assert cut.read_bytes() == whole.read_bytes()


def test_encoder_takes_a_log(tmp_path):
    command = ["encoder", str(DATA / "encoder_edges.csv"), "--out", str(tmp_path), "--harmonics", "5"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    result = json.loads((tmp_path / "result.json").read_text())
    assert len(result["coefficients"]["speed"]) == 10 and len(result["tooth_errors"]) == 60
    assert (tmp_path / "wheel_speed.csv").read_text().startswith("time_s,wheel_speed_rad_s,")
    figures = {"signals.png", "spectrum.png", "teeth.png", "coefficients.png"}
    assert {path.name for path in tmp_path.glob("*.png")} == figures
    require_page(tmp_path, "the encoder", "--harmonics")


@pytest.mark.parametrize(
    "arguments, message",
    [
        (("identify", "nothing.csv", "--out", "x"), "nothing.csv: no such file"),
        (("identify", DATA / "rig_65kmh.csv", "--out", "x", "--columns", "speed=v"), "signal 'speed' is unknown"),
        (("identify", DATA / "rig_65kmh.csv", "--out", "x", "--load", "-3"), "Wheel.load = -3"),
        (("identify", DATA / "rig_65kmh.csv", "--out", "x", "--car", "no.json"), "no.json: no such file"),
        (("encoder", DATA / "encoder_edges.csv", "--out", "x", "--column", "t"), "no column 't'; there are edge_tick"),
        (("tune-abs", "--config", DATA / "rig_65kmh.csv", "--out", "x"), "not JSON"),
        (("abs-sets", "--only", "six_phase", "--out", "x"), "--only: 'six_phase' is unknown; there are five_phase"),
        (("tune-observer", "--observer", "kalman", "--out", "x"), "'kalman' is unknown; there are constant"),
        (("tune-observer", "--log", DATA / "stop_dry_wet.csv", "--out", "x"), "no longitudinal force"),
    ],
)
def test_errors_are_a_line_and_an_exit_status(arguments, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert (done.exit_code, type(done.exception)) == (2, SystemExit)
    assert message in done.output.replace("\n", " ") and "Traceback" not in done.output
    assert not (tmp_path / "x").exists()


def test_an_error_of_the_process(tmp_path):
    done = run("identify", "nothing.csv", "--out", tmp_path / "x")
    assert done.returncode == 2 and "nothing.csv: no such file" in done.stdout and "Traceback" not in done.stderr
