# SPDX-License-Identifier: GPL-3.0-or-later
"""A rendered image as a camera would have taken it. No bpy."""
