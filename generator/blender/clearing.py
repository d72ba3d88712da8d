# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in Blender replaced by an empty scene with factory settings."""

from __future__ import annotations

import bpy

_settled = False
"""Were the preferences set back in this process, which nothing here changes?"""


def clear() -> None:
    """Remove all data. Preferences, with every add-on, are loaded the first time alone: that takes as
    long as two images."""
    global _settled
    if _settled:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        _settled = True
