"""Ctrl-C, of a process that computes where Python does not hear it; and a run that is ended part of the way."""

import signal
import subprocess
import sys

import pytest
import typer

from tuning.core import command
from tuning.core.report import Report

HEARING = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
"""
"""A process in the background ignores it, and so do those that it starts."""
DEAF = """
import hashlib, sys, threading
from tuning.core.interruption import interruptible, keeping
from tuning.core.terminal import say

computing = threading.Lock()
computing.acquire()

def ready():
    with computing:
        say("ready")

with interruptible(), keeping(lambda: "all of it is kept"):
    threading.Thread(target=ready, daemon=True).start()
    sys.setswitchinterval(1000)
    computing.release()
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
"""
"""The last line is minutes in C; until then no other thread has its turn."""


def test_the_first_is_answered_at_once_and_the_second_ends_the_process():
    with subprocess.Popen([sys.executable, "-c", HEARING + DEAF], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "ready\n"
            process.send_signal(signal.SIGINT)
            assert process.stdout.readline() == (
                "stopping when what is computed now has ended; all of it is kept. Ctrl-C again ends at once\n"
            )
            assert process.poll() is None
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 130 and process.stdout.read() == "ended\n"
        finally:
            process.kill()


SWALLOWED = """
import signal
from tuning.core.interruption import interruptible

class Finalised:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)

with interruptible():
    try:
        Finalised()
        while True:
            pass
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_one_that_comes_in_a_finaliser_comes_again():
    done = subprocess.run([sys.executable, "-c", HEARING + SWALLOWED], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0 and done.stderr == ""
    assert done.stdout.startswith("stopping when") and done.stdout.endswith("\ninterrupted\n")


@pytest.mark.parametrize("parts", [0, 1])
def test_a_run_that_is_interrupted_keeps_what_came_before(parts, tmp_path, capsys):
    def run():
        for _ in range(parts):
            yield Report({}, ["what came before"], [])
        raise KeyboardInterrupt

    with pytest.raises(typer.Exit) as left:
        command.carry_out(tmp_path / "out", lambda: ((), run))
    assert left.value.exit_code == 130 and "interrupted" in capsys.readouterr().out
    page = tmp_path / "out" / "report.html"
    assert page.exists() == bool(parts)
    assert not parts or "ended from the keyboard" in page.read_text()


def test_the_page_of_a_run_that_is_killed_between_its_parts_says_so(tmp_path):
    def run():
        yield Report({}, ["the first"], [])
        raise SystemExit(143)

    with pytest.raises(SystemExit):
        command.carry_out(tmp_path, lambda: ((), run))
    page = (tmp_path / "report.html").read_text()
    assert "the first" in page and "more was to come" in page


@pytest.mark.parametrize("killed_in", ["write_page", "write_json"])
def test_a_run_that_is_killed_leaves_a_result_with_its_page_or_none(killed_in, tmp_path, monkeypatch):
    """Also where the folder holds those of an earlier run."""
    result, page = tmp_path / "result.json", tmp_path / "report.html"
    result.write_text('{"of": "an earlier run"}')
    page.write_text("of an earlier run")

    def killed(*_, **__):
        raise SystemExit(143)

    module = {"write_page": "tuning.core.page", "write_json": "tuning.core.files"}[killed_in]
    monkeypatch.setattr(f"{module}.{killed_in}", killed)
    with pytest.raises(SystemExit):
        command.carry_out(tmp_path, lambda: ((), lambda: Report({}, ["new"], [], results={result: {}})), force=True)
    assert not result.exists()
    assert ("new" in page.read_text()) == (killed_in == "write_json")
    monkeypatch.undo()
    command.carry_out(tmp_path, lambda: ((), lambda: Report({}, ["new"], [], results={result: {}})), force=True)
    assert result.read_text() == "{}\n" and "new" in page.read_text() and "had not ended" not in page.read_text()
