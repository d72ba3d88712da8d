# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane: one render worker and one detector that turn orders into committed parts.

The same class serves every executor: in-process (serial), as a child process
(``python -m generator.execution.lane``, local), later as a Ray actor. Orders and
receipts are plain JSON values; images never leave the lane.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from generator import __version__
from generator.dataset.part import UnitRows, commit_unit
from generator.dataset.schema import part_schema
from generator.errors import HeadError, HeadturnError, WorkerError
from generator.execution.prepare import Prepared, prepare
from generator.execution.renderer import Renderer
from generator.geometry.camera import Camera
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.landmarks.detector import POINTS
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.plan.render_settings import RenderSettings

OnFrame = Callable[[], None]

ENCODING = {
    # Level 1: 2 % larger than level 3 and a quarter quicker.
    "png": (".png", [cv2.IMWRITE_PNG_COMPRESSION, 1]),
    "jpg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 95]),
}


@dataclass(frozen=True)
class LaneOptions:
    """What a lane needs to know besides its orders.

    scratch: an existing folder of its own, best on a tmpfs. threads: of Cycles,
    0 for every core. cpus: cores the lane and its render worker keep to.
    """

    scratch: str
    blender: str | None = None
    threads: int = 0
    cpus: tuple[int, ...] = ()
    min_confidence: float = 0.5


class Lane:
    """Prepares heads and builds units, one order after another."""

    def __init__(self, options: LaneOptions) -> None:
        self._scratch = Path(options.scratch)
        frames = self._scratch / "frames"
        frames.mkdir(parents=True, exist_ok=True)
        self._renderer = Renderer(
            frames, self._scratch / "render.log", blender=options.blender, threads=options.threads
        )
        self._detector = MediaPipeFaceMesh(options.min_confidence)
        self._loaded: dict[str, Any] = {}
        self.versions = {
            "headturn": __version__,
            "blender": self._renderer.version,
            "detector": self._detector.name,
            "numpy": version("numpy"),
            "opencv": cv2.__version__,
        }

    def run(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]:
        """Carry out one order; on_frame is called after each image.

        Raises HeadError (this head cannot be built), WorkerError (this lane is
        broken, another may do better) or DatasetError (nothing can be written).
        """
        if order["op"] == "prepare":
            return self._prepare([head_from_json(head) for head in order["heads"]])
        return self._build(order, on_frame)

    def close(self) -> None:
        """End the render worker and free the detector."""
        self._renderer.close()
        self._detector.close()

    def kill(self) -> None:
        """End the render worker now."""
        self._renderer.kill()
        self._detector.close()

    def _read(self, head: Head) -> HeadMesh:
        folder = self._scratch / "head"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return read_mesh(head, folder, import_with_blender=self._renderer.import_mesh)

    def _prepare(self, heads: list[Head]) -> dict[str, Any]:
        """Check every expression of a subject; find the face on the first that shows it."""
        self._loaded = {}
        prepared: Prepared | None = None
        facts: list[dict[str, Any]] = []
        reason = ""
        for head in heads:
            try:
                mesh = self._read(head)
                if prepared is None:
                    prepared = prepare(head, mesh, self._renderer, self._detector, self._scratch)
            except HeadError as error:
                reason = reason or str(error)
                facts.append({"error": str(error)})
            else:
                facts.append(
                    {
                        "vertices": len(mesh.vertices),
                        "triangles": len(mesh.triangles),
                        "problems": list(mesh.problems),
                    }
                )
        if prepared is None:
            raise HeadError(reason)
        return {"prepared": prepared.as_dict(), "facts": facts, "versions": self.versions}

    def _build(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]:
        seconds: dict[str, float] = {}
        head = head_from_json(order["head"])
        settings = RenderSettings.from_dict(order["settings"])
        with _timed(seconds, "load"):
            package = self._package(head, Prepared.from_dict(order["prepared"]))
        poses = np.array(order["poses"], dtype=np.float64).reshape(-1, 3)
        landmarks = np.full((len(poses), POINTS, 3), np.nan, dtype=np.float32)
        detected = np.zeros(len(poses), dtype=bool)
        suffix, flags = ENCODING[order["image_format"]]
        images: list[bytes] = []
        frames = self._renderer.render(package, settings, order["distance_mm"], poses.tolist())
        for row in range(len(poses)):
            with _timed(seconds, "wait for render"):
                path = next(frames)
            with _timed(seconds, "encode"):
                frame = cv2.imread(str(path), cv2.IMREAD_COLOR)
                path.unlink()
                if frame is None or frame.shape != (settings.resolution, settings.resolution, 3):
                    raise WorkerError(f"{path}: the render worker left no readable frame")
                images.append(cv2.imencode(suffix, frame, flags)[1].tobytes())
            with _timed(seconds, "detect"):
                found = self._detector.detect(cv2.cvtColor(frame, cv2.COLOR_BGR2RGB))
            if found is not None:
                landmarks[row], detected[row] = found, True
            on_frame()
        for _ in frames:  # the worker's closing receipt
            pass
        rows = UnitRows(
            subject=head.subject,
            expression=head.expression,
            split=order["split"],
            head_license=head.license,
            redistributable=head.redistributable,
            angles_deg=poses,
            indices=np.array(order["indices"], dtype=np.int16).reshape(-1, 3),
            camera=Camera(settings.resolution, settings.lens_mm, order["distance_mm"]),
            detected=detected,
            landmarks=landmarks,
            images=images,
            image_suffix=suffix,
        )
        with _timed(seconds, "write"):
            schema = part_schema(order["images"], self.versions, order["configuration_digest"])
            part = commit_unit(rows, schema, Path(order["root"]), order["unit"])
        return {"part": asdict(part), "seconds": seconds, "versions": self.versions}

    def _package(self, head: Head, prepared: Prepared) -> Path:
        key = {"head": head_to_json(head), "prepared": prepared.as_dict()}
        package = self._scratch / "head.npz"
        if key != self._loaded:
            self._loaded = {}
            save_package(prepared.normalise(self._read(head)), package)
            self._loaded = key
        return package


def head_to_json(head: Head) -> dict[str, Any]:
    """Plain values of a head."""
    return {**asdict(head), "mesh_path": str(head.mesh_path), "files": [str(f) for f in head.files]}


def head_from_json(values: dict[str, Any]) -> Head:
    """The inverse of :func:`head_to_json`."""
    return Head(
        **{
            **values,
            "mesh_path": Path(values["mesh_path"]),
            "files": tuple(map(Path, values["files"])),
            "problems": tuple(values["problems"]),
        }
    )


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start


def main() -> None:
    """Serve orders from stdin; the first line holds the options."""
    receipts = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints goes to the log

    def answer(receipt: dict[str, Any]) -> None:
        receipts.write(json.dumps(receipt) + "\n")

    options = json.loads(sys.stdin.readline())
    if options["cpus"] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, options["cpus"])  # inherited by the render worker
    cv2.setNumThreads(1)
    lane: Lane | None = None
    try:
        for line in sys.stdin:
            try:
                if lane is None:
                    lane = Lane(LaneOptions(**{**options, "cpus": tuple(options["cpus"])}))
                answer({"receipt": lane.run(json.loads(line), lambda: answer({"frame": 1}))})
            except HeadturnError as error:
                answer({"error": str(error), "type": type(error).__name__})
    finally:
        if lane is not None:
            lane.close()


if __name__ == "__main__":
    main()
