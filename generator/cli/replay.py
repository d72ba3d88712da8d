# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn replay``: is one sample still what it was?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import BlenderOption, JsonFlag, say


def replay(
    folder: Annotated[Path, typer.Argument(help="A dataset made by headturn build.")],
    sample_id: Annotated[
        str, typer.Argument(help="Its row, such as p0003/neutral/y+30_p-10_r+0, or a twin: …+0~light.")
    ],
    heads: Annotated[Path | None, typer.Option(help="Where the head source lies now, if it moved.")] = None,
    picture: Annotated[Path | None, typer.Option("--out", help="Write the new image there.")] = None,
    blender: BlenderOption = None,
    as_json: JsonFlag = False,
) -> None:
    """Render one sample again from its head and configuration, and compare every value.

    Image and passes are compared three ways: what is stored, its hash in the row, and the new one.

    Exit code 1 if anything differs.
    """
    from generator.execution.replay import replay_sample

    found = replay_sample(folder, sample_id, heads=heads, picture=picture, blender=blender)
    if as_json:
        typer.echo(json.dumps(found.as_dict(), indent=1))
    else:
        for line in found.text().split("\n"):
            say(line)
    if not found.same:
        raise typer.Exit(1)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn replay dataset p0003/neutral/y+30_p-10_r+0")(replay)
