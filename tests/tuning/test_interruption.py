"""Ctrl-C, of a process that computes where Python does not hear it; and a run that is ended part of the way."""

import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
import typer

from tuning.core import command, files, page, report
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


def found_in(folder, **changes):
    return Report({}, ["all of it"], [], results={folder / "result.json": {}})._replace(**changes)


def interrupting(function, after):
    """A function in which Ctrl-C is pressed, before it does anything or when it has."""
    calls = []

    def interrupted(*given, **named):
        calls.append(given)
        done = function(*given, **named) if after or len(calls) > 1 else None
        if len(calls) == 1:
            raise KeyboardInterrupt
        return done

    return interrupted


@pytest.mark.parametrize("several", [False, True])
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("where", [(report, "write_tables"), (page, "write_page"), (files, "write_json")])
def test_a_result_is_not_lost_where_its_page_is_being_written(where, after, several, tmp_path, monkeypatch, capsys):
    """Only a run that was to give more is said to have been ended."""
    module, name = where
    monkeypatch.setattr(module, name, interrupting(getattr(module, name), after))
    with pytest.raises(typer.Exit) as left:
        command.carry_out(tmp_path, lambda: ((), lambda: iter([found_in(tmp_path)]) if several else found_in(tmp_path)))
    text = (tmp_path / "report.html").read_text()
    assert left.value.exit_code == 130 and (tmp_path / "result.json").read_text() == "{}\n"
    assert "all of it" in text and ("ended from the keyboard" in text) == several and "more was to come" not in text
    assert ("what came before is on a page" if several else "all of it is on a page") in capsys.readouterr().out


@pytest.mark.parametrize("several", [False, True])
def test_the_page_is_written_again_only_where_more_was_to_come(several, tmp_path, monkeypatch):
    written, write = [], page.write_page
    monkeypatch.setattr(page, "write_page", lambda *x, ended: written.append(ended) or write(*x, ended=ended))
    command.carry_out(tmp_path, lambda: ((), lambda: iter([found_in(tmp_path)]) if several else found_in(tmp_path)))
    assert written == ([False, True] if several else [True])


def pressed(answer):
    """A run of a search in which Ctrl-C is pressed: before its first evaluation or later, with nothing or something
    to give."""

    def run(progress, journal):
        if answer != "at once":
            journal.evaluate(lambda: 1.0)
        if answer == "found":
            return Report({}, ["the best by then"], [], interrupted=True)
        raise KeyboardInterrupt

    return run


@pytest.mark.parametrize("resume", [None, False])
@pytest.mark.parametrize("answer", ["at once", "nothing", "found"])
def test_only_a_run_that_can_go_on_is_said_to(answer, resume, tmp_path, capsys):
    """Not one of a command without --resume, nor one that found the journal of another in its folder."""
    (tmp_path / "journal").write_text("of another run")
    wanted = SimpleNamespace(rounds=1, starts=1, to_json=dict)
    with pytest.raises(typer.Exit) as left:
        command.carry_out(
            tmp_path,
            lambda: ((), lambda: command.tuned("a command", wanted, tmp_path, pressed(answer))),
            force=True,
            resume=resume,
        )
    assert left.value.exit_code == 130
    goes_on = answer != "at once" and resume is not None
    assert ("go on with --resume" in capsys.readouterr().out) == goes_on


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
