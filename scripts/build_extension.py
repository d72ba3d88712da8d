# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the Blender extension: blender_addon/ and the parts of generator/ it uses, in one zip.

    python scripts/build_extension.py [--out dist]

Needs no Blender, and beside the standard library pip and the setuptools of pyproject.toml. The generator's
modules go in as a private package of the extension, with their imports made relative, so that one code base
serves both and nothing is added to Blender's module path. The wheel of this release goes in as a file, which
Set Up installs outside of Blender. The same sources give the same bytes.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ADDON = ROOT / "blender_addon"
REGISTRIES = "generator/registries.py"
FOLLOWED = ("DRAWS",)
"""Registries whose entries the extension uses; it knows the names alone of those in the others."""

_IMPORT = re.compile(r"^(\s*)from generator(\.[\w.]+)? import ", re.MULTILINE)
PACKED = ("generator", "downstream_hpe", "litert_faces", "LICENSES", "README.md", "pyproject.toml")
"""What the wheel is made of."""

_DATE = (2020, 1, 1, 0, 0, 0)
_SKIPPED = ("README.md",)


def generator_version() -> str:
    """The version of the checkout."""
    text = (ROOT / "generator" / "__init__.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__ = "([^"]+)"', text, re.MULTILINE)
    if found is None:
        sys.exit("build_extension.py: generator/__init__.py names no __version__")
    return found[1]


def extension_files() -> dict[str, bytes]:
    """Path in the zip -> content."""
    sources = {p.relative_to(ADDON).as_posix(): p for p in sorted(ADDON.rglob("*.py"))}
    todo = [module for path in sources.values() for module in _generator_modules(path)]
    while todo:
        module = todo.pop()
        base = ROOT / module.replace(".", "/")
        path = base / "__init__.py" if base.is_dir() else base.with_suffix(".py")
        name = path.relative_to(ROOT).as_posix()
        if name not in sources:
            sources[name] = path
            todo += _generator_modules(path)
            todo += _registered_modules(path) if name == REGISTRIES else []
    files = {name: _relative(name, path).encode() for name, path in sources.items()}
    for path in sorted(p for p in ADDON.iterdir() if p.suffix in (".toml", ".md") and p.name not in _SKIPPED):
        files[path.name] = path.read_bytes()
    manifest = files["blender_manifest.toml"].decode()
    files["blender_manifest.toml"] = re.sub(
        r"^version = .*$", f'version = "{generator_version()}"', manifest, flags=re.MULTILINE
    ).encode()
    files["LICENSE.txt"] = (ROOT / "LICENSES" / "GPL-3.0-or-later.txt").read_bytes()
    return dict(sorted(files.items()))


def wheel() -> tuple[str, bytes]:
    """Name and content of the wheel of the checkout.

    Made of a copy: what an earlier build left beside the sources would go in. Its date and modes are those of
    the files, so it is packed anew.
    """
    with tempfile.TemporaryDirectory() as work:
        for name in PACKED:
            path, copy = ROOT / name, Path(work, "tree", name)
            if path.is_dir():
                shutil.copytree(path, copy, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                copy.parent.mkdir(exist_ok=True)
                shutil.copy(path, copy)
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "-q"]
        made = [*pip, "--no-deps", "--no-build-isolation", "--wheel-dir", work, str(Path(work, "tree"))]
        if subprocess.run(made, check=False).returncode:
            sys.exit("build_extension.py: no wheel; it needs pip and setuptools: make extension brings them")
        [path] = Path(work).glob("*.whl")
        with zipfile.ZipFile(path) as archive:
            return path.name, packed({name: archive.read(name) for name in archive.namelist()})


def packed(files: dict[str, bytes]) -> bytes:
    """A zip that depends on names and contents alone."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name, _DATE), content, zipfile.ZIP_DEFLATED)
    return out.getvalue()


def write_extension(folder: Path, *, with_wheel: bool = True) -> Path:
    """Write headturn-<version>.zip into folder."""
    folder.mkdir(parents=True, exist_ok=True)
    target = folder / f"headturn-{generator_version()}.zip"
    target.write_bytes(packed({**extension_files(), **dict([wheel()] if with_wheel else [])}))
    return target


def _registered_modules(path: Path) -> list[str]:
    """Modules of the generator that the followed registries name as "module:attribute"."""
    found = []
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.AnnAssign) and getattr(node.target, "id", "") in FOLLOWED:
            texts = [
                n.value for n in ast.walk(node) if isinstance(n, ast.Constant) and isinstance(n.value, str)
            ]
            found += [text.partition(":")[0] for text in texts if text.startswith("generator.")]
    return found


def _generator_modules(path: Path) -> list[str]:
    """Modules of the generator that a file imports, with the packages they lie in."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if (
            isinstance(node, ast.ImportFrom)
            and node.level == 0
            and (node.module or "").startswith("generator")
        ):
            names += [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
    found = []
    for name in names:
        base = ROOT / name.replace(".", "/")
        if base.is_dir() or base.with_suffix(".py").is_file():
            parts = name.split(".")
            found += [".".join(parts[: k + 1]) for k in range(len(parts))]
    return found


def _relative(name: str, path: Path) -> str:
    dots = "." * len(Path(name).parts)
    return _IMPORT.sub(rf"\1from {dots}generator\2 import ", path.read_text(encoding="utf-8"))


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Write the Blender extension.")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder of the zip")
    parser.add_argument("--without-wheel", action="store_true", help="Set Up will not work")
    given = parser.parse_args()
    print(write_extension(given.out, with_wheel=not given.without_wheel))


if __name__ == "__main__":
    main()
