# SPDX-License-Identifier: GPL-3.0-or-later
"""From a head source to a head on the screen, by way of the host."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import gallery, session

if TYPE_CHECKING:
    from .properties import HeadturnSettings

NEUTRAL = "neutral"


def cache_folder() -> Path:
    """Where prepared and parametric heads are kept while Blender runs."""
    return Path(bpy.app.tempdir or tempfile.gettempdir()) / "headturn"


def list_heads(scene: bpy.types.Scene) -> None:
    """Ask what the source holds, then show its first head."""
    from . import settings

    table = settings.to_config(scene.headturn)["heads"]
    key = "-".join(str(table.get(name)) for name in ("count", "seed", "sampled_expressions"))
    name = scene.name

    def take(answer: dict[str, Any]) -> None:
        state = session.state
        gallery.forget()
        state.displayed = None
        state.kind, state.skipped = answer["kind"], answer["skipped"]
        state.heads = [(head["subject"], head["expression"]) for head in answer["heads"]]
        found = bpy.data.scenes.get(name)
        if not state.heads:
            state.error = state.skipped[0] if state.skipped else "this source holds no heads"
        elif found is not None:
            choose(found.headturn, state.heads[0][0])

    message = {"op": "list", "heads": table, "cache": str(cache_folder() / f"parametric-{key}")}
    session.request(message, "looking for heads...", take)


def choose(shown: HeadturnSettings, subject: str, expression: str | None = None) -> None:
    """Show a head; without an expression the neutral one, or the first."""
    there = session.state.expressions(subject)
    with session.quiet():
        shown.subject = subject
        shown.expression = expression or (NEUTRAL if NEUTRAL in there else there[0])
    show(shown)


def step(shown: HeadturnSettings, what: str, by: int) -> None:
    """Show the next or previous subject or expression, around the end."""
    state = session.state
    if what == "SUBJECT":
        names = state.subjects()
        choose(shown, _after(names, shown.subject, by))
    else:
        names = state.expressions(shown.subject)
        choose(shown, shown.subject, _after(names, shown.expression, by))


def show(shown: HeadturnSettings) -> None:
    """Have the host place the chosen head, then put it before the camera."""
    from . import studio

    there = session.state.expressions(shown.subject)
    if session.is_quiet() or not there:
        return
    if shown.expression not in there:  # another subject was chosen
        choose(shown, shown.subject)
        return
    subject, expression = shown.subject, shown.expression
    package = cache_folder() / f"{subject}-{expression}.npz"
    name = shown.id_data.name

    def take(answer: dict[str, Any]) -> None:
        from .core.errors import HeadturnError

        scene = bpy.data.scenes.get(name)
        if scene is None or (scene.headturn.subject, scene.headturn.expression) != (subject, expression):
            return
        if bpy.context.scene == scene:
            scene = studio.studio_scene()
        try:
            studio.show_package(scene, package, answer["radius_mm"])
        except (HeadturnError, OSError, RuntimeError) as error:
            session.state.error = " ".join(str(error).split())
            return
        session.state.notes, session.state.vertices = answer["notes"], answer["vertices"]
        session.state.displayed = (subject, expression)
        gallery.fill(scene.headturn)
        bpy.ops.ed.undo_push(message=f"Show {subject}")

    message = {
        "op": "place",
        "subject": subject,
        "expression": expression,
        "frame": shown.frame,
        "package": str(package),
    }
    session.request(message, f"finding the face of {subject}...", take)


def _after(names: list[str], name: str, by: int) -> str:
    return names[(names.index(name) + by) % len(names)] if name in names else names[0]
