"""The table of the sources: its commands are taken as they stand, they write what it says, its tests exist."""

import ast
import itertools
import re
import shlex
from pathlib import Path

import pytest
import typer

from tuning.cli import app
from tuning.core.report import table_name

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "sources.md"
ROWS = re.findall(r"^\| (?!what )(.+?) \| (.+) \|$", PAGE.read_text(), re.MULTILINE)
COMMANDS = sorted(set(re.findall(r"`python -m tuning ([^`]+)`", PAGE.read_text())))
TESTS = sorted(set(re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", PAGE.read_text())))
FILES = sorted(set(re.findall(r"`(\w+\.(?:png|json|csv))`", PAGE.read_text())))
OTHERWISE = re.compile(r"not built|nothing to compute|Theorem \d\.\d, below$")


def constants(node: ast.AST) -> set[str]:
    return {n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)}


def filled(text: ast.JoinedStr, words: set[str]) -> set[str]:
    """The names an f-string may stand for, its placeholders filled with words of the same module."""
    parts = [{p.value} if isinstance(p, ast.Constant) else words for p in text.values]
    return {"".join(map(str, name)) for name in itertools.product(*parts)}


def written(path: Path) -> set[str]:
    """Names of the files a module may write: as it spells them, and of its tables, by their titles."""
    tree = ast.parse(path.read_text())
    spelt = constants(tree)
    words = {word for word in spelt if re.fullmatch(r"[a-z_0-9]+", word)}
    patterns = [
        n for n in ast.walk(tree) if isinstance(n, ast.JoinedStr) and any(c.endswith(".png") for c in constants(n))
    ]
    return spelt | {f"{table_name(title)}.csv" for title in spelt} | {x for p in patterns for x in filled(p, words)}


@pytest.mark.parametrize("what, shown", ROWS, ids=[what for what, _ in ROWS])
def test_every_row_is_shown_or_says_what_is_missing(what, shown):
    assert re.search(r"`(python -m tuning |tests/|notebooks/)", shown) or OTHERWISE.match(shown)


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_are_taken(line):
    """Parsed as on the command line, nothing run: an unknown command, option or missing argument is an error."""
    name, *arguments = shlex.split(line)
    command = typer.main.get_command(app).commands[name]
    command.make_context(name, arguments)
    assert all((ROOT / argument).exists() for argument in arguments if "/" in argument)


def test_what_the_commands_write_is_called_so():
    names = set().union(*(written(path) for path in (ROOT / "tuning").glob("**/*.py")))
    assert not set(FILES) - names


@pytest.mark.parametrize("path, name", TESTS, ids=[name for _, name in TESTS])
def test_tests_exist(path, name):
    functions = [n.name for n in ast.parse((ROOT / path).read_text()).body if isinstance(n, ast.FunctionDef)]
    assert name in functions


def test_notebooks_exist():
    named = re.findall(r"`(notebooks/\w+\.ipynb)`", PAGE.read_text())
    assert named and all((ROOT / name).exists() for name in named)
