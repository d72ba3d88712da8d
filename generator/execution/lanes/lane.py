# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane: one render worker and one detector that turn orders into committed parts.

The same class serves every executor: in-process (serial), as a child process
(``python -m generator.execution.lanes.lane_main``, local), or in a Ray actor. Orders and
receipts are plain JSON values; images never leave the lane.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from generator import __version__
from generator.dataset.format.part import UnitRows, commit_unit
from generator.dataset.format.passes import passes_from_blender, passes_sha256, write_passes
from generator.dataset.format.schema import part_schema
from generator.errors import HeadError, WorkerError
from generator.execution.lanes.renderer import DEADLINE_S, Renderer
from generator.geometry.camera import Camera
from generator.geometry.rotation import rotation_from_angles
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.landmarks.anchors import Anchors, unpack
from generator.landmarks.detector import POINTS
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.landmarks.surface import Surface
from generator.placing.anchoring import anchor_head, level_head
from generator.placing.face import Prepared, prepare
from generator.placing.levelling import Levelling
from generator.plan.render_settings import RenderSettings
from generator.process import resident_mib

OnFrame = Callable[[], None]

ENCODING = {
    # Run lengths alone: smaller than level 3 of the usual search on these images, and quicker.
    "png": (
        ".png",
        [cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE],
    ),
    "jpg": (".jpg", [cv2.IMWRITE_JPEG_QUALITY, 95]),
}


PASSES_AHEAD = 8
"""Uncompressed OpenEXR files that may wait in the scratch folder."""


@dataclass(frozen=True)
class LaneOptions:
    """What a lane needs to know besides its orders.

    scratch: an existing folder of its own, best on a tmpfs. threads: of Cycles,
    0 for every core. cpus: cores the lane and its render worker keep to.
    deadline_s: a render worker that is silent for so long hangs.
    memory_mib: of the lane and its render worker together; 0 for no limit.
    """

    scratch: str = ""
    blender: str | None = None
    threads: int = 0
    cpus: tuple[int, ...] = ()
    min_confidence: float = 0.5
    deadline_s: float = DEADLINE_S
    memory_mib: float = 0.0


class Lane:
    """Prepares heads and builds units, one order after another."""

    def __init__(self, options: LaneOptions) -> None:
        self._scratch = Path(options.scratch)
        frames = self._scratch / "frames"
        frames.mkdir(parents=True, exist_ok=True)
        self._memory_mib = options.memory_mib
        self._renderer = Renderer(
            frames,
            self._scratch / "render.log",
            blender=options.blender,
            threads=options.threads,
            deadline_s=options.deadline_s,
        )
        self._places = self._renderer
        if options.blender is not None and find_spec("bpy") is not None:
            # Where a head stands is read off renders, and every Blender renders a little differently.
            # With the same one for this, labels do not depend on the one that renders the images.
            looks = self._scratch / "looks"
            looks.mkdir(exist_ok=True)
            self._places = Renderer(
                looks, self._scratch / "render.log", threads=options.threads, deadline_s=options.deadline_s
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
        if order["op"] == "versions":
            return {"versions": self.versions}
        if order["op"] == "prepare":
            return self._prepare([head_from_json(head) for head in order["heads"]], order["frame"])

        def watched() -> None:
            on_frame()
            self._check_memory()

        return self._build(order, watched)

    def close(self) -> None:
        """End the render worker and free the detector."""
        self._places.close()
        self._renderer.close()
        self._detector.close()

    def kill(self) -> None:
        """End the render worker now."""
        self._places.kill()
        self._renderer.kill()
        self._detector.close()

    def _check_memory(self) -> None:
        """WorkerError if lane and render worker outgrew their limit: fresh ones start small again."""
        if self._memory_mib:
            used = sum(map(resident_mib, {os.getpid(), self._renderer.pid, self._places.pid}))
            if used > self._memory_mib:
                raise WorkerError(
                    f"a lane grew to {used:.0f} MiB, above its limit of {self._memory_mib:.0f} MiB; "
                    "give more with --memory"
                )

    def _read(self, head: Head) -> HeadMesh:
        folder = self._scratch / "head"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        return read_mesh(head, folder, import_with_blender=self._renderer.import_mesh)

    def _prepare(self, heads: list[Head], frame: str) -> dict[str, Any]:
        """Check every expression of a subject and anchor its landmarks; find the face and pose
        zero on the first that shows it."""
        self._loaded = {}
        prepared: Prepared | None = None
        facts: list[dict[str, Any]] = []
        reason = ""
        for head in heads:
            try:
                mesh = self._read(head)
                if prepared is None:
                    prepared = prepare(head, mesh, self._places, self._detector, self._scratch)
                    anchors, levelling = self._anchor(mesh, prepared)
                    prepared = level_head(head, prepared, levelling, frame)
                else:
                    anchors, _ = self._anchor(mesh, prepared)
            except HeadError as error:
                reason = reason or str(error)
                facts.append({"error": str(error)})
            else:
                facts.append(
                    {
                        "vertices": len(mesh.vertices),
                        "triangles": len(mesh.triangles),
                        "problems": [*mesh.problems, *anchors.problems],
                        "anchors": anchors.as_dict(),
                    }
                )
        if prepared is None:
            raise HeadError(reason)
        return {"prepared": prepared.as_dict(), "facts": facts, "versions": self.versions}

    def _anchor(self, mesh: HeadMesh, prepared: Prepared) -> tuple[Anchors, Levelling | None]:
        return anchor_head(mesh, prepared, self._places, self._detector, self._scratch)

    def _build(self, order: dict[str, Any], on_frame: OnFrame) -> dict[str, Any]:
        seconds: dict[str, float] = {}
        head = head_from_json(order["head"])
        settings = RenderSettings.from_dict(order["settings"])
        camera = Camera(settings.resolution, settings.lens_mm, order["distance_mm"], settings.projection)
        with _timed(seconds, "load"):
            package = self._package(head, Prepared.from_dict(order["prepared"]))
        poses = np.array(order["poses"], dtype=np.float64).reshape(-1, 3)
        anchors = unpack(order["anchors"], "<f8").reshape(POINTS, 3)
        with _timed(seconds, "visibility"):
            visible = self._surface.visible(anchors, rotation_from_angles(poses), camera)
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
        passes = None
        if order["passes"]:
            with _timed(seconds, "passes"):
                passes = list(self._passes(package, settings, camera, poses, order["passes"]))
        rows = UnitRows(
            subject=head.subject,
            expression=head.expression,
            split=order["split"],
            head_license=head.license,
            redistributable=head.redistributable,
            angles_deg=poses,
            indices=np.array(order["indices"], dtype=np.int16).reshape(-1, 3),
            camera=camera,
            detected=detected,
            landmarks=landmarks,
            anchors=anchors,
            visible=visible,
            images=images,
            image_suffix=suffix,
            passes=passes,
        )
        with _timed(seconds, "write"):
            schema = part_schema(order["images"], self.versions, order["configuration_digest"])
            part = commit_unit(rows, schema, Path(order["root"]), order["unit"])
        return {"part": asdict(part), "seconds": seconds, "versions": self.versions}

    def _passes(
        self, package: Path, settings: RenderSettings, camera: Camera, poses: np.ndarray, names: list[str]
    ) -> Iterator[tuple[bytes, str]]:
        """Each pose's passes as (OpenEXR file, SHA-256 of its floats), rendered a few at a time."""
        for start in range(0, len(poses), PASSES_AHEAD):
            chunk = poses[start : start + PASSES_AHEAD].tolist()
            for path in self._renderer.render(package, settings, camera.distance_mm, chunk, passes=names):
                channels = passes_from_blender(path, names, camera.distance_mm)
                write_passes(channels, path)
                yield path.read_bytes(), passes_sha256(channels)
                path.unlink()

    def _package(self, head: Head, prepared: Prepared) -> Path:
        key = {"head": head_to_json(head), "prepared": prepared.as_dict()}
        package = self._scratch / "head.npz"
        if key != self._loaded:
            self._loaded = {}
            mesh = prepared.normalise(self._read(head))
            save_package(mesh, package)
            self._surface = Surface(mesh)
            self._loaded = key
        return package


def head_to_json(head: Head) -> dict[str, Any]:
    """Plain values of a head."""
    files = [str(file.absolute()) for file in head.files]  # a lane may have another working directory
    return {**asdict(head), "mesh_path": str(head.mesh_path.absolute()), "files": files}


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
