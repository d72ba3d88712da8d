# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed extension and the render worker in bpy wheels.

The build's own wheel is always there; HEADTURN_BPY_PYTHONS names the Pythons of others,
separated by colons (`make test-bpy`).
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from placed_head import PlacedHead
from real_blender import ROOT

from generator.execution.lanes.lines import LineProcess
from generator.heads.package import save_package
from generator.messages import OrderDone, Rendered, RenderOrder, WorkerReady, expect, from_json, to_json
from generator.plan.config import BuildConfig, config_toml, load_config
from generator.plan.settings import Render
from generator.plan.view_plan import plan_views

pytestmark = pytest.mark.slow

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
    "uniform": {
        "kind": "uniform",
        "yaw": [-70, 70],
        "pitch": [-1, 1],
        "roll": [0, 9],
        "count": 5,
        "seed": 4,
        "same": True,
    },
    "sobol": {"kind": "sobol", "yaw": [0.1, 0.7], "pitch": [-1, 1], "roll": [0, 9], "count": 64},
    "csv": {"kind": "csv", "path": "/poses.csv"},
}


@pytest.fixture(scope="module")
def head(placed_head: PlacedHead, tmp_path_factory: pytest.TempPathFactory) -> Path:
    package = tmp_path_factory.mktemp("head") / "head.npz"
    save_package(placed_head.mesh, package)
    return package


RENDER = ("Lens", "Look", "Render")

DRAWN = {
    "lens_mm": "head:uniform:28,135",
    "background": ["uniform:0,1", 0.123456789, 0.5],
    "backdrop": "choice:plain,noise",
}

LINES = {
    "Look": """
    exposure: float = setting(0.0, "Exposure", unit="stops", low=-5, high=5, label="Exposure")
    tint: str | None = setting(
        None, "Tint", choices=(Choice("warm"), Choice("cold", "Like the moon")), label="Colour of the light"
    )
""",
    "Poses": """
    jitter: tuple[float, float] | None = setting(None, "Jitter", low=0, high=9, label="Jitter")
""",
    "Dataset": """
    notes: tuple[str, ...] = setting((), "Notes", label="Notes", content=False)
    logo: str | None = setting(None, "A picture", label="Logo", path=True, content=False)
""",
}
"""Settings that are not there, as somebody would add them."""


DRAW = """# SPDX-License-Identifier: GPL-3.0-or-later
from dataclasses import replace

from generator.plan.views import View


def stand_back(view, rng):
    farther = replace(view.camera, distance_mm=view.camera.distance_mm * rng.uniform(2, 3))
    return View(view.pose, farther, view.look)
"""
"""Something that differs from image to image."""


def run_in_wheel(python: str, script: str, *arguments: Path, profile: Path) -> None:
    """Run a script of this folder in a bpy wheel, to its "passed"."""
    profile.mkdir()
    done = subprocess.run(
        [python, str(Path(__file__).with_name(script)), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        # another test of this process may have asked for safe paths: scripts here import each other
        env={**os.environ, "BLENDER_USER_RESOURCES": str(profile), "PYTHONSAFEPATH": ""},
    )
    assert "passed" in done.stdout and done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr, done.stderr


@pytest.mark.parametrize("python", [sys.executable, *OTHERS])
def test_the_extension_in_a_bpy_wheel(python: str, extension_zip: Path, head: Path, tmp_path: Path) -> None:
    files = [tmp_path / f"{heads}-{poses}.toml" for heads in SOURCES for poses in PLANS]
    for file in files:
        heads, poses = file.stem.split("-")
        config = load_config(None, {**FULL, "heads": SOURCES[heads], "poses": PLANS[poses]})
        file.write_text(config_toml(config), encoding="utf-8")
    files.append(tmp_path / "full-drawn.toml")
    files[-1].write_text(config_toml(load_config(None, {"render": DRAWN})), encoding="utf-8")
    run_in_wheel(python, "wheel_session.py", extension_zip, head, tmp_path, profile=tmp_path / "profile")
    # What the panel saves is what it was given, to the last digit, or the command line's defaults.
    assert load_config(tmp_path / "saved-defaults.toml", {}) == BuildConfig()
    for file in files:
        assert load_config(file.with_name(f"saved-{file.name}"), {}) == load_config(file, {}), file.stem


@pytest.mark.parametrize("python", [sys.executable, *OTHERS])
def test_what_is_the_users_stays_as_it_is(
    python: str, extension_zip: Path, head: Path, tmp_path: Path
) -> None:
    """The whole file, property by property, after everything that the panel can do."""
    run_in_wheel(python, "untouched_session.py", extension_zip, head, tmp_path, profile=tmp_path / "profile")


def test_a_setting_more_needs_no_change_of_the_extension(tmp_path: Path) -> None:
    """A line in generator/plan/settings.py: a property, a row of the panel, TOML there and back.

    And a file with a line in generator/registries.py: a draw that the view shows.
    """
    tree = tmp_path / "tree"
    for name in ("generator", "blender_addon", "scripts", "LICENSES"):
        shutil.copytree(ROOT / name, tree / name, ignore=shutil.ignore_patterns("__pycache__"))
    for section, lines in LINES.items():
        table = tree / "generator" / "plan" / ("render_settings.py" if section in RENDER else "settings.py")
        text = table.read_text(encoding="utf-8")
        start = re.search(rf"^class {section}[:(]", text, re.MULTILINE).start()
        end = min(k for k in (text.find(mark, start) for mark in ("\n\n\n", "\n    @property")) if k > 0)
        table.write_text(text[:end] + lines.rstrip() + text[end:], encoding="utf-8")
    (tree / "generator" / "plan" / "stand_back.py").write_text(DRAW, encoding="utf-8")
    registries = tree / "generator" / "registries.py"
    text, entry = registries.read_text(encoding="utf-8"), '{"back": "generator.plan.stand_back:stand_back"}'
    assert 'Registry("draw", {})' in text
    registries.write_text(text.replace('("draw", {})', f'("draw", {entry})'), encoding="utf-8")
    script = tree / "scripts" / "build_extension.py"
    made = subprocess.run(
        [sys.executable, str(script), "--without-wheel", "--out", str(tmp_path)],
        check=True,
        capture_output=True,
        text=True,
    )
    package = Path(made.stdout.strip())
    run_in_wheel(sys.executable, "more_settings_session.py", package, tmp_path, profile=tmp_path / "profile")
    code = (
        "import sys; from pathlib import Path; from generator.plan.config import load_config\n"
        "c = load_config(Path(sys.argv[1]), {})\n"
        "print(c.render.exposure, c.render.tint, c.poses.jitter, c.dataset.notes, c.dataset.logo)"
    )
    for name, values in {
        "plain": "0.0 None None () None",
        "full": "-1.3 cold (0.1, 2.0) ('a', 'b, c') /logo.png",
    }.items():
        done = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / f"{name}.toml")],
            capture_output=True, text=True, cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)},
        )  # fmt: skip
        assert done.stdout.strip() == values, done.stderr


@pytest.mark.skipif(not OTHERS, reason="`make test-bpy` runs the oldest and the newest bpy wheel")
def test_every_bpy_wheel_renders_the_same_face(head: Path, tmp_path: Path) -> None:
    views = plan_views(
        BuildConfig(render=Render(resolution=96, distance_mm=650.0)), "a/neutral", 120.0, [(30, -20, 10)]
    )
    images = {}
    for python in (sys.executable, *OTHERS):
        out = tmp_path / str(len(images))
        out.mkdir()
        command = [python, "-m", "generator.blender.worker", "1"]
        worker = LineProcess(command, out / "log", {"PYTHONPATH": str(ROOT), "TMPDIR": str(out)})
        version = expect(WorkerReady, from_json(worker.receive(100))).version
        worker.send(to_json(RenderOrder(str(head), views, str(out))))
        path = expect(Rendered, from_json(worker.receive(100))).path
        expect(OrderDone, from_json(worker.receive(100)))
        images[version] = cv2.imread(path).astype(float)
        worker.close()
    assert {version[:3] for version in images} == {"4.2", "4.5", "5.0"}
    ours = next(image for version, image in images.items() if version.startswith("4.5"))
    assert ours.std() > 20
    for version, image in images.items():
        difference = float(np.abs(image - ours).mean())
        print(f"bpy {version}: mean difference from 4.5 is {difference:.3f} of 255")
        assert difference < 1.0, version
