# SPDX-License-Identifier: GPL-3.0-or-later
"""An importer that does not survive a file is that head's trouble alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from generator.errors import HeadError, WorkerError
from generator.execution.lanes import renderer
from generator.execution.lanes.renderer import mesh_importer


class _Fragile:
    """A renderer that ends at the file "bad.fbx"."""

    started = closed = 0

    def __init__(self, *_: object, **__: object) -> None:
        type(self).started += 1
        self._dead = False

    def import_mesh(self, source: Path, folder: Path) -> Path:
        if source.name == "bad.fbx" or self._dead:
            self._dead = True
            raise WorkerError("python was killed by signal 6")
        return folder / "good.glb"

    def close(self) -> None:
        type(self).closed += 1


def test_the_head_after_one_that_ends_blender_gets_another(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(renderer, "Renderer", _Fragile)
    with mesh_importer() as import_mesh:
        with pytest.raises(HeadError, match=r"Blender ended while it read the file .*signal 6"):
            import_mesh(tmp_path / "bad.fbx", tmp_path)
        assert import_mesh(tmp_path / "good.fbx", tmp_path) == tmp_path / "good.glb"
    assert (_Fragile.started, _Fragile.closed) == (2, 2)


_GREEDY = """
from generator.process import limited_memory
with limited_memory(64):
    try:
        bytearray(1 << 28)
        print("taken")
    except MemoryError:
        print("refused")
print(len(bytearray(1 << 28)))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the limit is Linux's")
def test_memory_is_limited_in_a_block_alone() -> None:
    done = subprocess.run([sys.executable, "-c", _GREEDY], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["refused", str(1 << 28)]
