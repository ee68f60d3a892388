"""The documentation: what it shows runs, where it points to exists, every command has its section."""

import json
import os
import re
import sys
import types
from pathlib import Path

import pytest

from tests.test_structure import exists
from tuning.cli import COMMANDS
from tuning.controllers.config import TuningConfig
from tuning.core.config import Entries
from tuning.encoder.config import EncoderConfig
from tuning.logs import tables
from tuning.observers.config import ObserverConfig
from tuning.sideslip.config import SideSlipConfig
from tuning.speed.config import SpeedConfig

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.glob("**/*.md"))]
LONGEST_README = 130
CONFIGURATIONS: dict[str, type[Entries]] = {
    "controllers.md": TuningConfig,
    "demo.md": TuningConfig,
    "observers.md": ObserverConfig,
    "encoder.md": EncoderConfig,
    "side-slip.md": SideSlipConfig,
    "speed.md": SpeedConfig,
    "regulation.md": TuningConfig,
}


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)


def links(page: Path) -> list[str]:
    """Targets of links and images outside of code."""
    text = re.sub(r"^```.*?^```|^    .*?$|`[^`\n]*`(?!\])", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    return re.findall(r"\]\(([^)\s]+)\)", text)


def anchors(page: Path) -> set[str]:
    """Of the headings, as they are made by Markdown's table of contents."""
    headings = re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in headings}


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=name_of)
def test_what_is_shown_runs(page, monkeypatch):
    """A page is a module, of the name it gives itself where it names its own components."""
    monkeypatch.setattr(tables, "READERS", dict(tables.READERS))
    monkeypatch.setenv("XLA_FLAGS", os.environ["XLA_FLAGS"])
    module = types.ModuleType("mine")
    monkeypatch.setitem(sys.modules, "mine", module)
    for number, block in enumerate(blocks(page, "python"), start=1):
        exec(compile(block, f"{name_of(page)}, block {number}", "exec"), module.__dict__)


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_configurations_shown_are_taken(name):
    found = blocks(DOCS / "commands" / name, "json")
    assert found
    for block in found:
        CONFIGURATIONS[name].from_json(json.loads(block))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for link in links(page):
        if re.match(r"\w+:", link):
            continue
        target, _, anchor = link.partition("#")
        path = (page.parent / target).resolve() if target else page
        assert path.exists(), f"{name_of(page)}: {link}"
        if anchor:
            assert anchor in anchors(path), f"{name_of(page)}: {link}"


def test_figures_are_used_and_small():
    shown = {(page.parent / link).resolve() for page in PAGES for link in links(page) if link.endswith(".png")}
    figures = set((DOCS / "figures").iterdir())
    assert figures == shown
    assert all(figure.stat().st_size < 250_000 for figure in figures)


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= LONGEST_README


def test_every_command_has_a_section_and_is_in_the_tables():
    sections = {
        heading
        for page in (DOCS / "commands").glob("*.md")
        for heading in re.findall(r"^#+ (.*)$", page.read_text(), re.MULTILINE)
    }
    assert set(COMMANDS) <= sections
    for page in (ROOT / "README.md", DOCS / "commands" / "index.md"):
        assert set(COMMANDS) == set(re.findall(r"^\| \[`([\w-]+)`\]", page.read_text(), re.MULTILINE))


def test_every_page_is_in_the_navigation():
    navigation = (ROOT / "mkdocs.yml").read_text()
    for page in DOCS.glob("**/*.md"):
        assert str(page.relative_to(DOCS)) in navigation


def test_what_is_named_exists():
    """Every `absjax....` and `tuning....` in backticks."""
    named = {name for page in PAGES for name in re.findall(r"`((?:absjax|tuning)(?:\.\w+)+)`", page.read_text())}
    assert not [name for name in named if not exists(name)]
