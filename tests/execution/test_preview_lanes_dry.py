# SPDX-License-Identifier: GPL-3.0-or-later
"""Which Blender the preview server asks about which heads."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from generator.execution.lanes.options import LaneOptions
from generator.execution.preview import server


def test_heads_in_scenes_have_a_blender_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of the user, who may have saved what an older one does not read; other heads keep theirs."""
    opened: list[str | None] = []
    folders: list[str] = []

    class Lane:
        def __init__(self, options: LaneOptions) -> None:
            opened.append(options.blender)
            folders.append(options.scratch)

        def close(self) -> None:
            opened.remove(opened[-1])

    def place(self: Any, config: Any, **_: Any) -> dict[str, Any]:
        return {"lane": self._open_lane()}

    monkeypatch.setattr(server, "Lane", Lane)
    monkeypatch.setattr(server.PreviewServer, "_place", place)
    with ExitStack() as stack:
        asked = server.PreviewServer(tmp_path, stack, None, blender_of_scenes="/new/blender")
        sources = [str(tmp_path / name) for name in ("anna.BLEND", "heads", "bob.blend", "heads")]
        answers = [asked.answer({"op": "place", "config": {"heads": {"source": one}}}) for one in sources]
        assert opened == ["/new/blender", None] and len({*folders}) == 2
        lanes = [answer["lane"] for answer in answers]
        assert lanes[0] is lanes[2] and lanes[1] is lanes[3] and lanes[0] is not lanes[1]
    assert not opened, "all of them are closed"
