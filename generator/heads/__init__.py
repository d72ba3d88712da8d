# SPDX-License-Identifier: GPL-3.0-or-later
"""Head sources: parametric heads, FaceScape, folders of meshes. No bpy."""
