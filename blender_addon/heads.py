# SPDX-License-Identifier: GPL-3.0-or-later
"""From a head source to a head on the screen, by way of the host."""

from __future__ import annotations

from typing import Any

import bpy

from generator.errors import HeadturnError

from . import folders, gallery, keys, session, settings, studio, timeline
from .core.found import Listing, Placed
from .session import Shown


def list_heads(scene: bpy.types.Scene) -> None:
    """Ask what the source holds, then show its first head."""
    config = settings.to_config(scene.headturn)
    name, source = scene.name, keys.source(config)
    folders.tidy()

    def take(answer: dict[str, Any]) -> None:
        gallery.forget(source)
        listed = Listing.of(answer)
        session.state.lists.take(source, listed)
        session.state.error = listed.problem
        found = bpy.data.scenes.get(name)
        if listed.heads and found is not None and keys.listing(found.headturn) is listed:
            found.headturn.listed = listed.text(source)
            choose(found.headturn, listed.heads[0][0])

    session.request({"op": "list", **folders.told(config)}, "looking for heads...", take)


def choose(shown: Shown, subject: str, expression: str | None = None) -> None:
    """Show a head; without an expression the neutral one, or the first."""
    with session.quiet():
        shown.subject = subject
        shown.expression = expression or keys.listing(shown).first_of(subject)
    show(shown)


def step(shown: Shown, what: str, by: int) -> None:
    """Show the next or previous subject or expression, around the end."""
    choose(shown, *keys.listing(shown).beside(settings.chosen_head(shown), what, by))


def show(shown: Shown) -> None:
    """Have the host place the chosen head, then put it before the camera."""
    there = keys.listing(shown).expressions(shown.subject)
    if not there:
        return
    if shown.expression not in there:  # another subject was chosen
        choose(shown, shown.subject)
        return
    head = subject, expression = settings.chosen_head(shown)
    config = settings.to_config(shown)
    source, placing = keys.source(config), keys.package(config)
    # Heads of another source, or placed in another way, may have the same names.
    package = folders.placed(placing, head)
    name = shown.id_data.name

    def take(answer: dict[str, Any]) -> None:
        scene = bpy.data.scenes.get(name)
        if scene is None or settings.chosen_head(scene.headturn) != head:
            return
        if keys.package(settings.to_config(scene.headturn)) != placing:
            return
        scene = studio.studio_scene(scene)
        placed = Placed(head, source, answer["vertices"], answer["notes"])
        try:
            studio.show_package(scene, package, answer["radius_mm"], placed.text())
        except (HeadturnError, OSError, RuntimeError) as error:
            session.state.error = " ".join(str(error).split())
            return
        gallery.fill(scene.headturn)
        timeline.head_changed(scene)
        bpy.ops.ed.undo_push(message=f"Show {subject}")

    message = {
        "op": "place",
        **folders.told(config),
        "subject": subject,
        "expression": expression,
        "package": str(package),
    }
    session.request(message, f"finding the face of {subject}...", take)
