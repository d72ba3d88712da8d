# SPDX-License-Identifier: MIT
"""What may be wrong."""

from __future__ import annotations


class FinderError(Exception):
    """Something is not installed, or a file is not what it should be: one line, with what to do."""


class PictureError(FinderError):
    """A picture that the networks cannot be shown."""
