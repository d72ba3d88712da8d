# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the panels of ours are: a tab in the sidebar of the 3D view."""

from __future__ import annotations

from typing import ClassVar

CATEGORY = "Headturn"


class Tab:
    """A panel of the tab."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY


class Closed(Tab):
    """One that is closed at first."""

    bl_options: ClassVar[set[str]] = {"DEFAULT_CLOSED"}
