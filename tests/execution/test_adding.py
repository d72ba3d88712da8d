# SPDX-License-Identifier: GPL-3.0-or-later
"""What somebody adds in one place appears everywhere it must: one dummy of each kind.

Columns, export formats, passes and topologies: tests/dataset/test_columns.py and test_kinds.py.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from small_builds import ROOT, SMALL, config_for, run

from generator import registries
from generator.cli.app import make_app
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import as_array
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError
from generator.execution.executors.executor import Circumstances
from generator.execution.executors.open import open_executor
from generator.execution.executors.serial import SerialExecutor
from generator.execution.replay import replay_sample
from generator.heads.head import NEUTRAL, Made, Maker, Wish
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.landmarks.topology import FACE_MESH
from generator.plan.config import load_config
from generator.plan.views import View
from generator.registry import Registry

pytestmark = pytest.mark.slow


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch):
    """add(registry, name, entry), taken away at the end."""
    names: list[tuple[Registry, str]] = []

    def add(registry: Registry, name: str, entry: object) -> None:
        registry.add(name, entry)
        names.append((registry, name))

    yield add
    for registry, name in names:
        registry.remove(name)


def help_of(command: str, capsys: pytest.CaptureFixture) -> str:
    with pytest.raises(SystemExit):
        make_app()([command, "--help"])
    return capsys.readouterr().out


class NoseFinder:
    """A detector that finds the same face in every image of a build, a third as large as the image.

    Where heads are placed it sees what is there: a face that is nowhere on the mesh is not believed.
    """

    topology = FACE_MESH

    def __init__(self, min_confidence: float) -> None:
        self.name = f"nose-finder {min_confidence}"
        self._eyes = MediaPipeFaceMesh(min_confidence)

    def detect(self, image: np.ndarray) -> np.ndarray | None:
        height, width = image.shape[:2]
        if width != SMALL["render"]["resolution"]:
            return self._eyes.detect(image)
        face = FACE_MESH.reference_face() * [1.0, -1.0, -1.0]
        return (face * width / 450 + [width / 2, height / 2, 0]).astype(np.float32)

    def close(self) -> None:
        self._eyes.close()


def test_a_detector(added, parametric_heads: Path, tmp_path: Path) -> None:
    """It places heads, finds landmarks, and its name and confidence decide what a unit is."""
    with pytest.raises(UsageError, match=r"landmarks\.detector: Input should be 'mediapipe', .*, got 'nose'"):
        load_config(None, {"landmarks": {"detector": "nose"}})
    added(registries.DETECTORS, "nose", NoseFinder)
    given = {"detector": "nose", "min_confidence": 0.25}
    config = config_for(parametric_heads, landmarks=given, heads={"units": "mm"})
    result = run(config, tmp_path / "d", "serial")
    assert result.manifest.versions["detector"] == "nose-finder 0.25"
    assert result.manifest.detected_rows == result.manifest.rows
    rows = pq.read_table(tmp_path / "d" / "data")
    landmarks = as_array(rows, "landmarks")
    assert (landmarks == landmarks[0]).all(), "the same face in every image"
    assert verify_dataset(tmp_path / "d").ok


def test_a_head_source(added, parametric_heads: Path, tmp_path: Path) -> None:
    """Made on the spot by --heads NAME:ARGUMENT; its heads are built, recorded, verified and replayed."""

    def copy_heads(folder: Path, wish: Wish, made) -> Made:
        subjects = sorted(path.name for path in parametric_heads.iterdir())[: wish.count]
        for subject in subjects:
            shutil.copytree(parametric_heads / subject, folder / subject, dirs_exist_ok=True)
            made()
        assert wish.argument == "blue"
        return Made(tuple(subjects), (NEUTRAL,))

    added(registries.HEAD_MAKERS, "copies", Maker(copy_heads))
    config = config_for("copies:blue", heads={"count": 1})
    result = run(config, tmp_path / "d", "serial")
    assert result.manifest.heads == 1 and verify_dataset(tmp_path / "d").ok
    [head] = read_heads(tmp_path / "d")
    assert replay_sample(tmp_path / "d", f"{head.subject}/neutral/y-40_p+0_r+0").same


def test_an_executor(added, parametric_heads: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    opened = []

    class Careful(SerialExecutor):
        name = "careful"

        def __init__(self, given: Circumstances) -> None:
            opened.append(given.workers)
            super().__init__(given)

    added(registries.EXECUTORS, "careful", Careful)
    assert "serial|local|ray|careful" in " ".join(help_of("build", capsys).split()).replace("│ ", "")
    assert run(config_for(parametric_heads), tmp_path / "d", "careful").complete
    assert opened == [None]
    with (
        pytest.raises(UsageError, match="expected one of serial, local, ray, careful"),
        open_executor("cloud"),
    ):
        pass


def stand_back(view: View, rng: np.random.Generator) -> View:
    """Another distance, another lens, a principal point beside the middle, another light."""
    camera = view.camera
    distance = camera.distance_mm * rng.uniform(1.0, 1.3)
    moved = replace(
        camera,
        distance_mm=distance,
        lens_mm=camera.lens_mm * rng.uniform(1.0, 1.3),
        principal_px=tuple(rng.uniform(0.45, 0.55, 2) * [camera.width, camera.height]),
    )
    look = replace(view.look, light_yaw_deg=rng.uniform(-60, 60), background=tuple(rng.uniform(0, 1, 3)))
    return View(view.pose, moved, look)


def test_a_draw_for_every_image(added, parametric_heads: Path, tmp_path: Path) -> None:
    """Each row its own camera: labels, visibility and passes follow it, and replay gives the same bytes."""
    plain = run(config_for(parametric_heads), tmp_path / "plain").manifest
    added(registries.DRAWS, "camera", stand_back)
    config = config_for(parametric_heads, dataset={"passes": ["depth", "position"]})
    root = tmp_path / "d"
    manifest = run(config, root).manifest
    assert manifest.digest != plain.digest
    report = verify_dataset(root)
    assert report.ok, report.text()
    rows = pq.read_table(root / "data")
    cameras, pivots = as_array(rows, "camera"), as_array(rows, "translation_mm")
    assert len(np.unique(cameras, axis=0)) == len(np.unique(pivots, axis=0)) == len(rows)
    assert (cameras[:, [2, 5]] != 48).all(), "the optical axis is beside the middle"
    name = rows["sample_id"][0].as_py()
    assert replay_sample(root, name).same

    # One worker or two, one head or two: a draw is what it was.
    one = run(config, tmp_path / "one", "serial").manifest
    assert one.digest == manifest.digest
    first = sorted(path.name for path in parametric_heads.iterdir())[0]
    alone = tmp_path / "alone"
    run(config_for(parametric_heads, heads={"subjects": [first]}, dataset={"unit_size": 3}), alone)
    few = pq.read_table(alone / "data").sort_by("sample_id")
    same = rows.filter(np.array(rows["subject"].to_pylist()) == first).sort_by("sample_id")
    assert few["camera"].to_pylist() == same["camera"].to_pylist()

    # Without the draw verify says that these are not the cameras of the plan.
    registries.DRAWS.remove("camera")
    try:
        assert "camera is not what the configuration plans" in verify_dataset(root).text()
    finally:
        registries.DRAWS.add("camera", stand_back)


EXPOSURE = """    exposure: float = setting(
        0.0, "Stops that images are lighter or darker", unit="stops", low=-8, high=8, label="Exposure"
    )
"""


def test_a_setting_touches_the_table_and_the_place_that_uses_it(
    parametric_heads: Path, tmp_path: Path
) -> None:
    """In a copy of the package: exposure as an option, in TOML, in the documentation, in the images."""
    shutil.copytree(ROOT / "generator", tmp_path / "generator")
    table = tmp_path / "generator" / "plan" / "render_settings.py"
    before, mark, after = table.read_text().partition("    ambient: float = setting(")
    table.write_text(before + EXPOSURE + mark + after)
    use = tmp_path / "generator" / "blender" / "stage.py"
    place = "            self._set_light(view.look, environment, pixel_mm)\n"
    before, mark, after = use.read_text().partition(place)
    assert mark
    use.write_text(
        before + mark + "            self.scene.view_settings.exposure = view.look.exposure\n" + after
    )

    def headturn(*arguments: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        command = [sys.executable, "-m", "generator.cli", *arguments]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
        return done.stdout + done.stderr

    assert "--exposure" in headturn("build", "--help") and "--exposure" in headturn("preview", "--help")
    small = ["--heads", str(parametric_heads), "--yaw=0,40,40", "--pitch=0,0,1", "--roll=0,0,1"]
    small += ["--resolution", "64", "--executor", "serial"]
    assert "render.exposure: Input should be less than" in headturn("build", *small, "--exposure", "9")
    headturn("build", *small, "--out", "usual")
    headturn("build", *small, "--exposure", "-2", "--out", "dark")
    assert "exposure = -2.0" in (tmp_path / "dark" / "config.toml").read_text()
    usual, dark = (sorted((tmp_path / name / "images").rglob("*.png")) for name in ("usual", "dark"))
    assert len(usual) == len(dark) == 4
    from PIL import Image

    for a, b in zip(usual, dark, strict=True):
        assert np.array(Image.open(b)).mean() < 0.75 * np.array(Image.open(a)).mean()

    # What was built without the setting stays valid: the same names, nothing is rendered again.
    old = tmp_path / "old"
    config = load_config(None, {"heads": {"source": str(parametric_heads)}, "poses": {"yaw": [0, 40, 40],
        "pitch": [0, 0, 1], "roll": [0, 0, 1]}, "render": {"resolution": 64}})  # fmt: skip
    run(config, old)
    parts = sorted(path.name for path in (old / "data").rglob("*.parquet"))
    assert parts == sorted(path.name for path in (tmp_path / "usual" / "data").rglob("*.parquet"))
    said = headturn("build", *small, "--out", str(old))
    assert "continuing: 2 of 2 units are already there" in said
    assert read_manifest(old).configuration["render"]["exposure"] == 0.0
    assert "ok    digest" in headturn("verify", str(old))
