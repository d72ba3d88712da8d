# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the parts of docs/ that follow from code, or check that they are up to date.

    python scripts/make_docs.py            # write them
    python scripts/make_docs.py --check    # exit code 1, and a line each, if one is out of date

A part stands between two marks, and what is between them is never edited by hand:

    <!-- NAME: written by scripts/make_docs.py -->
    <!-- end of NAME -->

A new one is a pair of marks in a file of docs/ and a line in DOCS.
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from command_reference import program  # noqa: E402

from downstream_hpe.cli.app import app as downstream_hpe  # noqa: E402
from generator.cli.app import app as headturn  # noqa: E402
from generator.cli.settings_table import section_table  # noqa: E402
from generator.dataset.show.column_tables import heads_table, rows_table  # noqa: E402
from generator.dataset.show.format_tables import (  # noqa: E402
    factors_table,
    formats_table,
    missing_table,
    passes_table,
    rotations_table,
)
from generator.plan.settings import SECTIONS  # noqa: E402


def _section(name: str) -> Callable[[], str]:
    return lambda: section_table(name)


def decisions(folder: Path = ROOT / "docs" / "decisions") -> str:
    """The records of a folder. Raises ValueError: one has no title, date or what was rejected."""
    lines = ["| | date | decision |", "| --- | --- | --- |"]
    for file in sorted(folder.glob("*.md")):
        found = re.match(r"# (.+)\n\n\*(\d{4}-\d\d-\d\d)\*\n\n", text := file.read_text(encoding="utf-8"))
        if found is None or "\n**Rejected:** " not in text:
            raise ValueError(f"{file}: expected '# TITLE', '*YEAR-MONTH-DAY*' and '**Rejected:** ...'")
        lines.append(f"| {file.name[:4]} | {found[2]} | [{found[1]}](decisions/{file.name}) |")
    return "\n".join(lines)


DOCS: dict[str, dict[str, Callable[[], str]]] = {
    "docs/table.md": {"columns of the rows": rows_table, "columns of heads.parquet": heads_table},
    "docs/exports.md": {
        "formats": formats_table,
        "rotations": rotations_table,
        "rows without a face": missing_table,
    },
    "docs/passes.md": {"passes": passes_table},
    "docs/twins.md": {"factors": factors_table},
    "docs/decisions.md": {"decisions": decisions},
    "docs/commands.md": {
        "headturn": lambda: program(headturn, "headturn"),
        "downstream-hpe": lambda: program(downstream_hpe, "downstream-hpe"),
    },
    "docs/configuration.md": {name: _section(name) for name in SECTIONS},
}
"""File -> name of a part -> the function that gives its text, Markdown."""


def with_parts(text: str, parts: Mapping[str, Callable[[], str]], file: str = "") -> str:
    """The text of a file with its parts written anew. Raises ValueError: a part's marks are not in it."""
    for name, content in parts.items():
        start, end = f"<!-- {name}: written by scripts/make_docs.py -->\n", f"<!-- end of {name} -->"
        before, found, rest = text.partition(start)
        _, found_end, after = rest.partition(end)
        if not (found and found_end):
            raise ValueError(f"{file}: the marks of {name!r} are missing; see scripts/make_docs.py")
        text = f"{before}{start}\n{content()}\n\n{end}{after}"
    return text


def stale(root: Path = ROOT) -> list[str]:
    """Files whose parts are out of date."""
    return [file for file, text in made(root).items() if (root / file).read_text(encoding="utf-8") != text]


def made(root: Path = ROOT) -> dict[str, str]:
    """File -> its text as it should be."""
    return {
        file: with_parts((root / file).read_text(encoding="utf-8"), parts, file)
        for file, parts in DOCS.items()
    }


def main() -> int:
    """Write or check."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 if it would")
    if parser.parse_args().check:
        for file in (found := stale()):
            print(f"{file}: out of date; run python scripts/make_docs.py")
        return 1 if found else 0
    for file, text in made().items():
        (ROOT / file).write_text(text, encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
