# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences: where the host is, and a button that checks it."""

from __future__ import annotations

from typing import Any

import bpy

from . import session
from .core.panel import Line
from .wrapping import message

MARGIN = 16
"""Characters that the page's indents take."""


def _python_changed(self: Any, context: bpy.types.Context) -> None:
    session.forget_host()


class HeadturnPreferences(bpy.types.AddonPreferences):
    """Edit > Preferences > Add-ons > Headturn."""

    bl_idname = __package__

    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python with Headturn",
        description=(
            "A Python, or the folder of its environment, in which Headturn is installed. Empty: "
            "HEADTURN_PYTHON, then headturn on PATH"
        ),
        subtype="FILE_PATH",
        update=_python_changed,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """The page."""
        from .core.host import INSTALL

        layout, state = self.layout, session.state
        layout.use_property_split = True
        row = layout.row(align=True)
        row.prop(self, "python")
        row.operator("headturn.check_host", text="Check", icon="CHECKMARK")
        box = layout.box().column(align=True)
        if state.checking:
            box.label(text="asking...", icon="SORTTIME")
        elif state.host_error:
            message(box, context, Line(state.host_error, "ERROR"), margin=MARGIN)
        elif state.facts is not None and state.host is not None:
            found = f"{state.host.command[0]} ({state.host.found_by})"
            message(box, context, Line(found, "CHECKMARK"), margin=MARGIN)
            for line in state.facts.lines():
                box.label(text=line, icon="BLANK1")
        else:
            box.label(text="Not checked yet. To install:", icon="INFO")
            box.label(text=INSTALL, icon="BLANK1")


def register() -> None:
    """Add the page."""
    bpy.utils.register_class(HeadturnPreferences)


def unregister() -> None:
    """Take the page away."""
    bpy.utils.unregister_class(HeadturnPreferences)
