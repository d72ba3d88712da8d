# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages for one's own detector and head source: what they say to write does what they say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pages

from generator.heads.head import Wish
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.detector import Detector


def defined(page: str, name: str) -> Any:
    """What a block of a page calls so."""
    [block] = [block for block in pages.blocks("python") if block.page == page]
    namespace: dict[str, Any] = {}
    exec(compile(block.text, block.place, "exec"), namespace)
    return namespace[name]


def test_a_detector_of_ones_own() -> None:
    detector: Detector = defined("docs/own-detector.md", "MiddleFace")(0.5)
    found = detector.detect(np.zeros((200, 300, 3), dtype=np.uint8))
    assert found is not None and found.shape == (detector.topology.count, 3) and found.dtype == np.float32
    nose, crown = found[1], found[10]
    assert crown[1] < nose[1] and nose[2] < crown[2], "y down, and the nose is nearer"
    detector.close()


def test_a_head_source_of_ones_own(tmp_path: Path) -> None:
    maker = defined("docs/own-source.md", "MAKER")
    counted: list[int] = []
    wish = Wish("90", count=3, seed=5, sampled_expressions=0)
    made = maker.make(tmp_path / "heads", wish, lambda: counted.append(1))
    assert made.subjects == ("ball5-0", "ball5-1", "ball5-2") and len(counted) == 3
    heads = find_heads(tmp_path / "heads").heads
    assert sorted(head.subject for head in heads) == sorted(made.subjects)
    mesh = read_mesh(heads[0], tmp_path)
    corners = mesh.vertices[mesh.triangles]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((outwards * corners.mean(axis=1)).sum(axis=1) > 0).all() and np.abs(mesh.vertices).max() == 90
