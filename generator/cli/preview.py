# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn preview``: one picture of one head."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import BlenderOption, JsonFlag, say
from generator.cli.options import numbers, with_settings
from generator.errors import UsageError
from generator.plan.config import load_config
from generator.plan.setting import Setting
from generator.plan.settings import Values, all_settings, value_text

DEFAULTS = {"render.preset": "quality", "render.resolution": 512}
"""Of a picture that somebody looks at."""

_OF_DRAWS = "poses.seed"

_OF_MESHES = tuple(
    f"heads.{key}" for key in ("units", "up", "forward", "eye_distance_mm", "without", "head_object")
)


def preview(
    head: Annotated[Path, typer.Argument(help="A mesh file, or a folder that holds one subject.")],
    pose: Annotated[str, typer.Option(help="YAW,PITCH,ROLL in degrees.")] = "0,0,0",
    picture: Annotated[Path, typer.Option("--out", help="The picture, .png or .jpg.")] = Path("preview.png"),
    expression: Annotated[str | None, typer.Option(help="Which expression; default neutral.")] = None,
    landmarks: Annotated[bool, typer.Option(help="Draw the landmarks found.")] = True,
    blender: BlenderOption = None,
    as_json: JsonFlag = False,
    *,
    overrides: Values,
) -> None:
    """Render one head at one pose, with the landmarks drawn.

    Where settings are distributions, as with --variety, it is the look that a build with the same --seed
    draws for this head and pose, and what was drawn is listed.
    """
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
    if as_json:
        facts = {"detected": found.detected, "notes": found.notes, "drawn": found.drawn}
        typer.echo(json.dumps({"picture": str(picture), **facts}))
        return
    say(f"{picture}: {found.line}")
    for key, value in found.drawn.items():
        say(f"  {key:22}{value_text(value)}")


def previewed() -> list[Setting]:
    """Settings that a single picture has."""
    others = (*_OF_MESHES, _OF_DRAWS)
    return [s for s in all_settings() if s.section in ("render", "landmarks") or s.name in others]


def register(app: typer.Typer) -> None:
    """Add the command."""
    example = "Example: headturn preview heads/p0003/neutral.obj --pose 30,10,0 --out p.png"
    app.command(epilog=example)(with_settings(preview, previewed(), DEFAULTS))
