# SPDX-License-Identifier: GPL-3.0-or-later
"""Preferences: where the host is, and a button that checks it."""

from __future__ import annotations

import bpy

from . import __package__ as package
from . import session
from .wrapping import message

MARGIN = 16
"""Characters that the page's indents take."""


def _python_changed(self: HeadturnPreferences, context: bpy.types.Context) -> None:
    session.forget_host()


class HeadturnPreferences(bpy.types.AddonPreferences):
    """Edit > Preferences > Add-ons > Headturn."""

    bl_idname = package

    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python with Headturn",
        description=(
            "A Python, or the folder of its environment, in which Headturn is installed. Empty: "
            "HEADTURN_PYTHON, then a .venv beside the configuration, then headturn on PATH"
        ),
        subtype="FILE_PATH",
        update=_python_changed,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """The page."""
        from .core.host import INSTALL

        layout = self.layout
        layout.use_property_split = True
        row = layout.row(align=True)
        row.prop(self, "python")
        row.operator("headturn.check_host", text="Check", icon="CHECKMARK")
        box = layout.box().column(align=True)
        if session.state.checking:
            box.label(text="asking...", icon="SORTTIME")
        elif session.state.host_error:
            message(box, context, session.state.host_error, "ERROR", margin=MARGIN)
        elif session.state.facts is not None:
            host = session.state.host
            message(box, context, f"{host.command[0]} ({host.found_by})", "CHECKMARK", margin=MARGIN)
            for line in session.state.facts.lines():
                box.label(text=line, icon="BLANK1")
        else:
            box.label(text="Not checked yet. To install:", icon="INFO")
            box.label(text=INSTALL, icon="BLANK1")


def host_preference() -> str:
    """The preference, or "" where the add-on is not enabled as an extension."""
    addon = bpy.context.preferences.addons.get(package)
    if addon is None or addon.preferences is None:
        return ""
    return bpy.path.abspath(addon.preferences.python) if addon.preferences.python else ""


def register() -> None:
    """Add the page."""
    bpy.utils.register_class(HeadturnPreferences)


def unregister() -> None:
    """Take the page away."""
    bpy.utils.unregister_class(HeadturnPreferences)
