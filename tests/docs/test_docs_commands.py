# SPDX-License-Identifier: GPL-3.0-or-later
"""Every command on a page is one that the programs take.

A block of bash or Python runs in test_docs_run.py. One that needs what a test has not, or too much time,
says so in the line before it, `<!-- needs: WHAT -->`. All are looked at here: commands and options are those
of the programs, a configuration is one that a build would take, targets, scripts and extras exist.
"""

from __future__ import annotations

import ast
import re
import shlex
import sys
from pathlib import Path
from typing import Any

import pages
import pytest
import tomllib
import typer

from downstream_hpe.cli.app import app as downstream_hpe
from generator.cli import build
from generator.cli.app import make_app
from generator.plan.config import load_config

sys.path.append(str(pages.ROOT / "scripts"))

import command_reference

PROGRAMS = {"headturn": make_app(), "downstream-hpe": downstream_hpe}
COMMANDS = dict(found for name, app in PROGRAMS.items() for found in command_reference.commands(app, name))
MAKEFILE = (pages.ROOT / "Makefile").read_text(encoding="utf-8")
PROJECT = tomllib.loads((pages.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = set(PROJECT["optional-dependencies"])
OTHERS = {".", "blender", "export", "ffmpeg", "jupyter", "npm", "ray", "source", "srun", "tar"}
"""Programs of other people, and words of the shell."""

SHOWN = {"docs/commands.md", "docs/architecture.md", "downstream_hpe/models/headturn.md"}
"""Pages with commands in blocks that nobody types: forms, a drawing, how the model was made."""

BLENDER = re.compile(r"^blender --background (?:--python-exit-code 1 )?--(?:command headturn|python \S+ --) ")
VALUE = re.compile(r"\$(?:\([^)]*\)|\w+)")
"""What a shell puts a value in place of."""


def shell_lines(block: pages.Block) -> list[str]:
    """Commands of a block, one by one."""
    lines = pages.lines_of(VALUE.sub("VALUE", block.text))
    return [part for line in lines for part in re.split(r" (?:&&|\|) ", line)]


def problem(line: str, whole: bool = True) -> str | None:
    """What is wrong with a command. whole: it has everything that it needs."""
    words = shlex.split(BLENDER.sub("headturn ", line).replace("…", "..."), comments=True)
    if words[0] in OTHERS or "=" in words[0]:
        return None
    program, rest = words[0], words[1:]
    if program in PROGRAMS:
        return _problem_of_ours(words, whole)
    if program == "make":
        return _problem_of_make(rest)
    if program.startswith("python"):
        return _problem_of_a_script(rest)
    if program.endswith("pip"):
        asked = set(",".join(re.findall(r"\[([\w,]+)\]", line)).split(",")) - {""}
        return f"no extras {asked - EXTRAS}" if asked - EXTRAS else None
    return f"what is {program}? Add it to OTHERS if it is right"


def _problem_of_ours(words: list[str], whole: bool) -> str | None:
    if words[1:] in ([], ["--version"], ["--help"]):
        return None
    paths = [" ".join(words[:count]) for count in (3, 2)]
    path = next((path for path in paths if path in COMMANDS), None)
    if path is None:
        return "no such command"
    rest, params = words[len(path.split()) :], COMMANDS[path].params
    known = {"--help", *(name for param in params for name in (*param.opts, *param.secondary_opts))}
    if unknown := {word.partition("=")[0] for word in rest if re.match(r"--\w", word)} - known:
        return f"no options {unknown}"
    if whole:
        try:
            COMMANDS[path].make_context(path, list(rest))
        except typer.Exit:
            return None
        except Exception as error:  # click's own, of which typer has a copy
            return f"{type(error).__name__}: {getattr(error, 'message', error)}"
    return None


def _problem_of_make(rest: list[str]) -> str | None:
    names = [word.partition("=")[0] for word in rest if "=" in word]
    targets = [word for word in rest if "=" not in word and word != "..."]
    gone = [target for target in targets if not re.search(rf"^{target}:", MAKEFILE, re.MULTILINE)]
    gone += [name for name in names if f"$({name})" not in MAKEFILE]
    return f"the Makefile has no {gone}" if gone else None


def _problem_of_a_script(rest: list[str]) -> str | None:
    if not rest or rest[0] in ("-m", "-c"):
        return None
    file = pages.ROOT / rest[0]
    if not file.is_file():
        return f"no {rest[0]}"
    text = file.read_text(encoding="utf-8")
    gone = [word for word in rest[1:] if word.startswith("--") and f'"{word.partition("=")[0]}"' not in text]
    return f"{rest[0]} has no {gone}" if gone else None


@pytest.mark.parametrize("block", pages.blocks("bash"), ids=lambda block: block.place)
def test_commands_of_blocks(block: pages.Block) -> None:
    assert not {line: told for line in shell_lines(block) if (told := problem(line))}


@pytest.mark.parametrize("page", pages.pages(), ids=lambda page: str(page.relative_to(pages.ROOT)))
def test_commands_within_sentences(page: Path) -> None:
    name = str(page.relative_to(pages.ROOT))
    commands = [command for where, command in pages.inline_commands() if where == name]
    assert not {command: told for command in commands if (told := problem(command, whole=False))}


def test_no_command_stands_where_nobody_checks_it() -> None:
    """In a block without a language, or one by indentation."""
    begins = re.compile(r"^ *(?:headturn|downstream-hpe|make|pip|python) [\w-]", re.MULTILINE)
    assert {block.page for block in pages.blocks("", "text") if begins.search(block.text)} == SHOWN
    indented = re.compile(r"\n\n    (?:headturn|downstream-hpe|make|pip|python) ")
    assert not [page for page in pages.pages() if indented.search(pages.without_blocks(pages.read(page)))]


@pytest.mark.parametrize("block", pages.blocks("bash"), ids=lambda block: block.place)
def test_a_build_would_take_it(block: pages.Block, monkeypatch: pytest.MonkeyPatch) -> None:
    taken: list[Any] = []
    monkeypatch.setattr(build, "run", lambda config, *args, **options: taken.append(config))
    monkeypatch.setattr(build, "load_config", lambda file, overrides: load_config(None, overrides))
    lines = [line for line in shell_lines(block) if line.startswith("headturn build")]
    for line in lines:
        make_app()(shlex.split(line, comments=True)[1:], standalone_mode=False)
    assert len(taken) == len(lines)


@pytest.mark.parametrize("block", pages.blocks("toml"), ids=lambda block: block.place)
def test_toml_is_a_configuration(block: pages.Block) -> None:
    load_config(None, tomllib.loads(block.text))


@pytest.mark.parametrize("block", pages.blocks("python"), ids=lambda block: block.place)
def test_python_is_python(block: pages.Block) -> None:
    ast.parse(block.text)


def test_a_command_that_drifted_is_found() -> None:
    assert "--gone" in str(problem("headturn build --gone 3"))
    assert "no such command" in str(problem("headturn bild", whole=False))
    assert "Missing" in str(problem("headturn verify")) and problem("headturn verify", whole=False) is None
    assert "benchmarks/gone.py" in str(problem("python benchmarks/gone.py"))
    assert "--gone" in str(problem("python benchmarks/build.py --gone"))
    assert "gone" in str(problem("make gone")) and "gone" in str(problem("pip install '.[gone]'"))
    assert problem("blender --background --command headturn verify dataset") is None
    assert "--gone" in str(problem("blender --background --command headturn verify dataset --gone"))
