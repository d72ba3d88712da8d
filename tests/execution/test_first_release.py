# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets of the first release grow, and nothing of them is rendered again."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from no_renderer import NoRenderer
from quiet import Quiet

from generator.content import content_versions
from generator.dataset.format.manifest import MANIFEST_FILE, read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError
from generator.execution.build import first_release
from generator.execution.build.run import build
from generator.execution.build.units import PlannedHead, assign_split, head_camera
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.landmarks.anchors import Anchors, no_anchors
from generator.landmarks.topology import FACE_MESH
from generator.plan.config import load_config

FIXTURE = Path(__file__).parent / "first_release"
"""See its README."""

THEN = {
    "headturn": "0.1.0",
    "blender": "4.5.15",
    "detector": "mediapipe 0.10.21",
    "numpy": "1.26.4",
    "opencv": "4.11.0",
}
NOW = {**content_versions(blender="none", detector="none"), **THEN, "headturn": "9.9.9"}
"""Of lanes with the same libraries, and those that the first release did not record."""

CONFIG: dict[str, dict[str, Any]] = {
    "heads": {"source": "heads", "units": "mm", "up": "+Y", "forward": "+Z"},
    "poses": {"yaw": [0, 20, 10], "pitch": [0, 0, 1], "roll": [0, 0, 1]},
    "render": {"light_yaw_deg": -10},
    "dataset": {"images": "none", "unit_size": 2},
}


class Again:
    """The dataset in tmp_path, built once more from the folder from which it was built before."""

    def __init__(self) -> None:
        self.root = Path("dataset").absolute()
        self.lanes, self.said = NoRenderer(), Quiet()

    def build(self, versions: dict[str, str] | None = None, **sections: dict[str, Any]) -> None:
        """With these changes to CONFIG; nothing may be deleted."""
        values = {name: {**CONFIG.get(name, {}), **sections.get(name, {})} for name in CONFIG}
        self.lanes, self.said = NoRenderer(versions or NOW), Quiet()
        build(load_config(None, values), self.root, self.lanes, self.said)

    @property
    def parts(self) -> set[str]:
        """Names of the part files."""
        return {path.name for path in self.root.rglob("*.parquet") if path.parent.name == "train"}


@pytest.fixture
def again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Again:
    """A copy of the fixture, with the working directory of its build."""
    monkeypatch.setattr("generator.execution.build.run.detection_map", lambda root, manifest, file: file)
    monkeypatch.chdir(tmp_path)
    shutil.copytree(FIXTURE, tmp_path, dirs_exist_ok=True)
    return Again()


def test_what_is_there_is_taken_over_with_its_rows(again: Again) -> None:
    before, parts = read_manifest(again.root), again.parts
    again.build()
    after = read_manifest(again.root)
    assert not again.lanes.built
    assert "4 parts were taken over without being rendered again" in again.said.notes
    assert after.digest == before.digest
    assert len(after.parts) == len(again.parts) == 4 and not parts & again.parts
    assert verify_dataset(again.root).ok
    again.build()
    assert not again.said.notes or "taken over" not in " ".join(again.said.notes), "once"


def test_it_grows_at_both_ends_and_by_a_head(again: Again) -> None:
    heads = Path("heads")
    shutil.copytree(heads / "h00000", heads / "h00002")
    again.build(poses={"yaw": [-20, 40, 10]})
    rendered = sorted((o.head.subject, len(o.views)) for o in again.lanes.built)
    assert rendered == [
        *[("h00000", 2)] * 2,
        *[("h00001", 2)] * 2,
        *[("h00002", 1), ("h00002", 2), ("h00002", 2), ("h00002", 2)],
    ]
    report = verify_dataset(again.root)
    assert report.ok, report.text()
    again.build(poses={"yaw": [-20, 50, 10]})
    assert sum(len(order.views) for order in again.lanes.built) == 3


def test_where_nothing_grows_the_dataset_is_finished_already(again: Again) -> None:
    (again.root / MANIFEST_FILE).unlink()
    again.build()
    assert not again.lanes.built and read_manifest(again.root).rows == 6


@pytest.mark.parametrize(
    "versions",
    [{**NOW, "blender": "5.0.0"}, {**NOW, "numpy": "2.0.0"}, {**NOW, "content": "2"}],
    ids=["Blender", "numpy", "content"],
)
def test_what_others_would_render_otherwise_is_not_taken_over(again: Again, versions: dict[str, str]) -> None:
    with pytest.raises(DatasetError, match=r"4 parts .* will be deleted; nothing was changed"):
        again.build(versions)
    assert read_manifest(again.root).rows == 6


def test_a_setting_that_it_did_not_have_decides_nothing_until_it_is_used() -> None:
    planned = planned_head("neutral", PLAIN, no_anchors(FACE_MESH), {})
    assert first_release.names(planned, load_config(None, {}), THEN, NOW) is not None
    assert first_release.names(planned, load_config(None, {}), None, NOW) is None, "nothing is there"
    assert first_release.names(planned, load_config(None, {}), NOW, NOW) is None, "it is of today"


PLAIN = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0)
A_DEGREE = (0.9998476951563913, 0.01745240643728351)
"""Cosine and sine."""

TURNED = Placement(
    *("cm", 10.0, "+Z", "-Y", (1.5, -2.0, 0.25), 133.7, 88.25, ("units guessed: cm",), "canonical"),
    (A_DEGREE[0], 0.0, A_DEGREE[1], 0.0, 1.0, 0.0, -A_DEGREE[1], 0.0, A_DEGREE[0]),
    (0.1, 0.2, 0.3),
)  # fmt: skip
ANCHORS = Anchors(
    np.zeros(468, np.int32), np.full((468, 3), 1 / 3), np.arange(1404).reshape(468, 3) / 7.0, 5, 2, 0.25, 0.5
)
USED = {
    "render": {
        "preset": "quality", "lens_mm": 50, "projection": "orthographic", "margin": 1.2, "light_yaw_deg": -10,
        "light_pitch_deg": 5.5, "ambient": 0.1, "background": [0.1, 0.2, 1.0],
    },
    "dataset": {"images": "embedded", "image_format": "jpg", "passes": ["depth", "uv"], "validation": 1.0},
    "landmarks": {"min_confidence": 0.75},
    "poses": {"frame": "canonical"},
}  # fmt: skip
NAMES = {
    "plain": ({}, "neutral", PLAIN, no_anchors(FACE_MESH), "57175181dcf892b8", "836c03a67254a6f6"),
    "all": (USED, "smile", TURNED, ANCHORS, "8a311367ab73aa30", "bb910b58898eb76b"),
    "fixed": (
        {"render": {"samples": 9, "distance_mm": 777.5, "resolution": 64}},
        *("neutral", PLAIN, ANCHORS, "a58934c8cfa1c2fc", "0d2f2f2d2c7d62f6"),
    ),
}
"""Configuration, expression, placement, anchors, and the names that release 0.1.0 itself gave."""


def planned_head(expression: str, placement: Placement, anchors: Anchors, values: dict) -> PlannedHead:
    config = load_config(None, values)
    mesh = Path("/h/p1/a.obj")
    head = Head("p1", expression, "mesh", mesh, (mesh,), "CC0-1.0", True, "me", "mm")
    return PlannedHead(
        head=head,
        placement=placement,
        file_sha256=(("p1/a.obj", "ab" * 32),),
        vertices=10,
        triangles=20,
        split=assign_split("p1", config.dataset.validation),
        camera=head_camera(config, placement),
        anchors=anchors,
    )


@pytest.mark.parametrize(
    ("values", "expression", "placement", "anchors", "name", "earlier"), NAMES.values(), ids=NAMES
)
def test_names_are_those_of_the_first_release(
    values: dict, expression: str, placement: Placement, anchors: Anchors, name: str, earlier: str
) -> None:
    planned = planned_head(expression, placement, anchors, values)
    namer = first_release.names(planned, load_config(None, values), THEN, NOW)
    assert namer is not None
    poses = ((0.0, -10.5, 30.0), (10.0, 0.0, 0.0))
    assert namer(poses, ((0, 1, 2), (1, 2, 3))) == name
    assert namer(poses, ((0, 0, 0), (1, 1, 1))) == earlier
