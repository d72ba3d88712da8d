# SPDX-License-Identifier: MIT
"""Every error a user can cause. Each message is one line: what, where, what to do."""

from __future__ import annotations


class HpeError(Exception):
    """The base of all errors that end in one clear line instead of a traceback."""

    exit_code = 1


class UsageError(HpeError):
    """The command or its options are wrong."""

    exit_code = 2


class DataError(HpeError):
    """A dataset on disk, or an array in memory, is not what was expected."""


class ModelError(HpeError):
    """A model file cannot be read or does not fit the program."""
