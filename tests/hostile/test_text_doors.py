# SPDX-License-Identifier: GPL-3.0-or-later
"""Text out of files at each door it leaves by: terminal, log, label, Markdown, CSV, web page, JSON."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import re
import sys
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import typer
from rich.console import Console

import downstream_hpe.cli.console as hpe_console
import downstream_hpe.escape as hpe_escape
from blender_addon.core.build import Build
from blender_addon.core.labels import one_line, wrapped
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.scores import evaluate
from downstream_hpe.evaluation.scores import markdown as scores_table
from downstream_hpe.prediction.records import RecordWriter, record
from generator.cli import app as app_module
from generator.cli import console as console_module
from generator.cli.console import say
from generator.cli.heads import _print_heads
from generator.cli.reporter import JsonReporter, TerminalReporter
from generator.dataset.export import numbered
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.proof.verify_report import Check, VerifyReport
from generator.dataset.show.card import dataset_card
from generator.dataset.show.report.page import page_text
from generator.errors import HeadturnError
from generator.escape import csv_text, html_json, markdown, markdown_code, printable
from generator.execution.replay import Replay
from generator.execution.status import LoggingReporter
from generator.plan.pose_plans import PosePlans, poses_csv, read_pose_plans
from generator.plan.poses import grid_plan

CONTROLS = (
    "\x1b[2J\x1b[31mred",  # clears a screen
    "\x1b]0;title\x07",
    "\x1b]52;c;cm0gLXJm\x07",  # writes the clipboard
    "\x9b31m",  # CSI in one character
    "a\rok    everything",
    "a\nok    everything",
    "a\x08\x08\x7f",
    "a\u202egnp.exe",  # turns the direction of what follows
    "a\u2066b\u2069\u200f",
    "a\u2028b\ufeff\u00ad",
    "a\x00b",
    "a\udc80b",  # no text at all
)
MARKUP = (
    "[bold red]x[/bold red]",
    "[/]",  # an end without a beginning, on which rich raises
    "[link=https://example.org]x[/link]",
    ":warning:",
)
HTML = (
    "<img src=x onerror=alert(1)>",
    "</script><script>alert(1)</script>",
    "<!--<script>",
    "]]>&lt;b&gt;",
    "\" onload=alert(1) '",
)
MARKDOWN = (
    *HTML,
    "[x](javascript:alert(1))",
    "![x](https://example.org/seen.png)",
    "<javascript:alert(1)>",
    "a | b | c |",
    "a \\| b \\",
    "a\n| --- |\n# b\n---\n",
    "`a` ``b`` <b>",
    "``` \n<img src=x>",
    "**bold** _it_ ~~gone~~ $\\href{x}{y}$",
)
FORMULAS = (
    "=1+1",
    "+1",
    "-1",
    "@SUM(A1)",
    "\t=1",
    "\r=1",
    "  =1",
    '=HYPERLINK("http://x","y")',
    "a;=1+1",  # a list separator in other countries
    "a,=1+1",
    "＝1",
)


def stranger(text: str) -> HeadRow:
    """A head of which everything that is free text is this text."""
    return HeadRow(
        subject="s1", expression="neutral", source=text, mesh_path="a.obj", file_sha256=(), license=text,
        redistributable=True, attribution=text, units="cm", mm_per_unit=10.0, up="+Y", forward="+Z",
        pivot=(0.0, 0.0, 0.0), radius_mm=100.0, distance_mm=700.0, lens_mm=85.0, vertices=3, triangles=1,
        split="train", problems=(text,),
    )  # fmt: skip


def harmless(shown: str) -> bool:
    """Nothing that a terminal takes for an order, beside the ends of our own lines."""
    return all(character.isprintable() or character == "\n" for character in shown)


def console(terminal: bool = False) -> tuple[Console, io.StringIO]:
    file = io.StringIO()
    return Console(file=file, width=200, force_terminal=terminal, color_system=None, emoji=False), file


# ---- terminal -----------------------------------------------------------


def said(text: str) -> str:
    shown, file = console()
    say(text, shown)
    return file.getvalue()


def an_error(text: str) -> str:
    shown, file = console()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(app_module, "err", shown)
        with contextlib.suppress(SystemExit), app_module._one_line_errors():
            raise HeadturnError(text)
    return file.getvalue()


def a_note(text: str) -> str:
    shown, file = console()
    with TerminalReporter(shown) as reporter:
        reporter.stage(text, 3)
        reporter.note(text)
    return file.getvalue()


def a_list(text: str) -> str:
    shown, file = console()
    row = {"subject": text, "expression": text, "texture": None, "license": text, "problems": [text, text]}
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(sys.modules["generator.cli.heads"], "out", shown)
        _print_heads(text, Path(text.replace("\0", "")), [{**row, "skipped": False}])
    return file.getvalue()


def a_verification(text: str) -> str:
    check = Check("labels")
    check.add([text])
    return "".join(said(line) for line in VerifyReport((check,)).text().split("\n"))


def a_replay(text: str) -> str:
    found = Replay(text, False, (text,), (text,))
    return "".join(said(line) for line in found.text().split("\n"))


def a_label(text: str) -> str:
    return "\n".join([one_line(text), *wrapped(text, 20)])


def an_addon_report(text: str) -> str:
    class Ended:
        pid, log, exit_code = 1, (text, f"headturn: {text}"), 1

        def poll(self) -> list:
            return [{"event": "note", "text": text}]

        def interrupt(self) -> None: ...

        def close(self) -> None: ...

    build = Build()
    build.start(Ended(), Path("out"))  # type: ignore[arg-type]
    build.poll()
    return build.report


def an_hpe_error(text: str) -> str:
    shown, file = console()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(hpe_console, "err", shown)
        with contextlib.suppress(SystemExit), hpe_console.one_line_errors():
            raise DataError(text)
    return file.getvalue()


def an_hpe_line(text: str) -> str:
    with pytest.MonkeyPatch.context() as patched:
        lines: list[str] = []
        patched.setattr(typer, "echo", lines.append)
        hpe_console.say(text)
    return "".join(f"{line}\n" for line in lines)


def a_log(text: str) -> str:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        with LoggingReporter(TerminalReporter(console()[0]), Path(folder)) as logged:
            logged.note(text)
        return (Path(folder) / "build.log").read_text(encoding="utf-8")


def json_lines(text: str) -> str:
    file = io.StringIO()
    reporter = JsonReporter(file)
    reporter.note(text)
    assert json.loads(file.getvalue())["text"] == text
    return file.getvalue()


TERMINAL: dict[str, tuple[Callable[[str], str], int]] = {
    "say": (said, 1),
    "error": (an_error, 1),
    "note and stage": (a_note, 2),
    "verify": (a_verification, 1),
    "replay": (a_replay, 3),
    "build.log": (a_log, 1),
    "JSON lines": (json_lines, 1),
    "downstream error": (an_hpe_error, 1),
    "downstream line": (an_hpe_line, 1),
}
"""By door: what it shows of a text, and on how many lines."""


@pytest.mark.parametrize("text", [*CONTROLS, *MARKUP], ids=ascii)
@pytest.mark.parametrize("door", TERMINAL)
def test_a_terminal_gets_no_orders(door: str, text: str) -> None:
    show, lines = TERMINAL[door]
    shown = show(text)
    # Surrogates are no text, so that a stream would raise; \x7f is all that JSON leaves as it is.
    assert harmless(shown.replace("\x7f", "") if door == "JSON lines" else shown), ascii(shown)
    assert shown.count("\n") == lines, "a stranger's line break ends no line"
    if text in MARKUP:
        assert text in shown, "and means nothing to rich"


@pytest.mark.parametrize("text", [*CONTROLS, *MARKUP], ids=ascii)
@pytest.mark.parametrize("show", [a_list, a_label, an_addon_report], ids=lambda door: door.__name__)
def test_tables_and_labels_get_no_orders(show: Callable[[str], str], text: str) -> None:
    shown = show(text)
    assert harmless(shown), ascii(shown)
    if text in MARKUP and show is a_list:
        assert shown.count(text) >= 5


def test_everything_that_a_command_prints_goes_through_the_door() -> None:
    """Who adds a command finds this: JSON by typer.echo, all else by say or as shown."""
    for folder, own in (("generator", "console.py"), ("downstream_hpe", "console.py")):
        for module in (Path(__file__).parents[2] / folder / "cli").glob("*.py"):
            if module.name in (own, "__init__.py"):  # which says that it was stopped, before rich is there
                continue
            text = module.read_text(encoding="utf-8")
            assert not re.search(r"\b(err|out)\.print\((?!table\))|\bprint\(f", text), module
            for echoed in re.findall(r"typer\.echo\(\s*(.+)", text):
                assert echoed.startswith(("json.dumps(", "markdown(", '"\\n".join(tables)')), (module, echoed)
            for asked in re.findall(r"typer\.(?:confirm|prompt|secho)\((.+)", text):
                assert asked.startswith("printable("), (module, asked)
    assert console_module.printable is printable


# ---- Markdown -----------------------------------------------------------


def a_card(text: str) -> str:
    versions = {"headturn": text}
    manifest = Manifest(versions, {}, (), "none", 1, created_by=text)
    return dataset_card(manifest, [stranger(text)])


PLAIN_CARD = a_card("plain")


def active(text: str) -> list[str]:
    """What HTML would make of Markdown: its tags, by name."""
    found: list[str] = []

    class Tags(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list) -> None:
            found.append(tag)

        def handle_comment(self, data: str) -> None:
            found.append("comment")

    parser = Tags()
    parser.feed(text)
    parser.close()
    return found


@pytest.mark.parametrize("text", [*MARKDOWN, *CONTROLS], ids=ascii)
def test_a_card_shows_text_and_obeys_none(text: str) -> None:
    card = a_card(text)
    assert [t for t in active(card) if t != "code"] == [t for t in active(PLAIN_CARD) if t != "code"]
    assert card.count("\n") == PLAIN_CARD.count("\n") and harmless(card)
    for line, plain in zip(card.splitlines(), PLAIN_CARD.splitlines(), strict=True):
        assert line.count("|") == plain.count("|"), "as many cells"
    # Neither a link nor a picture, neither code nor emphasis.
    assert not set(markdown(text)) & set("[]<>`|*_\\")
    assert not set(hpe_escape.markdown(text)) & set("[]<>`|*_\\")


@pytest.mark.parametrize("text", MARKDOWN, ids=ascii)
def test_what_markdown_shows_is_the_text(text: str) -> None:
    import html

    assert html.unescape(markdown(text)) == " ".join(text.split())
    assert markdown_code(text) == f"<code>{markdown(text)}</code>"


def test_the_front_matter_of_a_card_holds_no_free_text() -> None:
    for text in (*MARKDOWN, "mit\ntags: [x]", "x\n---\n"):
        assert a_card(text).split("\n---\n")[0] == PLAIN_CARD.split("\n---\n")[0]


def test_the_table_of_an_evaluation_keeps_its_cells() -> None:
    rotation = np.eye(3)[None]
    for name in MARKDOWN:
        table = scores_table([evaluate(name, np.zeros((1, 3)), rotation)])
        assert table.splitlines()[2].count("|") == 9 and "<" not in table


# ---- CSV ----------------------------------------------------------------


def formulas(text: str) -> list[str]:
    """Cells of CSV that a spreadsheet would calculate, whichever separator its country has."""
    cells = [cell for line in csv.reader(io.StringIO(text)) for cell in line]
    cells += [cell for line in text.splitlines() for cell in re.split("[;\t]", line)]
    return [cell for cell in cells if cell.strip()[:1] in tuple("=+@＝") or re.match(r"\s*-\D", cell)]


@pytest.mark.parametrize("text", FORMULAS, ids=ascii)
def test_no_table_holds_a_formula(text: str, tmp_path: Path) -> None:
    head = stranger(text)
    numbered.write_identities([head], {("s1", "neutral"): 1}, tmp_path)
    identities = (tmp_path / "identities.csv").read_text(encoding="utf-8")
    with RecordWriter(tmp_path / "found.csv") as writer:
        writer.add(record(text, None, None, None))
    found = (tmp_path / "found.csv").read_text(encoding="utf-8")
    for table in (identities, found):
        assert not formulas(table), table
        assert len(list(csv.reader(io.StringIO(table)))) == 2
    assert csv_text("plain-name_1 (2)") == "plain-name_1 (2)" == hpe_escape.csv_text("plain-name_1 (2)")


def test_formulas_are_found_by_this_test() -> None:
    assert formulas('id,name\n1,"=1+1"\n') and formulas("1,a;=1\n") and not formulas("1,'=1\n-1.5,2\n")


@pytest.mark.parametrize(
    "name", ["=1+1", "-a", "@a", "'=1", "''=1", "a,b", "a;=1", "a, =1", "'a'", "a'b", "+"]
)
def test_poses_of_heads_with_such_names_are_read_back(name: str, tmp_path: Path) -> None:
    plan = grid_plan((0, 10, 10), (0, 0, 1), (0, 0, 1))
    file = tmp_path / "poses.csv"
    file.write_text(poses_csv(PosePlans(None, {(name, name): plan})), encoding="utf-8")
    again = read_pose_plans(file)
    assert list(again.by_head) == [(name, name)]
    assert (again.of(name, name).angles_deg == plan.angles_deg).all()


# ---- web page and JSON --------------------------------------------------


@pytest.mark.parametrize("text", [*HTML, *CONTROLS, "/*DATA*/ /*SCRIPT*/"], ids=ascii)
def test_the_report_shows_text_and_obeys_none(text: str) -> None:
    page = page_text({"heads": [{"license": text}], text: text})
    assert active(page) == active(page_text({"heads": []}))
    block = page.partition('<script type="application/json" id="data">')[2].partition("</script>")[0]
    shown = json.loads(block)["heads"][0]["license"]
    assert harmless(shown) and printable(text) == shown
    assert not set("<>&") & set(block)


def test_the_report_makes_text_of_text() -> None:
    """Its script gives no string to a parser of HTML or of code."""
    script = (Path(page_text.__code__.co_filename).parent / "page.js").read_text(encoding="utf-8")
    assert not re.search(
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|eval\(|new Function", script
    )
    assert "default-src 'none'" in page_text({})


def test_numbers_that_json_does_not_know_are_refused() -> None:
    with pytest.raises(ValueError):
        html_json({"a": float("nan")})
