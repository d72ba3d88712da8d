# SPDX-License-Identifier: MIT
"""The rooms of downstream_hpe: who may import whom, and that the face mesh is described once."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import downstream_hpe

PACKAGE = Path(downstream_hpe.__file__).parent
MODULES = sorted(PACKAGE.rglob("*.py"))

# Each room, and each module at the top, may import itself and what stands in its row.
COMMON = {"errors", "escape", "geometry", "reading", "writing"}
LEARNED = {"prediction", "manifold", "tables", "model_file", *COMMON}
MAY_IMPORT = {
    "errors": set(),
    "escape": set(),
    "geometry": set(),
    "reading": set(),
    "release": set(),
    "writing": {"errors"},
    "model_file": {"errors", "reading"},
    "tables": COMMON,
    "manifold": {"model_file", *COMMON},
    "prediction": {"release", *COMMON},
    "demo": {"prediction", *COMMON},
    "networks": LEARNED,
    "evaluation": LEARNED,
    "fitting": {"evaluation", "networks", *LEARNED},
    "cli": {"demo", "fitting", "evaluation", "networks", "release", *LEARNED},
    "predictor": {"prediction"},
}
TORCH = {"torch", "onnx"}
WITH_TORCH = {
    "graph",
    "checkpoint",
    "export",
    "pose_images",
    "pose_network",
    "recipe",
    "samples",
    "training",
    "weights",
    "rigid_fit",
}
"""Modules of networks that need torch when they are imported."""


def imported(tree: ast.AST) -> set[str]:
    """Every module that is imported below a node."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def identifier(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def test_every_room_has_its_row() -> None:
    rooms = {path.relative_to(PACKAGE).parts[0].removesuffix(".py") for path in MODULES}
    assert rooms - {"__init__"} == set(MAY_IMPORT)


@pytest.mark.parametrize("path", MODULES, ids=identifier)
def test_dependence_points_one_way(path: Path) -> None:
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    assert path.read_text(encoding="utf-8").count("\n") < 300, "split it"
    if room == "__init__":
        return
    names = {tuple(name.split(".")) for name in imported(parsed(path))}
    used = {parts[1] for parts in names if parts[0] == "downstream_hpe" and len(parts) > 1}
    assert used & set(MAY_IMPORT) <= MAY_IMPORT[room] | {room}


@pytest.mark.parametrize("path", MODULES, ids=identifier)
def test_torch_is_asked_for_in_networks_alone(path: Path) -> None:
    """At import; a function may need it when it is called."""
    if path.parent.name == "networks" and path.stem in WITH_TORCH:
        return
    outside = [n for n in parsed(path).body if isinstance(n, ast.Import | ast.ImportFrom)]
    names = set().union(*map(imported, outside), set())
    theirs = {f"downstream_hpe.networks.{module}" for module in WITH_TORCH}
    assert not {name.split(".")[0] for name in names} & TORCH
    assert not names & theirs


@pytest.mark.parametrize("path", MODULES, ids=identifier)
def test_the_face_mesh_is_described_once(path: Path) -> None:
    """How many points, and how many numbers, follows from geometry/face_mesh.py."""
    if path.name == "face_mesh.py":
        return
    numbers = {node.value for node in ast.walk(parsed(path)) if isinstance(node, ast.Constant)}
    assert not numbers & {468, 3 * 468, "mediapipe-face-mesh-468"}


HEAVY = ("numpy", "importlib.metadata", "pyarrow", "torch", "onnxruntime", "mediapipe", "typer", "generator")


def test_the_package_gives_its_names_without_importing_what_they_need() -> None:
    program = (
        "import sys, downstream_hpe\n"
        f"print(*[name for name in {HEAVY} if name in sys.modules])\n"
        "from downstream_hpe import Predictor\n"
        "from downstream_hpe.predictor import Predictor as documented\n"
        "print(Predictor is documented, *{'torch', 'onnxruntime', 'scipy', 'mediapipe'} & {*sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=PACKAGE.parent, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.splitlines() == ["", "True"], done.stderr
    for name in {*downstream_hpe.__all__} - {"__version__"}:
        assert getattr(downstream_hpe, name).__module__.startswith("downstream_hpe.")
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = downstream_hpe.nothing
