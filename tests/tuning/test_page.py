"""The page of a run: complete in itself, the verdict first, text as users wrote it."""

import base64
import importlib
import re
import sys
from html.parser import HTMLParser
from io import StringIO
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
import typer
from rich.cells import cell_len
from rich.console import Console
from typer.main import get_command
from typer.testing import CliRunner

import tuning
from tuning.cli import COMMANDS, app
from tuning.core import command as core
from tuning.core.about import About
from tuning.core.figures import save
from tuning.core.page import MOST_ROWS, write_page
from tuning.core.report import Report, rows_tables, table_name, write_tables

NAME = '<b>Müller & Söhne</b> "<script>alert(1)</script>\x07'
TOLD = NAME.replace("\x07", "\ufffd")
ROOMS = [path for path in Path(tuning.__file__).parent.glob("*/about.py") if path.parent.name != "core"]
VOID = {"meta", "img"}


class Page(HTMLParser):
    """Elements in order, with their attributes and text; every element must be closed in its turn."""

    def __init__(self, text: str):
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append((self.open[-1], data.strip()))

    def said(self, tag):
        return [text for where, text in self.texts if where == tag]


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    figure, axes = plt.subplots(figsize=(1, 1))
    axes.plot([0, 1])
    picture = save(figure, folder / "curve.png")
    config = {"seed": 7, "low": float("nan"), "high": float("inf"), "log": NAME}
    rows = [{"log": NAME, "value": float("nan"), "count": i, NAME: None} for i in range(MOST_ROWS + 5)]
    report = Report(
        {f"errors: {NAME}": rows, "one": [{"x": float("-inf"), "told": True}]},
        [f"log: {NAME}"],
        [picture],
        verdict="doubtful",
        reasons=[f"{NAME}: drifts"],
        warnings=[f"warning: {NAME}"],
        seeds={"noise": 3},
        results={folder / "result.json": {"config": config}},
    )
    report = report._replace(files=[*report.files, *write_tables(report, folder / "tables")])
    path = folder / "report.html"
    path.write_text("of another run")
    about = About("A title", f"What it did with {NAME}.", {"curve": f"Shows {NAME}", "errors": "By log."})
    assert write_page(path, [report], about, 3.2) == path
    return path, Page(path.read_text("utf-8"))


def test_text_of_users_is_text(written):
    path, page = written
    assert {tag for tag, _ in page.elements} & {"b", "script"} == set()
    for tag in ("td", "th", "h3", "li", "p"):
        assert any(TOLD in text for text in page.said(tag)), tag
    assert any(given.get("alt") == f"Shows {TOLD}" for _, given in page.elements)
    assert list(path.parent.glob("*.part")) == []


def test_it_needs_nothing_else(written):
    path, page = written
    for tag, given in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base", "form")
        assert not any(name.startswith("on") for name in given)
        for name in ("src", "href", "srcset"):
            assert given.get(name, "#").startswith(("#", "data:image/png;base64,"))
    assert not re.search(r"url\(|@import|https?:", path.read_text("utf-8"))
    (source,) = [given["src"] for tag, given in page.elements if tag == "img"]
    assert base64.b64decode(source.split(",")[1]) == (path.parent / "curve.png").read_bytes()


def test_the_verdict_stands_first(written):
    page = written[1]
    texts = [text for _, text in page.texts]
    order = ("doubtful", f"{TOLD}: drifts", f"warning: {TOLD}", f"log: {TOLD}", "one", f"Shows {TOLD}", "Seeds")
    places = [texts.index(text) for text in order]
    assert places == sorted(places)
    headings = [text for tag, text in page.texts if tag == "h2"]
    assert headings == ["Verdict", "What was found", "How it was made"]


def test_numbers_that_are_none_and_long_tables(written):
    path, page = written
    cells = page.said("td")
    assert cells.count("nan") == MOST_ROWS + 1 and {"-inf", "inf", "yes", "–"} <= set(cells)
    assert cells[cells.index("noise") + 1] == "3" and "7" in cells
    assert f"{MOST_ROWS} of {MOST_ROWS + 5} rows; all of them are in tables/errors.csv" in page.said("p")
    assert len((path.parent / "tables" / "errors.csv").read_text().splitlines()) == MOST_ROWS + 6


def test_a_table_on_the_terminal_has_dashes_for_what_is_not_there():
    (table,) = rows_tables([{"a_name": "x_y", "b": 1.5}, {"a_name": "z", "b": None}], "title", 80)
    assert [str(cell) for cell in table.columns[1].cells] == ["1.5", "-"]
    assert [str(cell) for cell in table.columns[0].cells] == ["x y", "z"]


WIDE = [
    {
        "km/h": v,
        "road": road,
        **{f"quantity {i}: published [m]": 10.0 * i + v for i in range(1, 10)},
        "日本_語": "a" * 20,
    }
    for v in (60, 120)
    for road in ("wet_cobblestones", "snow")
]


@pytest.mark.parametrize("room, in_parts, tables", [(240, True, 1), (100, True, 2), (80, True, 3), (80, False, 1)])
def test_no_word_of_a_table_is_cut(room, in_parts, tables):
    """Nor broken; each of its parts begins with the columns that tell the rows apart."""
    parts = rows_tables(WIDE, "title", room, in_parts=in_parts)
    assert len(parts) == tables
    told = StringIO()
    console = Console(file=told, width=room, markup=False, highlight=False)
    for part in parts:
        console.print(part, crop=False)
        assert [str(column.header) for column in part.columns][:2] == ["km/h", "road"]
    lines = told.getvalue().splitlines()
    assert not in_parts or max(map(cell_len, lines)) <= room
    words = re.sub(r"[┃│]", " ", told.getvalue()).split()
    for row in WIDE:
        for key, value in row.items():
            told = value if isinstance(value, str) else f"{value:g}"
            assert set(f"{key} {told}".replace("_", " ").split()) <= set(words)


def test_every_table_has_a_file_name():
    assert table_name("日本: x") == table_name("") == "table" and len(table_name("a" * 999)) == 100


def test_every_figure_has_a_caption():
    """By the names of the files that the code of a room writes."""
    for room in ROOMS:
        sources = [path.read_text() for path in room.parent.glob("**/*.py")]
        names = {re.sub(r"\{.*\}", "", name) for text in sources for name in re.findall(r'"([\w{}]+\.png)"', text)}
        parts = [part for about in abouts(room) for part in about.captions]
        names.discard(".png")
        assert names and [name for name in names if not any(part in name for part in parts)] == []


def test_a_caption_is_that_of_the_words_a_title_begins_with():
    about = About("title", "did", {"held-out": "of other stops", "each road": "by road"})
    assert about.caption("each road: errors on held-out stops") == "by road"
    assert about.caption("on held-out stops of each road") == "of other stops"
    assert about.caption("tuned") == ""


def test_every_command_says_what_it_did():
    titles = [about.title for room in ROOMS for about in abouts(room)]
    assert len(titles) == len(set(titles)) == len(COMMANDS)


def test_every_command_goes_where_reports_are_written(tmp_path, monkeypatch):
    """With the least that each of them asks for, and none of its work done."""
    carried = []

    def note(out, work, about=None, **_):
        carried.append(about)

    for module in (core, *{sys.modules[command.__module__] for command in COMMANDS.values()}):
        monkeypatch.setattr(module, "carry_out", note, raising=False)
    for name, command in get_command(app).commands.items():  # pyright: ignore[reportAttributeAccessIssue]
        words = ["log.csv" for word in command.params if word.required and word.param_type_name == "argument"]
        done = CliRunner().invoke(app, [name, *words, "--out", str(tmp_path)])
        assert done.exit_code == 0, (name, done.output)
        assert isinstance(carried[-1], About), f"{name} hands no tuning.core.about.About on to carry_out or tune"
    assert len(carried) == len({about.title for about in carried}) == len(COMMANDS)


def test_a_run_that_was_interrupted_has_a_page_that_says_so(tmp_path):
    parts = [
        Report({"first": [{"x": 1.0}]}, [], []),
        Report({}, ["half"], [], interrupted=True),
        Report({}, ["no"], []),
    ]
    with pytest.raises(typer.Exit) as left:
        core.carry_out(tmp_path, lambda: ((), lambda: iter(parts)))
    assert left.value.exit_code == 130
    texts = [text for _, text in Page((tmp_path / "report.html").read_text()).texts]
    assert any("ended from the keyboard" in text for text in texts) and "half" in texts and "no" not in texts
    assert (tmp_path / "tables" / "first.csv").read_text() == "x\n1.0\n"


def abouts(path: Path) -> list[About]:
    module = importlib.import_module(f"tuning.{path.parent.name}.about")
    return [value for value in vars(module).values() if isinstance(value, About)]
