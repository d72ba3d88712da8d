# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error a user can cause. Each message is one line: what, where, what to do."""

from __future__ import annotations


class HeadturnError(Exception):
    """The base of all errors that end in one clear line instead of a traceback."""

    exit_code = 1


class UsageError(HeadturnError):
    """The command, its options or the configuration are wrong."""

    exit_code = 2


class HeadError(HeadturnError):
    """One head cannot be read or placed; others still can."""


class DatasetError(HeadturnError):
    """A dataset on disk is not what was expected."""


class WorkerError(HeadturnError):
    """A render or landmark process failed. log: the end of what it printed."""

    def __init__(self, message: str, log: str = "") -> None:
        super().__init__(message)
        self.log = log
