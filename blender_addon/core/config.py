# SPDX-License-Identifier: GPL-3.0-or-later
"""The build configuration as nested dictionaries, read from and written to the host's TOML.

Blender has no TOML writer and no pydantic: values are carried as they are, also
those that no panel shows, and the host checks them when a build starts.
"""

from __future__ import annotations

import csv
import io
import json
import os
import struct
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from generator.errors import UsageError
from generator.plan.settings import SECTIONS, Values, all_settings
from generator.reading import MAX_CONFIG_BYTES, parse_toml, read_text


def read_config(path: Path) -> Values:
    """The tables of a configuration file.

    Raises UsageError: it cannot be read, is not TOML, or holds something else. A key that
    nobody knows is said as the host says it.
    """
    try:
        values = parse_toml(read_text(path, MAX_CONFIG_BYTES))
    except FileNotFoundError as error:
        raise UsageError(f"{path}: there is no such configuration file") from error
    except (ValueError, OSError) as error:
        raise UsageError(f"{path}: not a TOML configuration: {error}") from error
    for name, table in values.items():
        if name not in SECTIONS or not isinstance(table, dict):
            raise UsageError(f"{path}: [{name}] is none of the tables {', '.join(SECTIONS)}")
        known = [setting.key for setting in all_settings() if setting.section == name]
        for key in table:
            if key not in known:
                near = ", ".join(get_close_matches(key, known, 1) or known)
                raise UsageError(f"{path}: {name}.{key}: no such setting; there is {near}")
    return values


def write_config(config: Values, path: Path) -> None:
    """Write a configuration, whole or not at all. UsageError if the file cannot be written."""
    lines = []
    for section in SECTIONS:
        if table := config.get(section):
            lines += [f"[{section}]", *(f"{key} = {_value(value)}" for key, value in table.items()), ""]
    temporary = path.with_name(f".{path.name}.tmp")
    try:
        temporary.write_text("\n".join(lines), encoding="utf-8", newline="\n")
        os.replace(temporary, path)
    except OSError as error:
        raise UsageError(f"{path}: cannot be written ({error.strerror}); choose another place") from error


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        # JSON and TOML write strings alike but for DEL.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    raise TypeError(f"no TOML for {value!r}")


def same(value: Any, shown: Any) -> bool:
    """Is this value what the panel shows, as exactly as it can?"""
    if isinstance(value, (list, tuple)) and isinstance(shown, (list, tuple)):
        return len(value) == len(shown) and all(map(same, value, shown))
    if isinstance(value, float) or isinstance(shown, float):
        numbers = (int, float)
        return isinstance(value, numbers) and isinstance(shown, numbers) and number(value) == number(shown)
    return bool(value == shown)


def split_names(text: str) -> list[str] | None:
    """The names of a field, separated by commas; None if there is none. Quotes keep a comma in a name."""
    names = next(csv.reader([text], skipinitialspace=True), [])
    return [name.strip() for name in names if name.strip()] or None


def join_names(names: Sequence[str]) -> str:
    """The field that :func:`split_names` reads."""
    line = io.StringIO()
    csv.writer(line, lineterminator="").writerow(names)
    return line.getvalue()


def number(value: float) -> float | int:
    """A 32-bit number as it was typed: 0.1, not 0.10000000149011612."""
    short = float(f"{struct.unpack('f', struct.pack('f', value))[0]:.7g}")
    return int(short) if short.is_integer() else short
