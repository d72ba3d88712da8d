# SPDX-License-Identifier: GPL-3.0-or-later
"""From a head source to a head on the screen, by way of the host."""

from __future__ import annotations

from typing import Any

import bpy

from generator.errors import HeadturnError

from . import gallery, session, settings, studio, timeline
from .core.tables import section_of
from .session import Shown


def list_heads(scene: bpy.types.Scene) -> None:
    """Ask what the source holds, then show its first head."""
    config = settings.to_config(scene.headturn)
    heads = section_of(config, "heads")
    key = f"{heads.count}-{heads.seed}-{heads.sampled_expressions}"
    name = scene.name

    def take(answer: dict[str, Any]) -> None:
        gallery.forget()
        session.state.take_list(answer)
        found = bpy.data.scenes.get(name)
        if session.state.heads and found is not None:
            choose(found.headturn, session.state.heads[0][0])

    message = {"op": "list", "config": config, "cache": str(settings.cache_folder() / f"parametric-{key}")}
    session.request(message, "looking for heads...", take)


def choose(shown: Shown, subject: str, expression: str | None = None) -> None:
    """Show a head; without an expression the neutral one, or the first."""
    with session.quiet():
        shown.subject = subject
        shown.expression = expression or session.state.first_of(subject)
    show(shown)


def step(shown: Shown, what: str, by: int) -> None:
    """Show the next or previous subject or expression, around the end."""
    choose(shown, *session.state.beside(settings.chosen_head(shown), what, by))


def show(shown: Shown) -> None:
    """Have the host place the chosen head, then put it before the camera."""
    there = session.state.expressions(shown.subject)
    if not there:
        return
    if shown.expression not in there:  # another subject was chosen
        choose(shown, shown.subject)
        return
    head = subject, expression = settings.chosen_head(shown)
    package = settings.cache_folder() / f"{subject}-{expression}.npz"
    name = shown.id_data.name

    def take(answer: dict[str, Any]) -> None:
        scene = bpy.data.scenes.get(name)
        if scene is None or settings.chosen_head(scene.headturn) != head:
            return
        if bpy.context.scene == scene:
            scene = studio.studio_scene()
        try:
            studio.show_package(scene, package, answer["radius_mm"])
        except (HeadturnError, OSError, RuntimeError) as error:
            session.state.error = " ".join(str(error).split())
            return
        session.state.take_head(head, answer)
        gallery.fill(scene.headturn)
        timeline.head_changed(scene)
        bpy.ops.ed.undo_push(message=f"Show {subject}")

    message = {
        "op": "place",
        "config": settings.to_config(shown),
        "subject": subject,
        "expression": expression,
        "package": str(package),
    }
    session.request(message, f"finding the face of {subject}...", take)
