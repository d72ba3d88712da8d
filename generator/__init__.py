# SPDX-License-Identifier: GPL-3.0-or-later
"""Headturn's dataset generator: 3D heads in, Parquet with exact head pose out.

Dependence points one way: ``cli -> execution -> {blender, landmarks, dataset}
-> {heads, plan} -> geometry``. Only ``generator.blender`` imports bpy.
"""

__version__ = "0.1.0"
