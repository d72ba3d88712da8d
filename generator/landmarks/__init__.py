# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks: what they are, who finds them, and where they lie on a mesh."""
