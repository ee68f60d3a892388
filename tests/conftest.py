"""Double precision for the whole suite, two CPU devices, so that sharing out over devices is tested; programs kept on
disk for the next run; and the order of the files, which processes share out among them."""

import gc
import os

import jax
import pytest

from tuning.core import compilation

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)
os.environ[compilation.FOLDER] = str(compilation.keep_compiled())

# A sixth of the time of compilation, for programs that run at two thirds of their speed; and a twelfth, by code made in
# one piece. The command line's tests leave both away (`test_cli.py`): there all is as a user has it.
# The width of vectors is the one XLA has by itself. Told, a command leaves it alone; else it would set another, too
# late for the process to have it, but all programs after it would be called otherwise and compiled anew.
FASTER = (
    "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1 --xla_cpu_prefer_vector_width=256"
)
if FASTER not in (flags := os.environ.get("XLA_FLAGS", "")):
    # Once, though processes inherit it from the first: the flags are part of what a kept program is called.
    os.environ["XLA_FLAGS"] = f"{flags} {FASTER}".strip()
FLAGS = os.environ["XLA_FLAGS"]

# Traced programs are millions of objects that stay: looking through them now and then takes a sixth of the tracing.
gc.set_threshold(100_000, 50, 100)

LONGEST = (
    "test_notebooks.py",
    "test_tune_abs.py",
    "test_abs_study.py",
    "test_observers.py",
    "test_foreign_components.py",
    "test_identify_logs.py",
    "test_identify_mutants.py",
    "test_cycles.py",
    "test_cli.py",
    "test_controllers.py",
    "test_docs.py",
    "test_encoder.py",
    "test_observer_loop.py",
    "test_ideal.py",
    "test_located_reference.py",
)


def pytest_collection_modifyitems(items):
    """The longest files first, so that no process waits for another at the end."""
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


@pytest.fixture(scope="module", autouse=True)
def programs_of_some_files():
    """Files share programs, most of all the small ones; a process that kept those of the whole suite would end.

    One that begins a file with many would drop them in the midst of it, where a command is run, and trace and read
    again what the file uses next.
    """
    yield
    assert os.environ["XLA_FLAGS"] == FLAGS, "all programs from here on would be called otherwise and compiled anew"
    compilation.drop_if_many(compilation.MOST_MAPPINGS // 2)
