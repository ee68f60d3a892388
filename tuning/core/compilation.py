"""Compiled programs kept on disk, shared by the command line, developers and tests; told of while they are made; and
dropped by a process that has too many."""

import os
from collections.abc import Callable
from pathlib import Path

import jax

FOLDER = "JAX_COMPILATION_CACHE_DIR"
"""Environment variable that names another folder than the usual one."""
LONG = 1.0
"""Tracing after which a user is told that something is compiled, s."""

MAPPINGS = Path("/proc/self/maps")
"""Where Linux lists those of a process, one in a line."""
MOST_MAPPINGS = 20_000
"""Of a process. Programs take some hundred each; Linux allows 65530, and beyond them a process ends by a signal."""


def keep_compiled() -> Path:
    """Keep compiled programs in one folder for all later runs on this machine: `~/.cache/absjax` unless told otherwise.

    Returns:
        The folder.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = Path(os.environ.get(FOLDER) or base / "absjax")
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    # The folder of XLA's own stores, for graphics processors only, would be part of what each program is called.
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")
    return folder


def drop_if_many(most: int | None = None) -> None:
    """Drop the compiled programs of this process if they take more mappings than `most`, by default `MOST_MAPPINGS`;
    called where others follow.

    What is used again is read from disk, or compiled again.
    """
    if MAPPINGS.exists() and MAPPINGS.read_bytes().count(b"\n") > (MOST_MAPPINGS if most is None else most):
        jax.clear_caches()


def tell_of_compilations(say: Callable[[str], None]) -> None:
    """Say once that programs are compiled, before the first that takes long."""
    told: list[str] = []

    def heard(event: str, duration_secs: float, **_: str | int) -> None:
        if event == "/jax/core/compile/jaxpr_trace_duration" and duration_secs > LONG and not told:
            told.append(event)
            say("  compiling; the programs are kept for the next run ...")

    jax.monitoring.register_event_duration_secs_listener(heard)
