# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's promises: what it imports, in which direction, and that its core knows no Blender."""

from __future__ import annotations

import ast
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ADDON = ROOT / "blender_addon"
PACKAGE = ADDON.name
FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(ADDON.rglob("*.py"))
}
BLENDERS = {"bpy", "bl_operators", "mathutils", "bpy_extras", "gpu", "gpu_extras"}
STARTED = {"numpy", "generator.blender", "generator.heads", "generator.geometry", "generator.plan.poses"}
"""What Blender's start must not wait for."""


def imports(name: str, *, also_in_functions: bool = True) -> set[str]:
    """The modules that a module of the add-on imports, by their full names; for types alone, too."""
    path = FILES[name]
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = set()
    for node in ast.walk(tree) if also_in_functions else _at_start(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                start = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*start, *([base] if base else [])])
            modules = {f"{base}.{alias.name}" for alias in node.names} & {*FILES}
            found |= modules or {base}
    return found


def _at_start(tree: ast.Module) -> list[ast.stmt]:
    """Statements that run when the module is imported."""
    return [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]


@pytest.mark.parametrize("name", FILES)
def test_a_module_imports_what_blender_has(name: str) -> None:
    tops = {module.split(".")[0] for module in imports(name)}
    core = name.startswith(f"{PACKAGE}.core")
    allowed = {"numpy", "generator", PACKAGE, *sys.stdlib_module_names} | (set() if core else BLENDERS)
    assert tops <= allowed, tops - allowed
    text = FILES[name].read_text(encoding="utf-8")
    assert text.startswith("# SPDX-License-Identifier: GPL-3.0-or-later\n")
    assert text.count("\n") <= 300, "split it"


def test_imports_go_one_way() -> None:
    """Also those in functions, and those for types alone."""
    graph = {name: {module for module in imports(name) if module in FILES} - {name} for name in FILES}
    assert sum(map(len, graph.values())) > 60
    order = list(TopologicalSorter(graph).static_order())  # CycleError names a circle
    assert order[-1] in (PACKAGE, f"{PACKAGE}.headless")
    for name in graph:
        if name.startswith(f"{PACKAGE}.core"):
            assert all(module.startswith(f"{PACKAGE}.core") for module in graph[name]), name


def test_start_up_imports_nothing_heavy() -> None:
    """What stands in functions waits for the first click."""
    seen, todo = set(), [PACKAGE, *(imports(PACKAGE) & {*FILES})]
    while todo:
        name = todo.pop()
        if name in seen:
            continue
        seen.add(name)
        for module in imports(name, also_in_functions=False):
            assert not any(f"{module}.".startswith(f"{heavy}.") for heavy in STARTED), f"{name}: {module}"
            todo += [module] if module in FILES else []
    assert f"{PACKAGE}.properties" in seen and f"{PACKAGE}.studio" not in seen
