# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender scene as the source: labels worked out by hand, verify, replay, workers; nothing of it runs."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import scene_by_hand as hand
from small_builds import config_for, run

from generator.dataset.format.anchors_table import read_anchors
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.passes import read_channels
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError
from generator.execution.build.run import BuildResult
from generator.execution.replay import replay_samples
from generator.geometry.rotation import rotation_from_angles
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.shared import packaged
from generator.landmarks.topology import FACE_MESH
from generator.plan.config import BuildConfig

pytestmark = pytest.mark.slow

PASSES = ["depth", "normal", "position", "object_index", "albedo"]
RENDER = {"resolution": 96, "scene_camera": True, "preset": "quality"}
"""Whatever the preset, which is of heads without a scene."""


@dataclass(frozen=True)
class Scene:
    """vertices: of its face as modelled, mm; triangles in their order. mark: is there if a script ran."""

    file: Path
    vertices: np.ndarray
    triangles: np.ndarray
    mark: Path


@pytest.fixture(scope="session")
def scene(parametric_heads: Path, tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("scene")
    head = find_heads(parametric_heads).heads[0]
    mesh = read_mesh(head, folder)
    colors = np.ones((len(mesh.vertices), 4)) * (0.8, 0.6, 0.5, 1.0)
    np.savez(folder / "head.npz", vertices=mesh.vertices, triangles=mesh.triangles, colors=colors)
    made = Scene(folder / "scene.blend", mesh.vertices, mesh.triangles, folder / "ran.txt")
    script = Path(__file__).with_name("make_scene.py")
    command = [sys.executable, str(script), str(folder / "head.npz"), str(made.file), str(made.mark)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert made.file.exists(), done.stdout + done.stderr
    made.mark.unlink(missing_ok=True)  # whoever made it could run it
    return made


@pytest.fixture(scope="session")
def config(scene: Scene) -> BuildConfig:
    return config_for(
        scene.file,
        poses={"yaw": [-40, 40, 80], "pitch": [0, 0, 10], "roll": [0, 20, 20]},
        render=RENDER,
        dataset={"unit_size": 2, "passes": PASSES},
    )


@pytest.fixture(scope="session")
def built(config: BuildConfig, tmp_path_factory: pytest.TempPathFactory) -> BuildResult:
    return run(config, tmp_path_factory.mktemp("built") / "dataset")


def test_labels_are_those_that_are_worked_out_by_hand(scene: Scene, built: BuildResult) -> None:
    heads = {head.expression: head for head in read_heads(built.root)}
    anchors = read_anchors(built.root)
    [shared] = [one for one in packaged(FACE_MESH) if one.fits(scene.triangles)]
    assert set(heads) == {"neutral", "smile"}
    hidden = 0
    for row in pq.read_table(built.root / "data", partitioning=None).to_pylist():
        head = heads[row["expression"]]
        assert (head.units, head.up, head.forward, head.anchor_way) == ("m", "+Y", "+Z", "package")
        surface = hand.surface_mm(scene.vertices, row["expression"] == "smile")
        corners = surface[scene.triangles[shared.anchors.triangles]]
        points = (shared.anchors.weights[:, :, None] * corners).sum(1)
        pivot = np.array(head.pivot)
        centred = (points - 1000 * pivot) @ hand.FRAME_C
        rotation = rotation_from_angles(np.array([row["yaw_deg"], row["pitch_deg"], row["roll_deg"]]))
        expected = centred @ rotation.T + hand.pivot_c(pivot)
        exact = np.array(row["landmarks_exact"]).reshape(-1, 3)
        known = np.isfinite(exact).all(axis=1) & np.isfinite(expected).all(axis=1)
        assert known.sum() > 460
        matrix = np.array(row["camera"]).reshape(3, 3)
        assert np.abs(matrix - hand.camera_matrix(row["width"], row["height"])).max() < 1e-4
        # The post hides a strip of the face, whichever way that looks; hair and glass hide nothing there.
        visible = np.array(row["landmarks_visible"])
        seen = hand.pixels(expected[known], matrix)
        behind = np.abs(seen[:, 0] - hand.post_px(row["width"], row["height"], seen[:, 1])) < 3.0
        hidden += behind.sum()
        assert not visible[known][behind].any()
        assert visible.sum() > 50
        off = hand.pixels(exact[known], matrix) - hand.pixels(expected[known], matrix)
        assert np.abs(off).max() < 0.01
    before, after = (anchors["scene", expression].points for expression in ("neutral", "smile"))
    assert np.nanmax(np.abs(after - before)) > 2.5, "the shape key moves the jaw by 3 mm"
    assert (row["width"], row["height"]) == (96, 72)
    assert hidden > 30


def test_verify_proves_every_row_and_some_are_rendered_again_bit_by_bit(built: BuildResult) -> None:
    report = verify_dataset(built.root)
    assert report.ok, report.text()
    names = pq.read_table(built.root / "data", partitioning=None).column("sample_id").to_pylist()
    again = [*replay_samples(built.root, names[::-3], workers=1)]
    assert again and all(one.same for one in again), [one.text() for one in again]


def test_albedo_is_of_the_materials_whatever_the_light(built: BuildResult) -> None:
    """Sun and a blue sky shine on a wall of a known colour that is glossy, and on a post that has none."""
    name = pq.read_table(built.root / "data", partitioning=None).column("passes_path").to_pylist()[0]
    found = read_channels(built.root / name)
    albedo = np.stack([found[f"albedo.{channel}"] for channel in "RGB"], axis=-1)
    there = found["object_index.X"] == 3
    wall = np.array((0.5, 0.15, 0.1))
    of_wall = np.abs(albedo - (wall + 0.04 * (1 - wall))).max(axis=-1) < 0.01
    of_post = np.abs(albedo - 0.8).max(axis=-1) < 1e-3
    assert (there & of_wall).sum() > 1000 and (there & of_post).sum() > 200
    assert (there & ~of_wall & ~of_post).sum() < 0.05 * there.sum(), "edges alone are means of both"
    head = albedo[found["object_index.X"] == 1]
    assert np.isfinite(head).all() and (np.median(head, axis=0) > (0.5, 0.25, 0.15)).all()


def test_one_worker_builds_the_same(config: BuildConfig, built: BuildResult, tmp_path: Path) -> None:
    assert run(config, tmp_path / "other", "serial").manifest.digest == built.manifest.digest


def test_nothing_of_a_scene_runs(scene: Scene, built: BuildResult) -> None:
    assert not scene.mark.exists()
    [problems] = {head.problems for head in read_heads(built.root)}
    assert any("scripts and Python drivers do not run" in text for text in problems)


def test_what_a_scene_decides_is_not_asked_for(scene: Scene, tmp_path: Path) -> None:
    for render, said in (
        ({"glasses": "round"}, "--glasses: a scene is rendered with its own light"),
        ({"lens_mm": 50.0, "scene_camera": True}, "--lens: a scene is rendered with its own camera"),
        ({"backdrop": "noise"}, "--backdrop"),
    ):
        with pytest.raises(UsageError, match=said):
            run(config_for(scene.file, render=render), tmp_path / "refused")
    with pytest.raises(UsageError, match="--passes segmentation"):
        run(config_for(scene.file, dataset={"passes": ["segmentation"]}), tmp_path / "refused")
