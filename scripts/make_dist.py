#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes everything a release consists of (make dist), the same bytes from the same commit.

    python scripts/make_dist.py [--out dist]

- downstream_hpe-VERSION.tar.gz and -py3-none-any.whl: the MIT half, of packages/downstream_hpe/pyproject.toml
- headturn-VERSION.tar.gz and -py3-none-any.whl: the generator, which depends on the former
- headturn-VERSION.zip: the Blender extension, of scripts/build_extension.py
- a CycloneDX .cdx.json for either distribution (scripts/sbom.py), and SHA256SUMS

The version is generator.__version__, the date SOURCE_DATE_EPOCH, else that of the last commit. Why these are
two distributions, and a checkout is one: docs/decisions.md.
"""

from __future__ import annotations

import argparse
import gzip
import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import lock
import tomli_w
import tomllib
from sbom import write_bom

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = {"downstream-hpe": ("downstream_hpe", "litert_faces"), "headturn": ("generator",)}
"""What each distribution holds."""
LICENCES = {"downstream-hpe": "MIT.txt", "headturn": "GPL-3.0-or-later.txt"}
OF_THE_CHECKOUT = ("dev", "fuzz")
"""Extras that are for whoever works on the code."""
BUILD = """
import sys
from setuptools import build_meta  # which changes sys.argv

folder = sys.argv[1]
build_meta.build_sdist(folder)
build_meta.build_wheel(folder)
"""


def version() -> str:
    """The one place where it stands."""
    text = (ROOT / "generator" / "__init__.py").read_text(encoding="utf-8")
    return text.partition('__version__ = "')[2].partition('"')[0]


def epoch() -> int:
    """Seconds since 1970 that files are dated with."""
    if "SOURCE_DATE_EPOCH" in os.environ:
        return int(os.environ["SOURCE_DATE_EPOCH"])
    asked = ["git", "-C", str(ROOT), "log", "-1", "--format=%ct"]
    found = subprocess.run(asked, capture_output=True, text=True, check=False)
    if found.returncode:
        sys.exit("make_dist.py: this is no git checkout; set SOURCE_DATE_EPOCH to the date of the release")
    return int(found.stdout)


def headturn_project() -> dict[str, Any]:
    """pyproject.toml of the checkout, without what downstream-hpe brings along."""
    whole: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, tools = whole["project"], whole["tool"]["setuptools"]
    project["dependencies"].append(f"downstream-hpe=={version()}")
    project["license"] = "GPL-3.0-or-later"
    del project["scripts"]["downstream-hpe"]
    for extra in OF_THE_CHECKOUT:
        del project["optional-dependencies"][extra]
    tools["packages"]["find"]["include"] = ["generator*"]
    own = {name: files for name, files in tools["package-data"].items() if name.startswith("generator")}
    tools["package-data"] = own
    return {"build-system": whole["build-system"], "project": project, "tool": {"setuptools": tools}}


def make_tree(name: str, folder: Path) -> None:
    """The sources of a distribution in an empty folder, ready to build."""
    for package in PACKAGES[name]:
        shutil.copytree(ROOT / package, folder / package, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "LICENSES").mkdir()
    shutil.copy(ROOT / "LICENSES" / LICENCES[name], folder / "LICENSES")
    if name == "headturn":
        shutil.copy(ROOT / "README.md", folder)
        (folder / "pyproject.toml").write_bytes(tomli_w.dumps(headturn_project()).encode())
    else:
        shutil.copytree(ROOT / "packages" / "downstream_hpe", folder, dirs_exist_ok=True)
        (folder / "VERSION").write_text(version() + "\n", encoding="utf-8")
    for path in folder.rglob("*"):
        path.chmod(0o755 if path.is_dir() else 0o644)


def build(name: str, out: Path, seconds: int) -> list[Path]:
    """An sdist and a wheel."""
    with tempfile.TemporaryDirectory() as folder:
        tree, built = Path(folder, "tree"), Path(folder, "built")
        tree.mkdir()
        built.mkdir()
        make_tree(name, tree)
        # Not the current environment's checkout, nor what a user's setup.cfg adds.
        clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        clean |= {"SOURCE_DATE_EPOCH": str(seconds), "HOME": folder, "PYTHONHASHSEED": "0"}
        command = [sys.executable, "-c", BUILD, str(built)]
        done = subprocess.run(command, cwd=tree, env=clean, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"make_dist.py: {name} cannot be built:\n{done.stdout}{done.stderr}")
        [sdist], [wheel] = built.glob("*.tar.gz"), built.glob("*.whl")
        (out / sdist.name).write_bytes(dated(sdist.read_bytes(), seconds))
        shutil.copyfile(wheel, out / wheel.name)
    return [out / sdist.name, out / wheel.name]


def dated(sdist: bytes, seconds: int) -> bytes:
    """The same archive as anybody would have made it: setuptools writes its own time and the user's name."""
    tar = io.BytesIO()
    with (
        tarfile.open(fileobj=io.BytesIO(sdist)) as old,
        tarfile.open(fileobj=tar, mode="w", format=tarfile.PAX_FORMAT) as new,
    ):
        for member in sorted(old.getmembers(), key=lambda one: one.name):
            clean = tarfile.TarInfo(member.name)
            clean.type, clean.size, clean.mtime = member.type, member.size, seconds
            clean.mode = 0o755 if member.isdir() else 0o644
            new.addfile(clean, old.extractfile(member))
    return gzip.compress(tar.getvalue(), mtime=seconds)


def write_sums(out: Path) -> Path:
    """SHA256SUMS of everything else in the folder, as ``sha256sum --check`` reads it."""
    files = sorted(path for path in out.iterdir() if path.name != "SHA256SUMS")
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
    (out / "SHA256SUMS").write_text("".join(lines), encoding="utf-8")
    return out / "SHA256SUMS"


def make_dist(out: Path) -> list[Path]:
    """Everything into an existing folder."""
    seconds, made = epoch(), []
    ours: lock.Pins = {}
    for name in PACKAGES:  # what others depend on comes first
        sdist, wheel = build(name, out, seconds)
        ours[name] = (version(), hashlib.sha256(wheel.read_bytes()).hexdigest())
        made += [sdist, wheel, write_bom(wheel, name, ours, seconds, out)]
    extension = [sys.executable, ROOT / "scripts" / "build_extension.py", "--out", out]
    done = subprocess.run(extension, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"make_dist.py: the extension cannot be built:\n{done.stdout}{done.stderr}")
    made += sorted(out.glob("headturn-*.zip"))
    return [*made, write_sums(out)]


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="a folder that is empty or new")
    out = parser.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    if any(out.iterdir()):
        sys.exit(f"make_dist.py: {out} holds something already; expected an empty folder")
    for path in make_dist(out):
        print(f"{path.stat().st_size:>9,}  {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
