# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands with their options as Markdown, as the programs themselves know them: docs/commands.md."""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import typer

PLAIN = "Options"
"""The heading of options that belong to no group."""

KINDS = {int: "WHOLE NUMBER", float: "NUMBER", Path: "PATH"}
"""How a value is written that has no name of its own."""


def program(app: typer.Typer, name: str) -> str:
    """Every command of a program: how it is called, what it does, its options."""
    return "\n\n".join(text for path, command in commands(app, name) for text in _command(path, command))


def commands(app: typer.Typer, name: str) -> Iterator[tuple[str, Any]]:
    """Every command that can be run, by its words, such as "headturn heads list"."""
    yield from _below(name, typer.main.get_command(app))


def _below(path: str, command: Any) -> Iterator[tuple[str, Any]]:
    if subcommands := getattr(command, "commands", None):
        for word, subcommand in subcommands.items():
            if not subcommand.hidden:
                yield from _below(f"{path} {word}", subcommand)
    else:
        yield path, command


def _command(path: str, command: Any) -> Iterator[str]:
    yield f"### {path}"
    yield _sentences(command.help)
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    yield f"```text\n{' '.join([path, *map(_word, arguments), '[OPTIONS]'])}\n```"
    if arguments:
        rows = [[_code(_word(argument)), _sentences(argument.help)] for argument in arguments]
        yield _table(["argument", "meaning"], rows)
    groups: dict[str, list[Any]] = {}
    for option in command.params:
        if option.param_type_name == "option" and not option.hidden:
            groups.setdefault(option.rich_help_panel or PLAIN, []).append(option)
    for title, options in groups.items():
        yield _table([title.lower(), "value", "meaning"], list(map(_option, options)))
    if command.epilog:
        example, _, line = command.epilog.partition(": ")
        yield f"{example}: {_code(line)}"


def _word(argument: Any) -> str:
    word = argument.metavar or argument.name.upper()
    several = "..." if argument.nargs == -1 else ""
    return f"{word if argument.required or word.startswith('[') else f'[{word}]'}{several}"


def _option(option: Any) -> list[str]:
    value = "" if option.is_flag else option.metavar or _kind(option.type_descriptor.annotation)
    usual = option.default.value if isinstance(option.default, Enum) else option.default
    told = isinstance(usual, str | int | float | Path) and not isinstance(usual, bool)
    said = f" Default: {_code(str(usual))}." if told and option.show_default else ""
    needed = " It must be given." if option.required else ""
    names = ", ".join(_code(name) for name in [*option.opts, *option.secondary_opts])
    return [names, _code(value) if value else "", _sentences(option.help) + said + needed]


def _kind(annotation: Any) -> str:
    if isinstance(annotation, type) and issubclass(annotation, Enum):
        return "|".join(str(choice.value) for choice in annotation)
    return KINDS.get(annotation, "TEXT")


def _sentences(text: str | None) -> str:
    return " ".join((text or "").split())


def _code(text: str) -> str:
    return f"`{text}`"


def _table(header: list[str], rows: list[list[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)
