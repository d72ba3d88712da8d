# SPDX-License-Identifier: GPL-3.0-or-later
"""What make dist writes: the same bytes twice, two distributions that share no file, each at work on its own.

An environment here is as empty as pip's would be: it has a wheel, and of the packages around the tests those
alone that the wheel asks for, as links.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import tarfile
import venv
from importlib.metadata import distribution
from itertools import chain
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import pytest
import tomllib
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts"))

pytestmark = pytest.mark.slow
pytest.importorskip("cyclonedx", reason="cyclonedx-python-lib is not installed: make test installs it")

import make_dist  # noqa: E402
import sbom  # noqa: E402

VERSION = make_dist.version()


@pytest.fixture(scope="module")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """make dist, into a folder."""
    return built(tmp_path_factory.mktemp("dist"))


def built(folder: Path, **environment: str) -> Path:
    """With a date of its own: a checkout need not be git's."""
    command = [sys.executable, ROOT / "scripts" / "make_dist.py", "--out", folder]
    dated = os.environ | {"SOURCE_DATE_EPOCH": "1764200000"} | environment
    done = subprocess.run(command, env=dated, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def wheel_of(dist: Path, name: str) -> Path:
    return dist / f"{name.replace('-', '_')}-{VERSION}-py3-none-any.whl"


def contents(dist: Path, name: str) -> dict[str, bytes]:
    """Of wheel and sdist, by path in them."""
    with ZipFile(wheel_of(dist, name)) as wheel:
        found = {f"wheel/{path}": wheel.read(path) for path in wheel.namelist()}
    with tarfile.open(dist / f"{name.replace('-', '_')}-{VERSION}.tar.gz") as sdist:
        for member in sdist.getmembers():
            if (file := sdist.extractfile(member)) is not None:
                found[f"sdist/{member.name.partition('/')[2]}"] = file.read()
    return found


def test_the_same_commit_gives_the_same_bytes(dist: Path, tmp_path: Path) -> None:
    """At another time of day, in another place, for another user."""
    again = built(tmp_path, TZ="Asia/Tokyo", LC_ALL="C", USER="nobody", PYTHONHASHSEED="7")
    names = [path.name for path in sorted(dist.iterdir())]
    assert names == [path.name for path in sorted(again.iterdir())] and len(names) == 8
    differ = [name for name in names if (dist / name).read_bytes() != (again / name).read_bytes()]
    assert not differ


def test_the_sums_are_those_of_the_files(dist: Path) -> None:
    lines = (dist / "SHA256SUMS").read_text().splitlines()
    said = {name: digest for digest, name in (line.split("  ") for line in lines)}
    found = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in dist.iterdir()}
    found.pop("SHA256SUMS")
    assert said == found


def test_no_file_of_the_one_is_in_the_other_and_none_of_the_mit_one_is_gpl(dist: Path) -> None:
    mit, gpl = contents(dist, "downstream-hpe"), contents(dist, "headturn")
    shared = {path for path in mit.keys() & gpl.keys() if path.startswith("wheel/")}
    assert not shared
    assert not [path for path in mit if "generator" in path or "GPL" in path]
    assert not [path for path, content in mit.items() if b"SPDX-License-Identifier: GPL" in content]
    assert {path for path in mit if path.endswith("MIT.txt")} >= {"sdist/LICENSES/MIT.txt"}
    for path, content in gpl.items():
        if path.endswith(".py") and path.startswith("wheel/"):
            assert b"SPDX-License-Identifier: GPL-3.0-or-later" in content, path


def test_what_is_in_the_checkout_is_in_a_wheel(dist: Path) -> None:
    for name, packages in make_dist.PACKAGES.items():
        there = {path.removeprefix("wheel/") for path in contents(dist, name) if path.startswith("wheel/")}
        for package in packages:
            files = [path for path in (ROOT / package).rglob("*") if path.is_file()]
            wanted = {str(path.relative_to(ROOT)) for path in files if "__pycache__" not in path.parts}
            assert not wanted - there


def test_a_bill_of_materials_names_what_is_installed_and_its_hashes(dist: Path) -> None:
    for name, some in (
        ("downstream-hpe", {"numpy", "onnxruntime", "scipy"}),
        ("headturn", {"downstream-hpe"}),
    ):
        bom = json.loads((dist / f"{name}-{VERSION}.cdx.json").read_text())
        about = bom["metadata"]["component"]
        digest = hashlib.sha256(wheel_of(dist, name).read_bytes()).hexdigest()
        assert (about["name"], about["version"]) == (name, VERSION)
        assert about["hashes"] == [{"alg": "SHA-256", "content": digest}]
        parts = {part["name"]: part for part in bom["components"]}
        assert all(len(part["hashes"]) == 1 for part in parts.values())
        required = {one for one, part in parts.items() if part.get("scope") == "required"}
        assert some <= required and "mediapipe" in parts.keys() - required
        assert not required & {"torch", "bpy", "anny"}
    assert "generator/heads/parametric/real_shape.npz" in parts


def test_both_ask_for_the_same_versions() -> None:
    whole, mit = (
        tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        for folder in (ROOT, ROOT / "packages" / "downstream_hpe")
    )
    assert whole["requires-python"] == mit["requires-python"] and whole["dynamic"] == mit["dynamic"]

    def asked(project: dict[str, Any]) -> set[str]:
        texts = [*project["dependencies"], *chain(*project["optional-dependencies"].values())]
        return {str(Requirement(text)) for text in texts}

    assert asked(mit) <= asked(whole)
    shared = mit["optional-dependencies"].keys() & whole["optional-dependencies"].keys()
    assert shared == mit["optional-dependencies"].keys() - {"tables"}
    for extra in shared:
        ours, theirs = (
            {Requirement(text).name for text in one["optional-dependencies"][extra]} for one in (mit, whole)
        )
        # What is always there in the one is in an extra of the other.
        assert ours - theirs <= {"pyarrow", "matplotlib"}
        assert theirs - ours <= {"pyarrow", "onnxruntime"}


# ---- at work ------------------------------------------------------------


def environment(folder: Path, wheels: list[Path], extra: str, alone: tuple[str, ...] = ()) -> Path:
    """The scripts' folder of a new environment with these wheels, what they ask for, and files of alone."""
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    pip = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        python,
        "--disable-pip-version-check",
        "install",
        "--quiet",
    ]
    subprocess.run([*pip, "--no-index", "--no-deps", *wheels], env=clean(), check=True)
    [site] = (folder / "lib").glob("python*/site-packages")
    wanted = [one for wheel in wheels for one in sbom.required(wheel)]
    ours = {wheel.name.partition("-")[0].replace("_", "-") for wheel in wheels}
    for name in sorted(sbom.closure(wanted, extra) - ours) + list(alone):
        package = distribution(name)
        places = {path.parts[0] for path in package.files or () if path.parts[0] not in ("..", "__pycache__")}
        for place in places:
            if not (site / place).exists():
                (site / place).symlink_to(Path(str(package.locate_file(place))).resolve())
    return folder / "bin"


def clean() -> dict[str, str]:
    """The environment without the path to the checkout, where pip would find all of it installed."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}


def said(command: list[object], folder: Path, code: int = 0) -> str:
    """What a command prints in a folder that is no checkout."""
    done = subprocess.run(
        list(map(str, command)),
        cwd=folder,
        env=clean(),
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert done.returncode == code, done.stderr + done.stdout
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """NASA's portrait of Eileen Collins, in the public domain."""
    from PIL import Image

    path = tmp_path_factory.mktemp("photo") / "photo.png"
    Image.fromarray(pytest.importorskip("skimage.data").astronaut()).save(path)
    return path


def test_downstream_hpe_alone_reads_a_picture(dist: Path, photo: Path, tmp_path: Path) -> None:
    pytest.importorskip("mediapipe")
    programs = environment(tmp_path / "env", [wheel_of(dist, "downstream-hpe")], "pose")
    assert said([programs / "downstream-hpe", "--version"], tmp_path) == f"downstream-hpe {VERSION}\n"
    command = [programs / "downstream-hpe", "predict", photo, "--draw", tmp_path / "drawn.png", "--json"]
    [line] = [line for line in said(command, tmp_path).splitlines() if line.startswith("{")]
    row = json.loads(line)
    assert row["found"] and row["confidence"] > 0.3 and abs(row["yaw_deg"]) < 20
    assert (tmp_path / "drawn.png").stat().st_size > 10_000
    # Tables are another extra, and the generator is not there.
    lines = said([programs / "downstream-hpe", "evaluate", "headturn", tmp_path], tmp_path, code=1)
    assert "is not installed: pip install 'downstream-hpe[tables]" in lines
    assert "ModuleNotFoundError" in said([programs / "python", "-c", "import generator"], tmp_path, code=1)


def test_without_any_extra_landmarks_have_a_pose(dist: Path, tmp_path: Path) -> None:
    programs = environment(tmp_path / "env", [wheel_of(dist, "downstream-hpe")], "")
    program = (
        "from downstream_hpe import Predictor; from downstream_hpe.geometry.mean_head import mean_head; "
        "print(Predictor().from_landmarks(mean_head()[None]))"
    )
    assert said([programs / "python", "-c", program], tmp_path).startswith("Pose(1 face: yaw ")
    missing = "from litert_faces.network import Network; Network(b'', 'x')"
    lines = said([programs / "python", "-c", missing], tmp_path, code=1)
    assert "LiteRT cannot be loaded" in lines and "pip install 'downstream-hpe[litert]" in lines


@pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("bpy", "mediapipe", "anny"))), reason="needs what a build needs"
)
def test_headturn_builds_a_dataset(dist: Path, tmp_path: Path) -> None:
    wheels = [wheel_of(dist, name) for name in make_dist.PACKAGES]
    programs = environment(tmp_path / "env", wheels, "build", alone=("anny",))
    few = ["--yaw=0,20,20", "--pitch=0,0,1", "--roll=0,0,1", "--resolution", "128"]
    said([programs / "headturn", "build", "--count", "1", *few, "--out", tmp_path / "d"], tmp_path)
    assert "ok" in said([programs / "headturn", "verify", tmp_path / "d"], tmp_path).lower()
    assert re.fullmatch(r"headturn \S+\n", said([programs / "headturn", "--version"], tmp_path))


RIGHT = """
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from downstream_hpe import Camera, Pose, Predictor, __version__, draw


def drawn(files: list[Path]) -> list[Image.Image]:
    with Predictor(detector="litert") as predictor:
        poses: list[Pose | None] = [predictor.predict(file, faces=2) for file in files]
    return [draw(file, pose) for file, pose in zip(files, poses)]


def yaw(picture: npt.NDArray[np.uint8], camera: Camera) -> float:
    pose = Predictor("headturn").predict(picture, camera=camera)
    return float("nan") if pose is None else float(pose.ypr_deg[0, 0])


print("downstream_hpe " + __version__, len(drawn([Path("photo.jpg")])))
"""
WRONG = """
from downstream_hpe import Predictor, nothing
pose = Predictor().predict(None)
print(pose.ypr_deg)
yaw: str = Predictor().in_range
"""


def test_types_of_a_program_that_uses_the_installed_package(dist: Path, tmp_path: Path) -> None:
    """mypy over lines that are right and four that are not."""
    programs = environment(tmp_path / "env", [wheel_of(dist, "downstream-hpe")], "")
    (tmp_path / "right.py").write_text(RIGHT)
    (tmp_path / "wrong.py").write_text(WRONG)
    command = [sys.executable, "-m", "mypy", "--strict", "--python-executable", programs / "python"]
    lines = said([*command, "right.py", "wrong.py"], tmp_path, code=1).splitlines()
    errors = [line.partition(" error: ")[0] for line in lines if ": error: " in line]
    assert errors == [f"wrong.py:{n}:" for n in (2, 3, 4, 5)], lines
