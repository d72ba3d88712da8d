# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn preview``: one picture of one head."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import BlenderOption, say
from generator.cli.options import numbers, with_settings
from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.setting import Setting
from generator.plan.settings import Values, all_settings

DEFAULTS = {"render.preset": "quality", "render.resolution": 512}
"""Of a picture that somebody looks at."""

_OF_MESHES = ("heads.units", "heads.up", "heads.forward", "heads.eye_distance_mm", "heads.without")


def preview(
    head: Annotated[Path, typer.Argument(help="A mesh file, or a folder that holds one subject.")],
    pose: Annotated[str, typer.Option(help="YAW,PITCH,ROLL in degrees.")] = "0,0,0",
    picture: Annotated[Path, typer.Option("--out", help="The picture, .png or .jpg.")] = Path("preview.png"),
    expression: Annotated[str | None, typer.Option(help="Which expression; default neutral.")] = None,
    landmarks: Annotated[bool, typer.Option(help="Draw the landmarks found.")] = True,
    blender: BlenderOption = None,
    *,
    overrides: Values,
) -> None:
    """Render one head at one pose, with the landmarks drawn."""
    from generator.execution.preview.picture import render_preview

    angles = numbers("--pose", pose)
    if len(angles) != 3:
        raise UsageError(f"--pose {pose!r}: expected YAW,PITCH,ROLL in degrees, such as 30,10,0")
    overrides.setdefault("heads", {})["source"] = str(head)
    found = render_preview(
        load_config(None, overrides),
        (angles[0], angles[1], angles[2]),
        picture,
        expression=expression,
        draw_landmarks=landmarks,
        blender=blender,
    )
    say(f"{picture}: {found}")


def previewed() -> list[Setting]:
    """Settings that a single picture has."""
    return [s for s in all_settings() if s.section in ("render", "landmarks") or s.name in _OF_MESHES]


def register(app: typer.Typer) -> None:
    """Add the command."""
    example = "Example: headturn preview heads/p0003/neutral.obj --pose 30,10,0 --out p.png"
    app.command(epilog=example)(with_settings(preview, previewed(), DEFAULTS))
