"""How a run starts: wide vectors where the processor has them, compiled programs kept for the next run."""

import subprocess
import sys

import pytest

from absjax import vectors
from tuning.core import compilation

FLAG = "--xla_cpu_prefer_vector_width=512"


@pytest.mark.parametrize(
    "cpu, before, wide, after",
    [
        ("flags: fpu avx2 avx512f", "", True, FLAG),
        ("flags: fpu avx512f", "--xla_dump_to=x", True, f"--xla_dump_to=x {FLAG}"),
        ("flags: fpu avx2", "", False, ""),
        (None, "", False, ""),
        ("flags: avx512f", "--xla_cpu_prefer_vector_width=256", False, "--xla_cpu_prefer_vector_width=256"),
        ("flags: avx2", FLAG, True, FLAG),
    ],
)
def test_vectors_are_as_wide_as_the_processor_has_them(cpu, before, wide, after, tmp_path, monkeypatch):
    file = tmp_path / "cpuinfo"
    if cpu is not None:
        file.write_text(cpu)
    monkeypatch.setattr(vectors, "CPU", file)
    monkeypatch.setenv("XLA_FLAGS", before)
    assert vectors.prefer_wide_vectors() is wide
    assert vectors.os.environ["XLA_FLAGS"] == after


PROGRAM = """
import jax, jax.numpy as jnp
from tuning.core import compilation
compilation.keep_compiled()
hits = []
jax.monitoring.register_event_listener(lambda event, **_: hits.append(event) if event.endswith("cache_hits") else None)
print(float(jax.jit(lambda x: jnp.sin(x) * 3)(1.0)), len(hits))
"""


def test_a_program_is_compiled_once_for_all_runs_wherever_it_is_kept(tmp_path, monkeypatch):
    def run(folder):
        monkeypatch.setenv(compilation.FOLDER, str(folder))
        command = [sys.executable, "-c", PROGRAM]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()

    here, there = tmp_path / "programs", tmp_path / "moved"
    first = run(here)
    assert any(here.iterdir())
    second = run(here.rename(there))
    assert first[0] == second[0] and (int(first[1]), int(second[1]) > 0) == (0, True)


def test_a_long_compilation_is_told_of_once(monkeypatch):
    heard, said = [], []
    monkeypatch.setattr(compilation.jax.monitoring, "register_event_duration_secs_listener", heard.append)
    compilation.tell_of_compilations(said.append)
    for event, seconds in (("/jax/core/compile/jaxpr_trace_duration", s) for s in (0.1, 2.0, 3.0)):
        heard[0](event, seconds)
    assert len(said) == 1 and "compiling" in said[0]
