# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmark detectors. Surface anchors (exact landmarks) will live here too."""
