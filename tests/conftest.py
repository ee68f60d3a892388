"""Double precision for the whole suite, two CPU devices, so that sharing out over devices is tested, and how tests
are shared out over processes: by file, because the tests of a file share what is compiled, but for those that start
processes of their own."""

import jax
import pytest

jax.config.update("jax_enable_x64", True)
jax.config.update("jax_num_cpu_devices", 2)

ONE_BY_ONE = ("test_notebooks.py", "test_cli.py")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """The long ones first, so that no process is left with them at the end."""
    items.sort(key=lambda item: item.path.name not in ONE_BY_ONE)
    for item in items:
        group = item.nodeid if item.path.name in ONE_BY_ONE else str(item.path)
        item.add_marker(pytest.mark.xdist_group(group))
