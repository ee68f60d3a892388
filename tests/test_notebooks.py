"""Every notebook runs and ends in assertions."""

from pathlib import Path

import jax
import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOKS = sorted((Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))


def test_there_are_notebooks():
    assert {path.stem for path in NOTEBOOKS} >= {
        "exact_gradients",
        "road_from_a_log",
        "observers_and_gains",
        "limit_cycles_and_distances",
        "edges_to_wheel_speed",
        "side_slip",
        "input_delay",
        "whole_vehicles",
        "tuned_where_it_runs",
    }


BLANK = """
%reset -f
import gc
import jax
import matplotlib.pyplot
from tuning.core.compilation import keep_compiled
gc.set_threshold(100_000, 50, 100)
keep_compiled()
jax.config.update("jax_enable_x64", False)
matplotlib.pyplot.close("all")
del gc, jax, keep_compiled, matplotlib
"""
"""Nothing is left of the notebook before: no name, no figure, no double precision. As in the tests, programs are
kept and what is traced is not looked through."""


@pytest.fixture(scope="module")
def client():
    """A kernel for all of them: most of what a notebook takes is the start of a process and of JAX."""
    with pytest.MonkeyPatch.context() as environment:
        environment.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
        # As many as the tests have: kept programs are those of as many devices.
        environment.setenv("JAX_NUM_CPU_DEVICES", str(jax.local_device_count()))
        client = NotebookClient(nbformat.v4.new_notebook(), timeout=300, kernel_name="python3")
        with client.setup_kernel():
            yield client


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path, client):
    notebook = nbformat.read(path, as_version=4)
    assert notebook.cells[-1].source.lstrip().startswith("assert")
    notebook.cells.insert(0, nbformat.v4.new_code_cell(BLANK))
    client.nb = notebook
    client.execute(cleanup_kc=False)
