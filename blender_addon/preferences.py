# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences: where the host is, and a button that checks it."""

from __future__ import annotations

from typing import Any

import bpy

from . import session, setting_up
from .core.panel import Line
from .registration import WORDS
from .wrapping import label, message

MARGIN = 16
"""Characters that the page's indents take."""


def _python_changed(self: Any, context: bpy.types.Context) -> None:
    session.forget_host()


class HeadturnPreferences(bpy.types.AddonPreferences):
    """Edit > Preferences > Add-ons > Headturn."""

    bl_idname = __package__

    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python with Headturn",
        translation_context=WORDS,
        description=(
            "A Python, or the folder of its environment, in which Headturn is installed. Empty: "
            "HEADTURN_PYTHON, then what Set Up made, then headturn on PATH"
        ),
        subtype="FILE_PATH",
        update=_python_changed,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """The page."""
        layout, state = self.layout, session.state
        layout.use_property_split = True
        row = layout.row(align=True)
        row.prop(self, "python")
        row.operator("headturn.check_host", text="Check", icon="CHECKMARK")
        box = layout.box().column(align=True)
        if state.checking:
            label(box, "asking...", "SORTTIME")
        elif state.host_error:
            message(box, context, Line(state.host_error, "ERROR"), margin=MARGIN)
        elif state.facts is not None and state.host is not None:
            found = f"{state.host.command[0]} ({state.host.found_by})"
            message(box, context, Line(found, "CHECKMARK"), margin=MARGIN)
            for line in state.facts.lines():
                label(box, line, "BLANK1")
        else:
            label(box, "Not checked yet", "INFO")
        box = layout.box()
        setting_up.draw(box, context, margin=MARGIN)
        setting_up.draw_commands(box.column(align=True))


def register() -> None:
    """Add the page."""
    bpy.utils.register_class(HeadturnPreferences)


def unregister() -> None:
    """Take the page away."""
    bpy.utils.unregister_class(HeadturnPreferences)
