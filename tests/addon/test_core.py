# SPDX-License-Identifier: GPL-3.0-or-later
"""The host that is looked up and started, its processes, its progress, and the zip of the extension."""

from __future__ import annotations

import ast
import os
import sys
import time
import zipfile
from pathlib import Path

import pytest
import tomllib

from blender_addon.core import headless, host
from blender_addon.core.process import HostProcess
from blender_addon.core.progress import Progress, duration
from generator import __version__
from generator.errors import WorkerError


def make_python(folder: Path) -> Path:
    path = folder / "bin" / "python"
    path.parent.mkdir(parents=True)
    path.symlink_to(sys.executable)
    return path


def test_the_host_is_looked_up_in_the_written_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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
    assert host.find_host("", tmp_path / "c", environ).command == (str(on_path),)
    # What lies beside somebody's files is not run, and PATH counts where it says a place.
    with pytest.raises(host.HostMissing, match=f"if {beside.parents[1]} is yours, name it"):
        host.find_host("", tmp_path / "c", {"PATH": ""})
    monkeypatch.chdir(on_path.parent)
    with pytest.raises(host.HostMissing):
        host.find_host("", None, {"PATH": os.pathsep.join(["", "."])})
    with pytest.raises(host.HostMissing, match="press Set Up"):
        host.find_host("", None, {"PATH": ""})


def test_a_host_that_was_named_is_never_replaced_by_another(tmp_path: Path) -> None:
    make_python(tmp_path / ".venv")
    with pytest.raises(host.HostMissing, match="HEADTURN_PYTHON"):
        host.find_host("", tmp_path, {"HEADTURN_PYTHON": str(tmp_path / "gone")})


def test_a_python_without_headturn_says_how_to_install_it(tmp_path: Path) -> None:
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\ncd / && PYTHONPATH= exec "{sys.executable}" -S "$@"\n')
    bare.chmod(0o755)
    with pytest.raises(host.HostMissing, match=r"has no Headturn of this version.*press Set Up"):
        host.check_host(host.find_host(str(bare), None, {}))


def test_a_host_without_bpy_renders_with_the_blender_that_asks() -> None:
    found = host.Host(("headturn",), "PATH")
    facts = host.HostFacts("1", "3.12", None, "0.10", "21", None)
    assert host.host_command(found, facts, ["build"], "/b") == ["headturn", "build", "--blender", "/b"]
    given = ["build", "--blender", "/mine"]
    assert host.host_command(found, facts, given, "/b")[1:] == given
    assert host.host_command(found, facts, ["verify", "d"], "/b")[1:] == ["verify", "d"]
    deep = ["verify", "d", "--deep=5"]
    assert host.host_command(found, facts, deep, "/b")[1:] == [*deep, "--blender", "/b"]


def test_a_scene_of_a_newer_blender_is_rendered_with_that_one() -> None:
    found, older = host.Host(("headturn",), "PATH"), host.HostFacts("1", "3.11", "4.5.15", "0.10", "21", None)
    build = ["build", "a.toml"]
    for saved_by, more in {(4, 3): [], (4, 5): [], (5, 2): ["--blender", "/b"], None: []}.items():
        assert host.host_command(found, older, build, "/b", saved_by)[1:] == [*build, *more]
    server = host.host_command(found, older, ["preview-server"], "/b", (5, 2))
    assert server[1:] == ["preview-server", "--blender-of-scenes", "/b"]
    assert host.host_command(found, older, ["verify", "d"], "/b", (5, 2))[1:] == ["verify", "d"]


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


@pytest.mark.slow
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
    blenders = {"bpy", "bl_operators", "mathutils", "bpy_extras", "gpu", "gpu_extras"}
    allowed = {"numpy", *blenders, *sys.stdlib_module_names}
    with zipfile.ZipFile(extension_zip) as archive:
        names = set(archive.namelist())
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
        assert manifest["version"] == __version__ and "wheels" not in manifest
        assert {"__init__.py", "LICENSE.txt", "generator/blender/stage.py"} <= names
        for name in sorted(names):
            if not name.endswith(".py"):
                continue
            for node in ast.walk(ast.parse(archive.read(name))):
                if isinstance(node, ast.Import):
                    assert {a.name.split(".")[0] for a in node.names} <= allowed, name
                elif isinstance(node, ast.ImportFrom) and node.level == 0:
                    # scipy belongs to Sobol plans, which the host draws.
                    assert (node.module or "").split(".")[0] in allowed | {"scipy"}, (name, node.module)
