"""How the house stands: imports go down, the models need little, and what is named exists."""

import ast
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = (
    ("absjax",),
    ("tuning.core",),
    ("tuning.logs",),
    ("tuning.road",),
    ("tuning.observers",),
    ("tuning.encoder",),
    ("tuning.sideslip",),
    ("tuning.speed",),
    ("tuning.cars", "tuning.vehicle.regulation"),
    ("tuning.controllers",),
    ("tuning.delay",),
    ("tuning.vehicle", *(f"tuning.vehicle.regulation.{name}" for name in ("tasks", "study", "command"))),
    ("tuning.cli", "tuning.__main__", "tuning"),
)
"""From the ground up: a room imports from its own floor and those below."""
SOURCES = sorted([*ROOT.glob("absjax/**/*.py"), *ROOT.glob("tuning/**/*.py")])


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def floor_of(module: str) -> int:
    fits = [(len(room), i) for i, rooms in enumerate(FLOORS) for room in rooms if f"{module}.".startswith(f"{room}.")]
    return max(fits)[1]


def imports_of(path: Path, *, at_import: bool) -> set[str]:
    """Modules a file imports; with `at_import` only those it needs to be imported itself."""
    found, todo = set(), [ast.parse(path.read_text())]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= {name for name in names if (ROOT / (name.replace(".", "/") + ".py")).exists()} or {node.module}
        inner = isinstance(node, ast.FunctionDef | ast.Lambda) or (
            isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING"
        )
        if not (at_import and inner):
            todo += ast.iter_child_nodes(node)
    return found


@pytest.mark.parametrize("path", SOURCES, ids=module_of)
def test_imports_go_down(path):
    own = floor_of(module_of(path))
    for name in imports_of(path, at_import=False):
        if name.split(".")[0] in ("absjax", "tuning"):
            assert floor_of(name) <= own, f"{module_of(path)} imports {name}, which stands above it"


def test_no_circles():
    edges = {module_of(path): imports_of(path, at_import=True) for path in SOURCES}
    done: set[str] = set()

    def visit(module, path):
        assert module not in path, " -> ".join([*path[path.index(module) :], module])
        if module in edges and module not in done:
            for name in edges[module]:
                visit(name, [*path, module])
            done.add(module)

    for module in edges:
        visit(module, [])


def test_the_models_need_jax_and_numpy_only():
    """SciPy comes with JAX."""
    blocked = ["optax", "matplotlib", "pandas", "rich", "typer", "pydantic", "cmaes", "pint", "jinja2"]
    modules = [module_of(path) for path in SOURCES if module_of(path).startswith("absjax")]
    code = f"import sys\nfor name in {blocked}: sys.modules[name] = None\nimport {', '.join(modules)}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    code = "import sys\nsys.modules['typer'] = None\nimport runpy\nrunpy.run_module('tuning', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 1 and "the command line needs typer: pip install 'absjax[tuning]'" in done.stderr


def test_what_is_named_exists():
    """Every `absjax....` and `tuning....` in backticks, in code, README and notebooks."""
    texts = [*SOURCES, *ROOT.glob("tests/**/*.py"), ROOT / "README.md", *ROOT.glob("notebooks/*.ipynb")]
    missing = set()
    for path in texts:
        for name in re.findall(r"`((?:absjax|tuning)(?:\.\w+)+)`", path.read_text()):
            if not exists(name):
                missing.add((path.name, name))
    assert not missing


def exists(name: str) -> bool:
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:k]))
        except ImportError:
            continue
        for part in parts[k:]:
            fields = getattr(found, "__dataclass_fields__", {})
            if not hasattr(found, part):
                return part in fields
            found = getattr(found, part)
        return True
    return False
