# SPDX-License-Identifier: GPL-3.0-or-later
"""What needs no Blender: host lookup, processes, the configuration, the grid, the zip."""

from __future__ import annotations

import ast
import sys
import time
import zipfile
from contextlib import ExitStack
from pathlib import Path

import pytest
import tomllib

from blender_addon.core import config, grid, headless, host
from blender_addon.core.process import HostProcess
from blender_addon.core.progress import Progress, duration
from generator import __version__
from generator.errors import UsageError, WorkerError
from generator.execution.preview.server import PreviewServer
from generator.plan.config import BuildConfig, load_config

ROOT = Path(__file__).resolve().parents[2]


def make_python(folder: Path) -> Path:
    path = folder / "bin" / "python"
    path.parent.mkdir(parents=True)
    path.symlink_to(sys.executable)
    return path


def test_the_host_is_looked_up_in_the_written_order(tmp_path: Path) -> None:
    preferred, named, beside = (make_python(tmp_path / name) for name in ("a", "b", "c/.venv"))
    on_path = tmp_path / "d" / "headturn"
    on_path.parent.mkdir()
    on_path.write_text("#!/bin/sh\n")
    on_path.chmod(0o755)
    environ = {"HEADTURN_PYTHON": str(named), "PATH": str(on_path.parent)}
    # A folder of an environment counts as its Python.
    assert host.find_host(str(tmp_path / "a"), tmp_path / "c", environ).command[0] == str(preferred)
    assert host.find_host("", tmp_path / "c", environ).command[0] == str(named)
    del environ["HEADTURN_PYTHON"]
    assert host.find_host("", tmp_path / "c", environ).command[0] == str(beside)
    assert host.find_host("", tmp_path, environ).command == (str(on_path),)
    with pytest.raises(host.HostMissing, match=r"pip install 'headturn\[build\]'"):
        host.find_host("", None, {"PATH": ""})


def test_a_host_that_was_named_is_never_replaced_by_another(tmp_path: Path) -> None:
    make_python(tmp_path / ".venv")
    with pytest.raises(host.HostMissing, match="HEADTURN_PYTHON"):
        host.find_host("", tmp_path, {"HEADTURN_PYTHON": str(tmp_path / "gone")})


def test_a_python_without_headturn_says_how_to_install_it(tmp_path: Path) -> None:
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\ncd / && PYTHONPATH= exec "{sys.executable}" -S "$@"\n')
    bare.chmod(0o755)
    with pytest.raises(host.HostMissing, match="pip install"):
        host.check_host(host.find_host(str(bare), None, {}))


def test_a_host_without_bpy_renders_with_the_blender_that_asks() -> None:
    found = host.Host(("headturn",), "PATH")
    facts = host.HostFacts("1", "3.12", None, "0.10", "21", None)
    assert host.host_command(found, facts, ["build"], "/b") == ["headturn", "build", "--blender", "/b"]
    given = ["build", "--blender", "/mine"]
    assert host.host_command(found, facts, given, "/b")[1:] == given
    assert host.host_command(found, facts, ["verify", "d"], "/b")[1:] == ["verify", "d"]


def test_what_the_panel_writes_is_what_the_command_line_reads(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    values = {
        "heads": {"source": 'a "b" \\ ü\x7f', "subjects": ["1", "x"]},
        "poses": {"kind": "uniform", "yaw": [-0.1, 50], "count": 7},
        "render": {"ambient": config.number(0.10000000149011612), "background": [0, 0.5, 1]},
        "dataset": {"images": "none"},
    }
    config.write_config(values, path)
    assert config.read_config(path) == values == tomllib.loads(path.read_text(encoding="utf-8"))
    read = load_config(path, {})
    assert read.render.ambient == 0.1 and read.heads.source == values["heads"]["source"]


def test_settings_that_no_panel_shows_are_kept() -> None:
    base = BuildConfig().model_dump(mode="json", exclude_none=True)
    shown = {"render": {"resolution": 64, "distance_mm": None}}
    merged = config.merged({**base, "render": {**base["render"], "distance_mm": 500.0}}, shown)
    assert merged["landmarks"] == base["landmarks"] and merged["render"]["margin"] == base["render"]["margin"]
    assert merged["render"]["resolution"] == 64 and "distance_mm" not in merged["render"]


def test_digits_that_blender_cannot_hold_are_kept() -> None:
    base = {"poses": {"yaw": [-33.3333333333, 50, 10]}, "render": {"margin": 1.1, "lens_mm": 85.0}}
    shown = {"poses": {"yaw": [-33.33333, 50, 10]}, "render": {"lens_mm": 85}}
    assert config.merged(base, shown) == base
    assert config.merged(base, {"poses": {"yaw": [-33.3334, 50, 10]}})["poses"]["yaw"][0] == -33.3334


def test_names_in_a_field_are_separated_by_commas() -> None:
    assert config.split_names(' anna,  "Lee, Perry" ,3 ') == ["anna", "Lee, Perry", "3"]
    assert config.split_names(config.join_names(["a", 'b "x", c'])) == ["a", 'b "x", c']
    assert config.split_names(" , ") is None and config.join_names([]) == ""


@pytest.mark.parametrize("text", ["[render", "[unknown]\na = 1", "render = 3"])
def test_a_bad_configuration_is_refused_with_its_name(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text)
    with pytest.raises(UsageError, match=r"bad\.toml"):
        config.read_config(path)


def test_the_timeline_is_the_plan_of_the_build() -> None:
    poses = BuildConfig().poses
    plan = grid.plan_poses(poses.model_dump())
    assert (plan.angles_deg == poses.plan().angles_deg).all() and len(plan) == 693
    assert grid.snapped(13.0, (-50, 50, 10)) == 10 and grid.snapped(99.0, (-50, 50, 10)) == 50
    assert len(set(grid.extremes(poses.model_dump()))) == 9
    assert grid.extremes(poses.model_dump())[0] == (-50, 40, -30)


def test_every_plan_of_the_build_is_on_the_timeline(tmp_path: Path) -> None:
    values = BuildConfig().poses.model_dump() | {"yaw": [10, 50], "count": 9, "seed": 3}
    table = tmp_path / "poses.csv"
    table.write_text("yaw_deg,pitch_deg,roll_deg\n5,1,2\n-5,0,7\n", encoding="utf-8")
    for kind in ("uniform", "sobol", "csv"):
        poses = {**values, "kind": kind, "path": str(table)}
        if kind == "sobol":  # takes SciPy, so the host draws it
            with pytest.raises(grid.NotDrawn):
                grid.plan_poses(poses)
            answer = PreviewServer(tmp_path, ExitStack()).answer(
                {"op": "plan", "poses": poses, "file": str(tmp_path / "p.npy")}
            )
            assert answer == {"count": 9}
            grid.remember(poses, tmp_path / "p.npy")
            with pytest.raises(grid.NotDrawn):
                grid.plan_poses({**poses, "seed": 4})
        planned = load_config(None, {"poses": poses}).poses.plan()
        assert (grid.plan_poses(poses).angles_deg == planned.angles_deg).all()
        assert (grid.plan_poses(poses).indices == planned.indices).all()
    assert grid.extremes({**values, "kind": "csv", "path": str(table)})[:2] == [(-5, 1, 2), (0, 1, 2)]
    assert {yaw for yaw, _, _ in grid.extremes({**values, "kind": "sobol"})} == {10, 50}


def test_progress_adds_up_events() -> None:
    progress = Progress()
    progress.take({"event": "stage", "stage": "rendering", "total": 10})
    progress.take(
        {"event": "progress", "stage": "rendering", "done": 5, "total": 10, "rate": 2, "eta_s": 2.5}
    )
    progress.take({"event": "something new"})
    assert progress.share == 0.5 and progress.line() == "rendering 5 of 10 · 2.0/s · 0:02 left"
    assert duration(3725) == "1:02:05"


def test_a_process_is_read_without_waiting_and_interrupted() -> None:
    code = "import time; print('{\"a\": 1}', flush=True); print('not json', flush=True); time.sleep(60)"
    process = HostProcess([sys.executable, "-c", code])
    events: list[dict] = []
    deadline = time.monotonic() + 20
    while not events and time.monotonic() < deadline:
        events += process.poll()
    assert events == [{"a": 1}]
    assert process.exit_code is None
    process.interrupt()
    while process.exit_code is None and time.monotonic() < deadline:
        process.poll()
    assert process.exit_code not in (None, 0)
    process.close()
    assert process.log[0] == "not json" or "not json" in process.log
    with pytest.raises(WorkerError, match="cannot start"):
        HostProcess(["/nowhere/python"])


def test_headless_has_the_exit_codes_of_the_command_line(
    host_python: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("HEADTURN_OUTSIDE", raising=False)
    missing = str(tmp_path / "missing.toml")
    assert headless.run(["build", missing], preference=str(host_python)) == 2
    assert "missing.toml" in capfd.readouterr().err
    assert headless.run(["verify", str(tmp_path)], preference=str(host_python)) == 1
    assert headless.run(["verify", str(tmp_path)], preference=str(tmp_path / "none")) == 2
    assert "no Python" in capfd.readouterr().err


def test_the_extension_is_whole_and_private(extension_zip: Path) -> None:
    assert extension_zip.name == f"headturn-{__version__}.zip"
    allowed = {"numpy", "bpy", "mathutils", "bpy_extras", "gpu", "gpu_extras", *sys.stdlib_module_names}
    with zipfile.ZipFile(extension_zip) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert manifest["version"] == __version__ and "wheels" not in manifest
        assert {"__init__.py", "LICENSE.txt", "generator/blender/scene.py"} <= names
        for name in sorted(names):
            if not name.endswith(".py"):
                continue
            for node in ast.walk(ast.parse(archive.read(name))):
                if isinstance(node, ast.Import):
                    assert {a.name.split(".")[0] for a in node.names} <= allowed, name
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    # scipy belongs to Sobol plans, which the host draws.
                    assert (node.module or "").split(".")[0] in allowed | {"scipy"}, (name, node.module)


def test_the_core_knows_no_blender() -> None:
    for path in (ROOT / "blender_addon" / "core").glob("*.py"):
        assert "import bpy" not in path.read_text(encoding="utf-8"), path
    for path in (ROOT / "blender_addon").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n"), path
        assert text.count("\n") <= 350, path
