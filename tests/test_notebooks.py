"""Every notebook runs and ends in assertions."""

from pathlib import Path

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
    }


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook(path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    monkeypatch.setenv("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
    notebook = nbformat.read(path, as_version=4)
    assert notebook.cells[-1].source.lstrip().startswith("assert")
    NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
