# SPDX-License-Identifier: GPL-3.0-or-later
"""Pose plans, build configuration and units of work. No bpy."""
