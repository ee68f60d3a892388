"""Ctrl-C answered at once: Python hears of it when the compiled program that runs has ended, which can take a minute.

The C level of the handler writes to a pipe without delay (`signal.set_wakeup_fd`), and a thread reads it.
`KeyboardInterrupt` comes in the main thread, as ever; where it comes in a finaliser, which would swallow it, it comes
again.
"""

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

from tuning.core.terminal import console, say

INTERRUPTED = 130
"""Exit status of a run ended from the keyboard."""
SHORTLY = 0.05
"""After which an interruption that was swallowed comes again, s."""
_kept: list[Callable[[], str]] = [lambda: "what is written stays"]
_answering: list[Callable[[], bool]] = []


@contextlib.contextmanager
def _among(entries: list[Any], entry: Any) -> Iterator[None]:
    entries.append(entry)
    try:
        yield
    finally:
        entries.remove(entry)


def keeping(what: Callable[[], str]) -> contextlib.AbstractContextManager[None]:
    """Within, whoever interrupts is told what is kept."""
    return _among(_kept, what)


def kept() -> str:
    """What whoever interrupts now is told is kept."""
    return _kept[-1]()


def answering(found: Callable[[], bool]) -> contextlib.AbstractContextManager[None]:
    """Within, a search answers an interruption with the best there is, if anything is found."""
    return _among(_answering, found)


def answered() -> bool:
    """Whether an interruption is answered by a search that has found something."""
    return any(found() for found in _answering)


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Within, the first Ctrl-C is answered at once, and the second ends the process. In the main thread only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    ours, theirs = os.pipe()
    os.set_blocking(theirs, False)
    repeated: list[int] = []
    thread = threading.Thread(target=_answer, args=(ours, repeated), daemon=True)
    thread.start()
    wakeup, unraisable = signal.set_wakeup_fd(theirs, warn_on_full_buffer=False), sys.unraisablehook

    def again() -> None:
        repeated.append(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)

    def swallowed(error: "sys.UnraisableHookArgs") -> None:
        if error.exc_type is KeyboardInterrupt:
            threading.Timer(SHORTLY, again).start()
        else:
            unraisable(error)

    sys.unraisablehook = swallowed
    try:
        yield
    finally:
        sys.unraisablehook = unraisable
        signal.set_wakeup_fd(wakeup)
        os.close(theirs)
        thread.join()
        os.close(ours)


def _answer(pipe: int, repeated: list[int]) -> None:
    heard = 0
    while numbers := os.read(pipe, 1):
        if numbers[0] in repeated:
            repeated.remove(numbers[0])
            continue
        heard += numbers[0] == signal.SIGINT
        if heard == 1:
            say(f"stopping when what is computed now has ended; {kept()}. Ctrl-C again ends at once")
        elif heard > 1:
            console.show_cursor(True)
            say("ended")
            os._exit(INTERRUPTED)
