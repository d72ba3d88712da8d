# SPDX-License-Identifier: GPL-3.0-or-later
"""A module beside somebody's data is never imported: not by the commands, not by what they start."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from generator.interpreter import other_python_command, python_environment
from generator.registries import FORMATS

ROOT = Path(__file__).resolve().parents[1]

EVERYTHING = """
import contextlib, json, pkgutil, sys
from importlib import import_module
import downstream_hpe, generator
for package in (generator, downstream_hpe):
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        if not module.name.endswith("__main__"):
            import_module(module.name)
from generator.registries import DETECTORS, EXECUTORS
for registry in (DETECTORS, EXECUTORS):
    for name in registry:
        registry.get(name)
for name in ("ray", "mediapipe.python.solutions.face_mesh", "cv2", "OpenEXR", "trimesh", "embreex"):
    with contextlib.suppress(ImportError):
        import_module(name)
print(json.dumps(sorted(sys.modules)))
"""
"""Prints every module that a build or any other command loads."""

EXPORTS = """
import sys
from generator.cli import main
for form in sys.argv[1:]:
    sys.argv = ["headturn", "export", "d", "--format", form, "--out", form]
    try:
        main()
    except SystemExit as stopped:
        if stopped.code:
            raise
"""
"""One process for all formats: what one imports, it would import alone, too."""

OURS = ("generator", "downstream_hpe")


def plant(folder: Path, names: set[str]) -> Path:
    """Fill a folder with modules that leave a mark and break whoever imports them. Returns the mark."""
    folder.mkdir()
    mark = folder.parent / f"{folder.name}.imported"
    code = (
        f"open({str(mark)!r}, 'a').write(__name__ + '\\n')\nraise RuntimeError(__name__ + ' was imported')\n"
    )
    for name in names:
        (folder / f"{name}.py").write_text(code)
    return mark


def scripts(folder: Path) -> dict[str, list[str]]:
    """The commands as they are installed: a script of another folder."""
    folder.mkdir()
    for package, name in (("generator", "headturn"), ("downstream_hpe", "downstream-hpe")):
        (folder / name).write_text(f"import sys\nfrom {package}.cli import main\nsys.exit(main())\n")
    (folder / "exports").write_text(EXPORTS)
    return {name: [sys.executable, str(folder / name)] for name in ("headturn", "downstream-hpe", "exports")}


MODULES = {
    "headturn": [sys.executable, "-m", "generator.cli"],
    "downstream-hpe": [sys.executable, "-m", "downstream_hpe.cli"],
}


def run(command: list[str], cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"}
    done = subprocess.run(
        command,
        cwd=cwd,
        env={**kept, "PYTHONPATH": str(ROOT), **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=250,
    )
    assert "was imported" not in done.stderr, done.stderr
    return done


@pytest.mark.slow
@pytest.mark.parametrize("started", ["as scripts", "as modules"])
def test_the_commands_themselves(tmp_path: Path, started: str) -> None:
    names = {*sys.stdlib_module_names, "numpy", "pyarrow", "typer", "rich", "pydantic", "click", "bpy"}
    if started == "as modules" and sys.version_info < (3, 11):
        names -= {"runpy", "pkgutil"}  # looked for there by Python itself
    commands = scripts(tmp_path / "bin") if started == "as scripts" else MODULES
    mark = plant(tmp_path / "data", names | set(OURS if started == "as scripts" else ()))
    for command, arguments in (("headturn", "heads list ."), ("downstream-hpe", "export .")):
        done = run([*commands[command], *arguments.split()], tmp_path / "data")
        assert done.returncode == 2, done.stderr
        assert done.stderr.startswith(f"{command}: "), done.stderr
    assert not mark.exists(), mark.read_text()


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Modules that some command loads."""
    done = run([sys.executable, "-W", "ignore", "-c", EVERYTHING], tmp_path_factory.mktemp("empty"))
    found: list[str] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.slow
@pytest.mark.parametrize("started", ["as scripts", "as modules"])
def test_every_command_and_its_children(
    tmp_path: Path, parametric_heads: Path, loaded: list[str], started: str
) -> None:
    names = {name.partition(".")[0] for name in loaded} | set(sys.stdlib_module_names)
    assert {"bpy", "cv2", "mediapipe", "torch", "ray", "numpy", "json"} <= names
    data = tmp_path / "data"
    commands = scripts(tmp_path / "bin") if started == "as scripts" else MODULES
    mark = plant(data, names if started == "as scripts" else names - set(OURS))

    def command(line: str, name: str = "headturn") -> str:
        done = run([*commands[name], *line.split()], data)
        assert done.returncode == 0, f"{line}: {done.stdout}{done.stderr}"
        assert not mark.exists(), f"{line}: {mark.read_text()}"
        return done.stdout

    pose = "--yaw=0,20,20 --pitch=0,10,10 --roll=0,10,10 --resolution 96"
    command(f"heads list {parametric_heads}")
    head = next(path for path in sorted(parametric_heads.iterdir()) if path.is_dir())
    command(f"preview {head} --pose 0,0,0 --out preview.png")
    command(f"build --heads {parametric_heads} {pose} --out d --workers 2")
    command("verify d --workers 2")
    image = next((data / "d" / "images").rglob("*.png"))
    command(f"predict {image} --draw drawn.png", "downstream-hpe")
    if started == "as modules":
        return  # the rest is no other
    command("report d")
    command(" ".join(FORMATS), "exports")
    command("compact d --out merged")
    command(f"replay d {image.relative_to(data / 'd/images').with_suffix('').as_posix()}")
    command("environment")
    command("preview-server")
    command("evaluate headturn d", "downstream-hpe")
    command(f"build --heads {parametric_heads} {pose} --out r --executor ray --workers 1")


def oldest_python() -> list[str]:
    """Python 3.10, which has no -P, where the machine has it."""
    pyenv = sorted(Path.home().glob(".pyenv/versions/3.10.*/bin/python3.10"))
    for found in (shutil.which("python3.10"), *map(str, pyenv)):
        if found and subprocess.run([found, "-c", ""], capture_output=True).returncode == 0:
            return [found]
    return []


@pytest.mark.parametrize("python", [sys.executable, *oldest_python()])
@pytest.mark.parametrize("path", ["", ":", f"{ROOT}:", f".:{ROOT}", "data"])
def test_a_child_of_any_python_and_any_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, python: str, path: str
) -> None:
    data = tmp_path / "data"
    mark = plant(data, {*sys.stdlib_module_names, "sitecustomize"} - {"this"})
    monkeypatch.setenv("PYTHONPATH", path)
    command = other_python_command(python, "this")
    done = subprocess.run(command, cwd=data, env=python_environment(), capture_output=True, text=True)
    assert (done.returncode, mark.exists()) == (0, False), done.stderr
    assert "Beautiful is better than ugly" in done.stdout


def test_full_paths_of_the_user_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(["", "/a", ".", "b/c", "/d", ""]))
    assert python_environment()["PYTHONPATH"] == os.pathsep.join(["/a", "/d"])
    monkeypatch.setenv("PYTHONPATH", "")
    assert "PYTHONPATH" not in python_environment()


def test_python_is_started_in_one_place() -> None:
    # The second starts them with PYTHONSAFEPATH, and not where Python does not know that; the others look
    # for a Python to make an environment of, and ask each in isolated mode.
    allowed = {
        "generator/interpreter.py",
        "downstream_hpe/prediction/workers.py",
        "blender_addon/setting_up.py",
        "blender_addon/core/pythons.py",
    }
    starts = re.compile(
        r"sys\.executable|^\s*(import|from) multiprocessing|ProcessPoolExecutor", re.MULTILINE
    )
    for package in ("generator", "blender_addon", "downstream_hpe", "litert_faces"):
        for path in ROOT.glob(f"{package}/**/*.py"):
            if path.relative_to(ROOT).as_posix() not in allowed:
                assert not starts.search(path.read_text(encoding="utf-8")), (
                    f"{path}: use generator.interpreter"
                )


def test_an_empty_entry_of_the_users_path_counts_no_more(tmp_path: Path) -> None:
    """Python itself has looked there while it started; from then on nobody does."""
    mark = plant(tmp_path / "data", {"numpy", "pyarrow", "typer", "rich"})
    done = run([*MODULES["headturn"], "heads", "list", "."], tmp_path / "data", PYTHONPATH=f":{ROOT}:.")
    assert done.returncode == 2 and not mark.exists(), done.stderr


@pytest.mark.skipif(sys.version_info < (3, 11), reason="--workers needs Python 3.11")
def test_processes_that_look_at_pictures_take_nothing_from_there(tmp_path: Path) -> None:
    """multiprocessing starts them with `python -c`, which looks there first."""
    pytest.importorskip("mediapipe")
    data = tmp_path / "data"
    mark = plant(data, {"numpy", "PIL", "random", "multiprocessing", "cv2"})
    for name in "ab":
        Image.new("RGB", (64, 64)).save(data / f"{name}.png")
    done = run([*MODULES["downstream-hpe"], "predict", ".", "--workers", "2"], data)
    assert not mark.exists(), mark.read_text()
    assert "a.png: no face found" in done.stdout, done.stderr
