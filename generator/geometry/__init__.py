# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations, rigid fits and the camera. numpy only."""
