# SPDX-License-Identifier: GPL-3.0-or-later
"""The only place that imports bpy: scene, materials, light, and the render worker.

Runs inside any Blender from 4.2 on (its own Python, numpy and the standard
library, nothing else) or with the bpy wheel.
"""
