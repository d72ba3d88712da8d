# SPDX-License-Identifier: GPL-3.0-or-later
"""The render worker: a process with bpy that takes orders on stdin and answers with receipts.

One JSON object a line in both directions: :class:`generator.messages.RenderOrder` is answered with
Rendered after each view and OrderDone at the end, ConvertOrder with OrderDone. The head stays
loaded until another is named.

The first thing a worker says is WorkerReady. An order that fails is answered with OrderFailed and
the worker goes on; it ends when stdin closes, so it never outlives the process that started it.

Start it with the bpy wheel (``python -m generator.blender.worker``) or inside a
Blender (``blender --background --factory-startup --python worker.py``).
"""

from __future__ import annotations

import importlib.util
import json
import os
import sys
import traceback
from collections.abc import Callable
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

from generator.process import end_with_parent, few_cores, limited_memory  # noqa: E402

WORDS = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
THREADS = int(WORDS[0]) if __name__ == "__main__" and WORDS else 0
GPU = int(WORDS[1]) if __name__ == "__main__" and len(WORDS) > 1 else None

if __name__ == "__main__":
    end_with_parent()  # before bpy, which takes a second to load: its host may die in it

# A thread for every core that Blender counts now would spin while the one of a frame works.
with few_cores(THREADS):
    import bpy  # noqa: F401

from generator.blender import compat  # noqa: E402
from generator.blender.clearing import clear  # noqa: E402
from generator.blender.crop import Backdrops  # noqa: E402
from generator.blender.devices import Device  # noqa: E402
from generator.blender.images import Images  # noqa: E402
from generator.blender.importing import export_glb, import_mesh  # noqa: E402
from generator.blender.scene_images import SceneImages  # noqa: E402
from generator.blender.scene_reading import read_scene  # noqa: E402
from generator.errors import HeadError  # noqa: E402
from generator.heads.package import load_package  # noqa: E402
from generator.messages import (  # noqa: E402
    ConvertOrder,
    OrderDone,
    OrderFailed,
    Rendered,
    RenderOrder,
    SceneOrder,
    WorkerReady,
    from_json,
    to_json,
)
from generator.plan.passes import PAINTED  # noqa: E402
from generator.registries import PASSES  # noqa: E402

MAX_IMPORT_MIB = 8192
"""What a file may unpack to that is larger than it looks, of which its importer believes what it says."""

Answer = Callable[[Any], None]
"""Takes each message of the worker."""


class RenderWorker:
    """Keeps one head loaded and renders any view of it."""

    def __init__(self, threads: int, device: Device) -> None:
        self._threads, self._device = threads, device
        self._loaded: tuple[Path, int] | None = None
        self._images: Images | SceneImages | None = None
        self._backdrops = Backdrops()

    def carry_out(self, order: Any, answer: Answer) -> None:
        """Carry out an order. TypeError if it is none of a render worker's."""
        if isinstance(order, RenderOrder):
            self._render(order, answer)
        elif isinstance(order, ConvertOrder):
            self._convert(order)
        elif isinstance(order, SceneOrder):
            self._loaded = self._images = None
            read_scene(order)
        else:
            raise TypeError(f"{type(order).__name__} is no order for a render worker")
        answer(OrderDone())

    def _render(self, order: RenderOrder, answer: Answer) -> None:
        package = Path(order.package)
        wanted = (package, package.stat().st_mtime_ns)
        if wanted != self._loaded:
            self._loaded = None
            mesh = load_package(package)
            self._images = None
            if mesh.scene is not None:
                self._images = SceneImages(mesh.scene, threads=self._threads, device=self._device)
            else:
                self._images = Images(
                    mesh, threads=self._threads, device=self._device, backdrops=self._backdrops
                )
            self._loaded = wanted
        assert self._images is not None
        self._images.wear(one.package for worn in order.worn for one in worn)
        if order.passes:
            self._render_passes(self._images, order, answer)
            return
        self._images.expect(order.views, order.lights, order.worn)
        for place, view in enumerate(order.views):
            path = Path(order.out) / f"{place:06d}.{order.format}"
            environment = order.lights[place] if order.lights else None
            worn = order.worn[place] if order.worn else ()
            if self._images.layered(view.look):
                path = path.with_suffix(".exr")
                box = self._images.render_over_nothing(view, path, environment, worn)
            else:
                self._images.render(view, path, environment, worn)
                box = None
            answer(Rendered(place, str(path), box))

    def _render_passes(self, images: Images | SceneImages, order: RenderOrder, answer: Answer) -> None:
        """All views' passes of one kind and then of the other: each kind has a stage of its own."""
        painted = [name for name in order.passes if PASSES.get(name).switch == PAINTED]
        paths = [Path(order.out) / f"{place:06d}.{order.format}" for place in range(len(order.views))]
        worn = order.worn or ((),) * len(order.views)
        for view, path, things in zip(order.views, paths, worn, strict=True):
            images.render_passes(view, path, order.passes, things)
        if painted:
            images.render_painted(order.views, paths, painted, worn)
        for place, path in enumerate(paths):
            answer(Rendered(place, str(path)))

    def _convert(self, order: ConvertOrder) -> None:
        self._loaded = None
        clear()
        with limited_memory(MAX_IMPORT_MIB):
            names = import_mesh(Path(order.source))
            export_glb(Path(order.target))
        Path(order.target).with_suffix(".json").write_text(json.dumps(names), encoding="utf-8")


def main(threads: int, gpu: int | None = None) -> None:
    """Serve orders from stdin until it closes."""
    # Receipts get stdout to themselves. What Blender prints there, 5 kB a frame, would fill the log.
    receipts = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def answer(message: Any) -> None:
        receipts.write(json.dumps(to_json(message)) + "\n")

    version = compat.check_version()
    if threads == 1:
        compat.write_exr_alone()
    device = Device(gpu)
    worker = RenderWorker(threads, device)
    answer(WorkerReady(version, str(device)))
    for line in sys.stdin:
        try:
            order = from_json(json.loads(line))
            print(f"order: {type(order).__name__} {_named(order)}", file=sys.stderr, flush=True)
            worker.carry_out(order, answer)
        except Exception as error:
            # The boundary of the process: the whole story goes to the log, one line to the host.
            traceback.print_exc()
            what = "" if isinstance(error, HeadError) else f"{type(error).__name__}: "
            answer(OrderFailed(f"{what}{' '.join(str(error).split())}"))


def _named(order: Any) -> str:
    return str(getattr(order, "package", "") or getattr(order, "source", ""))


if __name__ == "__main__":
    main(THREADS, GPU)
