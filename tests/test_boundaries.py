# SPDX-License-Identifier: GPL-3.0-or-later
"""The layout's promises: who may import whom, licences, module size."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("generator", "downstream_hpe", "litert_faces")
MODULES = sorted(path for package in PACKAGES for path in ROOT.glob(f"{package}/**/*.py"))

# Each layer may import itself and the layers after it in its own row.
MAY_IMPORT = {
    "geometry": set(),
    "plan": {"geometry"},
    "heads": {"geometry"},
    "blender": {"plan", "heads", "geometry"},
    "picture": {"plan", "geometry"},
    "landmarks": {"plan", "heads", "geometry"},
    "dataset": {"landmarks", "plan", "heads", "geometry"},
    "placing": {"landmarks", "plan", "heads", "geometry"},
    "worn": {"landmarks", "plan", "heads", "geometry"},
}
MAY_IMPORT["execution"] = {*MAY_IMPORT}
MAY_IMPORT["cli"] = {*MAY_IMPORT}


def imports(path: Path) -> set[str]:
    """Every module a file imports, also inside functions."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or ""} | {f"{node.module}.{alias.name}" for alias in node.names}
    return found


def identifier(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", MODULES, ids=identifier)
def test_module(path: Path) -> None:
    parts = path.relative_to(ROOT).parts
    tops = {name.split(".")[0] for name in imports(path)}
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 350, "split it"
    if parts[0] == "litert_faces":
        assert text.startswith("# SPDX-License-Identifier: MIT\n")
        assert not tops & {"generator", "downstream_hpe", "bpy", "mediapipe"}
        return
    if parts[0] == "downstream_hpe":
        assert text.startswith("# SPDX-License-Identifier: MIT\n")
        assert not tops & {"generator", "bpy"}
        return
    assert text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n")
    assert "downstream_hpe" not in tops
    layer = parts[1] if len(parts) > 2 else None
    if layer != "blender":
        assert not tops & {"bpy", "bpy_extras", "mathutils"}, "only generator/blender may import bpy"
    if layer is not None:
        used = {n.split(".")[1] for n in imports(path) if n.startswith("generator.") and "." in n}
        assert used & set(MAY_IMPORT) <= MAY_IMPORT[layer] | {layer}


def test_the_render_worker_needs_numpy_and_the_standard_library_alone() -> None:
    """Whatever the worker imports, directly or not, runs inside any Blender."""
    allowed = {"numpy", "bpy", "bpy_extras", "mathutils", "generator", *sys.stdlib_module_names}
    seen, todo = set(), ["generator.blender.worker"]
    while todo:
        name = todo.pop()
        path = ROOT / (name.replace(".", "/") + ".py")
        package = ROOT / name.replace(".", "/") / "__init__.py"
        for file in (path, package):
            if file in seen or not file.exists():
                continue
            seen.add(file)
            for module in imports(file):
                assert module.split(".")[0] in allowed, f"{file} imports {module}"
                pieces = module.split(".")
                todo += [".".join(pieces[: k + 1]) for k in range(len(pieces)) if pieces[0] == "generator"]
    assert len(seen) > 8


@pytest.mark.slow
def test_quick_tests_are_collected_without_blender_detector_and_torch() -> None:
    code = (
        "import sys\n"
        "for name in ('bpy', 'mathutils', 'mediapipe', 'torch', 'ray'): sys.modules[name] = None\n"
        "import pytest\n"
        "sys.exit(pytest.main(['--collect-only', '-q', '-m', 'not slow']))"
    )
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout[-3000:]
