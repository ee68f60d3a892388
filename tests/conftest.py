"""Double precision for the whole suite, two CPU devices, so that sharing out over devices is tested, and the order of
the files, which processes share out among them."""

import jax

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)

LONGEST = (
    "test_notebooks.py",
    "test_foreign_components.py",
    "test_docs.py",
    "test_observers.py",
    "test_cli.py",
    "test_abs_study.py",
    "test_cycles.py",
    "test_tune_abs.py",
    "test_controllers.py",
)


def pytest_collection_modifyitems(items):
    """The longest files first, so that no process waits for another at the end."""
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))
