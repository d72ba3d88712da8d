# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed extension and the render worker in bpy wheels.

The build's own wheel is always there; HEADTURN_BPY_PYTHONS names the Pythons of others,
separated by colons (`make test-bpy`).
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from generator.plan.render_settings import RenderSettings
from placed_head import PlacedHead
from real_blender import ROOT

from generator.execution.lanes.lines import LineProcess
from generator.heads.package import save_package
from generator.plan.config import BuildConfig, config_toml, load_config

OTHERS = [name for name in os.environ.get("HEADTURN_BPY_PYTHONS", "").split(":") if name]
FULL = {
    "render": {
        "preset": "quality", "samples": 9, "resolution": 96, "lens_mm": 50.3, "projection": "orthographic",
        "distance_mm": 712.345678, "margin": 1.2, "light_yaw_deg": -10.1, "light_pitch_deg": 5.5,
        "ambient": 0.123456789, "background": (0.1, 0.2, 1.0),
    },
    "landmarks": {"min_confidence": 0.3},
    "dataset": {
        "images": "embedded", "image_format": "jpg", "passes": ["depth"], "validation": 0.3, "unit_size": 7,
    },
}  # fmt: skip
"""A value that is not the default for everything, with digits that 32 bits do not hold."""

SOURCES = {
    "folder": {
        "source": "/heads", "subjects": ["anna", "Lee, Perry"], "expressions": ["2_smile"],
        "license": "CC-BY-4.0", "redistributable": True, "units": "cm", "up": "+Z", "forward": "-Y",
    },
    "made": {"count": 5, "seed": 11, "sampled_expressions": 2, "subjects": ["s11p0003"]},
}  # fmt: skip
PLANS = {
    "grid": {"yaw": [-33.3333333333, 33.3333333333, 6.66666666666], "frame": "canonical"},
    "uniform": {"kind": "uniform", "yaw": [-70, 70], "pitch": [-1, 1], "roll": [0, 9], "count": 5, "seed": 4},
    "sobol": {"kind": "sobol", "yaw": [0.1, 0.7], "pitch": [-1, 1], "roll": [0, 9], "count": 64},
    "csv": {"kind": "csv", "path": "/poses.csv"},
}


@pytest.fixture(scope="module")
def head(placed_head: PlacedHead, tmp_path_factory: pytest.TempPathFactory) -> Path:
    package = tmp_path_factory.mktemp("head") / "head.npz"
    save_package(placed_head.mesh, package)
    return package


@pytest.mark.parametrize("python", [sys.executable, *OTHERS])
def test_the_extension_in_a_bpy_wheel(python: str, extension_zip: Path, head: Path, tmp_path: Path) -> None:
    (tmp_path / "profile").mkdir()
    files = [tmp_path / f"{heads}-{poses}.toml" for heads in SOURCES for poses in PLANS]
    for file in files:
        heads, poses = file.stem.split("-")
        config = load_config(None, {**FULL, "heads": SOURCES[heads], "poses": PLANS[poses]})
        file.write_text(config_toml(config), encoding="utf-8")
    script = Path(__file__).with_name("wheel_session.py")
    done = subprocess.run(
        [python, str(script), str(extension_zip), str(head), str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "profile")},
    )
    assert "passed" in done.stdout and done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    # What the panel saves is what it was given, to the last digit, or the command line's defaults.
    assert load_config(tmp_path / "saved-defaults.toml", {}) == BuildConfig()
    for file in files:
        assert load_config(file.with_name(f"saved-{file.name}"), {}) == load_config(file, {}), file.stem


@pytest.mark.skipif(not OTHERS, reason="`make test-bpy` runs the oldest and the newest bpy wheel")
def test_every_bpy_wheel_renders_the_same_face(head: Path, tmp_path: Path) -> None:
    settings = RenderSettings(resolution=96)
    images = {}
    for python in (sys.executable, *OTHERS):
        out = tmp_path / str(len(images))
        out.mkdir()
        command = [python, "-m", "generator.blender.worker", "1"]
        worker = LineProcess(command, out / "log", {"PYTHONPATH": str(ROOT), "TMPDIR": str(out)})
        version = worker.receive(100)["ready"]
        worker.send(
            {
                "op": "render",
                "package": str(head),
                "settings": settings.as_dict(),
                "distance_mm": 650.0,
                "poses": [[30, -20, 10]],
                "out": str(out),
                "format": "bmp",
            }
        )
        path = worker.receive(100)["path"]
        assert worker.receive(100) == {"done": 1}
        images[version] = cv2.imread(path).astype(float)
        worker.close()
    assert {version[:3] for version in images} == {"4.2", "4.5", "5.0"}
    ours = next(image for version, image in images.items() if version.startswith("4.5"))
    assert ours.std() > 20
    for version, image in images.items():
        difference = float(np.abs(image - ours).mean())
        print(f"bpy {version}: mean difference from 4.5 is {difference:.3f} of 255")
        assert difference < 1.0, version
