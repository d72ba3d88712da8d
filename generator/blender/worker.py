# SPDX-License-Identifier: GPL-3.0-or-later
"""The render worker: a process with bpy that takes orders on stdin and answers with receipts.

One JSON object a line in both directions. Orders:

``{"op": "render", "package": FILE.npz, "settings": {...}, "distance_mm": D,
"poses": [[yaw, pitch, roll], ...], "out": FOLDER, "format": "bmp" or "exr", "passes": [...]}``
    renders each pose into ``FOLDER/<index>.<format>``, or with passes ("depth", "normal", ...) these
    alone, as a multilayer .exr; answers ``{"frame": index, "path": ...}``
    after each and ``{"done": count}`` at the end. The head stays loaded until another is named.
``{"op": "convert", "source": FILE.fbx, "target": FILE.glb}``
    reads a mesh with Blender's importer and writes it as glTF; answers ``{"done": 1}``.

The first line a worker writes is ``{"ready": VERSION}``. An order that fails is
answered with ``{"error": "one line"}`` and the worker goes on; it ends when
stdin closes, so it never outlives the process that started it.

Start it with the bpy wheel (``python -m generator.blender.worker``) or inside a
Blender (``blender --background --factory-startup --python worker.py``).
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import traceback
from pathlib import Path
from typing import Any


def _import_package_beside_this_file() -> None:
    """Make ``generator`` importable inside Blender without its neighbours.

    Adding site-packages to sys.path would hide Blender's own numpy behind one
    compiled for another Python.
    """
    folder = Path(__file__).resolve().parents[1]
    spec = importlib.util.spec_from_file_location(
        "generator", folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    assert spec is not None and spec.loader is not None, "a file that exists has a loader"
    package = importlib.util.module_from_spec(spec)
    sys.modules["generator"] = package
    spec.loader.exec_module(package)


if "generator" not in sys.modules and not __package__:
    _import_package_beside_this_file()

from generator.process import end_with_parent  # noqa: E402

if __name__ == "__main__":
    end_with_parent()  # before bpy, which takes a second to load: its host may die in it

import bpy  # noqa: E402

from generator.blender import compat, scene  # noqa: E402
from generator.heads.package import load_package  # noqa: E402
from generator.plan.render_settings import RenderSettings  # noqa: E402


class RenderWorker:
    """Keeps one head loaded and renders it at any pose."""

    def __init__(self, threads: int) -> None:
        self._threads = threads
        self._loaded: tuple[Any, ...] | None = None
        self._stage: scene.Stage | None = None

    def render(self, order: dict[str, Any], answer: Any) -> None:
        """Carry out a render order; answer is called with each receipt."""
        settings = RenderSettings.from_dict(order["settings"])
        package = Path(order["package"])
        wanted = (package, package.stat().st_mtime_ns, settings, order["distance_mm"])
        if wanted != self._loaded:
            self._loaded = None
            mesh = load_package(package)
            self._stage = scene.Stage(mesh, settings, order["distance_mm"], threads=self._threads)
            self._loaded = wanted
        assert self._stage is not None
        out = Path(order["out"])
        for index, pose in enumerate(order["poses"]):
            path = out / f"{index:06d}.{order['format']}"
            if order.get("passes"):
                self._stage.render_passes(pose, path, order["passes"])
            else:
                self._stage.render(pose, path)
            answer({"frame": index, "path": str(path)})
        answer({"done": len(order["poses"])})

    def convert(self, order: dict[str, Any], answer: Any) -> None:
        """Carry out a convert order."""
        self._loaded = None
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.fbx(filepath=order["source"], use_anim=False)
        bpy.ops.export_scene.gltf(filepath=order["target"], export_format="GLB", export_animations=False)
        answer({"done": 1})


def main(threads: int) -> None:
    """Serve orders from stdin until it closes."""
    # Receipts get stdout to themselves. What Blender prints there, 5 kB a frame, would fill the log.
    receipts = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def answer(receipt: dict[str, Any]) -> None:
        receipts.write(json.dumps(receipt) + "\n")

    version = compat.check_version()
    worker = RenderWorker(threads)
    orders = {"render": worker.render, "convert": worker.convert}
    answer({"ready": version})
    for line in sys.stdin:
        order = json.loads(line)
        named = {key: value for key, value in order.items() if key not in ("poses", "settings")}
        print(f"order: {named}", file=sys.stderr, flush=True)
        try:
            orders[order["op"]](order, answer)
        except Exception as error:
            # The boundary of the process: the whole story goes to the log, one line to the host.
            traceback.print_exc()
            answer({"error": f"{type(error).__name__}: {' '.join(str(error).split())}"})


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    main(threads=int(words[0]) if words else 0)
