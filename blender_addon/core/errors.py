# SPDX-License-Identifier: GPL-3.0-or-later
"""The generator's errors, under the add-on's roof."""

from generator.errors import HeadturnError, UsageError, WorkerError

__all__ = ["HeadturnError", "UsageError", "WorkerError"]
