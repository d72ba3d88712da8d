# SPDX-License-Identifier: GPL-3.0-or-later
"""Whoever reads, proves, shows or exports a dataset needs neither renderer, ray tracer nor detector."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
HEAVY = ("cv2", "embreex", "trimesh", "mediapipe", "bpy", "OpenEXR", "torch")

SCRIPT = """
import importlib, sys
blocked, modules, registries = (argument.split(",") for argument in sys.argv[1:])
class Block:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in blocked:
            raise ImportError(f"{name} is not to be imported here")
sys.meta_path.insert(0, Block())
for module in modules:
    importlib.import_module(module)
import generator.registries
for name in filter(None, registries):
    registry = getattr(generator.registries, name)
    for entry in registry:
        registry.get(entry)
from generator.landmarks.topology import FACE_MESH
FACE_MESH.mirror_pairs()
"""


def run(modules: list[str], blocked: tuple[str, ...], registries: str) -> subprocess.CompletedProcess[str]:
    """Import modules, and everything in some registries, in a process that cannot import the blocked ones."""
    return subprocess.run(
        [sys.executable, "-c", SCRIPT, ",".join(blocked), ",".join(modules), registries],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )


@pytest.mark.slow
def test_no_module_of_the_dataset_needs_a_renderer_or_a_detector() -> None:
    files = sorted((ROOT / "generator" / "dataset").rglob("*.py"))
    modules = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in files]
    assert len(modules) > 40
    names = [name.removesuffix(".__init__") for name in modules]
    done = run(names, HEAVY, "FORMATS,PASSES,TOPOLOGIES")
    assert done.returncode == 0, done.stderr


def test_the_topology_needs_numpy_alone() -> None:
    others = ("scipy", "PIL", "matplotlib", "pyarrow", "pydantic")
    done = run(["generator.landmarks.topology"], (*HEAVY, *others), "TOPOLOGIES")
    assert done.returncode == 0, done.stderr


def test_the_block_blocks() -> None:
    done = run(["generator.execution.lanes.lane"], HEAVY, "")
    assert done.returncode == 1 and "is not to be imported here" in done.stderr
