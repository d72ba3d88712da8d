# SPDX-License-Identifier: GPL-3.0-or-later
"""Lanes that replay opens, without a renderer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from no_renderer import NoRenderer

from generator.errors import HeadturnError


class Lanes:
    """What stands in the place of open_executor and scratch_folder.

    lanes: what it opens, counted in opened. refused: raised instead, where it is given.
    """

    def __init__(self, scratch: Path) -> None:
        self.lanes, self.scratch, self.opened = NoRenderer(), scratch, 0
        self.refused: HeadturnError | None = None
        scratch.mkdir()

    @contextmanager
    def open(self, *_: Any, **__: Any) -> Iterator[NoRenderer]:
        """See generator.execution.executors.open.open_executor."""
        if self.refused is not None:
            raise self.refused
        self.opened += 1
        yield self.lanes

    @contextmanager
    def folder(self) -> Iterator[Path]:
        """See generator.execution.lanes.scratch.scratch_folder."""
        yield self.scratch
