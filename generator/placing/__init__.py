# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a head stands: its face, units, pivot, anchors and pose zero. No bpy."""
