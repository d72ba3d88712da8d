# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane: one render worker and one detector that turn orders into committed parts.

The same class serves every executor: in-process (serial), as a child process
(:mod:`generator.execution.lanes.lane_main`, local), or in a Ray actor. Images never leave
the lane.
"""

from __future__ import annotations

import gc
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import cast

import cv2
import numpy as np

from generator.content import content_versions
from generator.dataset.format.build_files import PLACED_FILE
from generator.dataset.format.columns import ImageMode, further_column
from generator.dataset.format.part import commit_unit
from generator.dataset.format.passes import passes_from_blender, passes_sha256, write_passes
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows
from generator.errors import HeadError, WorkerError
from generator.execution.lanes.labels import labelled_head
from generator.execution.lanes.options import LaneOptions, OnImage
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.rotation import graphics_rotation
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.placement import Placement
from generator.heads.read import read_mesh
from generator.heads.scene import Eye
from generator.heads.surroundings import head_alone
from generator.landmarks.beside import Beside
from generator.landmarks.detector import Detector, each_detector, open_detector
from generator.landmarks.occlusion import shades, with_occlusion
from generator.landmarks.shared import SharedAnchors, packaged
from generator.landmarks.surface import Surface
from generator.messages import (
    BuildOrder,
    Built,
    LaneOrder,
    PlaceOrder,
    Receipt,
    Shared,
    ShareOrder,
    Versions,
    VersionsOrder,
)
from generator.picture.scenery import Folders
from generator.placing.placer import Placer
from generator.plan.passes import SEGMENTATION
from generator.plan.scenes import seen_look
from generator.plan.settings import Landmarks
from generator.plan.views import View, Views
from generator.process import resident_mib
from generator.worn.wardrobe import Outfits, Wardrobe

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


class Lane:
    """Places heads and builds units, one order after another."""

    def __init__(self, options: LaneOptions) -> None:
        self._scratch = Path(options.scratch)
        self._memory_mib = options.memory_mib
        self.renderer = self._open_renderer("frames", options)
        self.shots = Shots(self.renderer)
        if options.gpu is not None and not self.renderer.device:
            self.renderer.close()
            raise WorkerError("Blender finds no GPU here that Cycles can render on")
        self._places = self.renderer
        # Where a head stands is read off renders, and every Blender and GPU renders a little differently.
        # With the same one for this, labels do not depend on the one that renders the images.
        wheel = find_spec("bpy") is not None
        same = replace(options, blender=None if wheel else options.blender, gpu=None)
        if same != options:
            self._places = self._open_renderer("looks", same)
        self._wardrobe = Wardrobe(self._scratch / "worn")
        self._detectors: dict[Landmarks, Detector] = {}
        self._loaded: tuple[Head, Placement, bool, bool] | None = None

    def run(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        """See :class:`generator.execution.lanes.options.AnyLane`."""
        if isinstance(order, VersionsOrder):
            return Versions(self._versions(order.landmarks))
        if isinstance(order, PlaceOrder):
            self._unload()
            return self.placer(order.landmarks, order.shared).subject(order.heads, order.frame)
        if isinstance(order, ShareOrder):
            return Shared(self.placer(order.landmarks).share(order.heads, order.placed))

        def watched() -> None:
            on_image()
            self._check_memory()

        return self._build(order, watched)

    def close(self) -> None:
        """End the render worker and free the detectors."""
        self._places.close()
        self.renderer.close()
        self._close_detectors()

    def kill(self) -> None:
        """End the render worker now."""
        self._places.kill()
        self.renderer.kill()
        self._close_detectors()

    def detector(self, landmarks: Landmarks) -> Detector:
        """The first detector of some settings; made once."""
        landmarks = replace(landmarks, also=())
        if landmarks not in self._detectors:
            self._detectors[landmarks] = open_detector(landmarks)
        return self._detectors[landmarks]

    def placer(self, landmarks: Landmarks, shared: Sequence[SharedAnchors] = ()) -> Placer:
        """What places heads for a detector. shared: anchors that are known besides those of the package."""
        detector = self.detector(landmarks)
        known = (*packaged(detector.topology), *shared)
        return Placer(self._places, detector, self._scratch, self.read, known)

    def read(self, head: Head, textures: Path | None = None) -> HeadMesh:
        """A head's mesh as its source has it. Raises HeadError if it cannot be read.

        textures: a folder for those that are made for it; by default one that the next head empties.
        """
        folder = textures
        if folder is None:
            folder = self._scratch / "head"
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
        return read_mesh(head, folder, import_with_blender=self.renderer.import_mesh)

    def dressed(
        self,
        head: Head,
        mesh: HeadMesh,
        placement: Placement,
        views: Views,
        landmarks: Landmarks,
        things: str = "",
    ) -> Outfits:
        """What a head that stands wears in some views, for a preview. mesh: as read. things: folder of a
        user's own."""
        if not any(look.wears for look in views.looks):
            return Outfits()
        placed = placement.normalise(head_alone(mesh, placement))
        points = self.points(mesh, placement, landmarks)
        return self._wardrobe.dress(head.name, placed, points, views, things)

    def points(self, mesh: HeadMesh, placement: Placement, landmarks: Landmarks) -> np.ndarray:
        """The anchors of a head that stands, for a preview: float64 [P, 3], frame C, mm. mesh: as read."""
        anchors = self.placer(landmarks).anchors(mesh, placement)
        return anchors.turned(graphics_rotation(placement.levelling))

    def _open_renderer(self, folder: str, options: LaneOptions) -> Renderer:
        images = self._scratch / folder
        images.mkdir(parents=True, exist_ok=True)
        return Renderer(
            images,
            self._scratch / "render.log",
            blender=options.blender,
            threads=options.threads,
            gpu=options.gpu,
            deadline_s=options.deadline_s,
        )

    def _close_detectors(self) -> None:
        while self._detectors:
            self._detectors.popitem()[1].close()

    def _versions(self, landmarks: Landmarks) -> dict[str, str]:
        names = [self.detector(one).name for one in each_detector(landmarks).values()]
        return content_versions(blender=self.renderer.version, detector="; ".join(names))

    def _check_memory(self) -> None:
        """WorkerError if lane and render worker outgrew their limit: fresh ones start small again."""
        if self._memory_mib:
            used = sum(map(resident_mib, {os.getpid(), self.renderer.pid, self._places.pid}))
            if used > self._memory_mib:
                raise WorkerError(
                    f"a lane grew to {used:.0f} MiB, above its limit of {self._memory_mib:.0f} MiB; "
                    "give more with --memory"
                )

    def _build(self, order: BuildOrder, on_image: OnImage) -> Built:
        seconds: dict[str, float] = {}
        views, topology = order.views, self.detector(order.landmarks).topology
        with _timed(seconds, "load"):
            package = self._package(order)
        with _timed(seconds, "visibility"):
            if off := self._surface.off(order.anchors):
                raise HeadError(
                    f"{order.head.mesh_path}: {off} of its anchors are not on its surface: what an earlier "
                    f"run noted about it was changed; delete {PLACED_FILE} and run the build again"
                )
            outfits = self._wardrobe.dress(order.head.name, self._mesh, order.anchors, views, order.things)
            visible = self._surface.visible(order.anchors, views) & ~outfits.hidden(order.anchors, views)
            if self._beside is not None:
                visible &= ~self._beside.hides(order.anchors, views)
        detectors = {name: self.detector(one) for name, one in each_detector(order.landmarks).items()}
        landmarks = {
            name: np.full((len(views), topology.count, 3), np.nan, dtype=np.float32) for name in detectors
        }
        suffix, flags = ENCODING[order.image_format]
        images: list[bytes] = []
        folders = Folders(order.environments, order.pictures)
        rendered = self.shots.start(package, views, folders, outfits.worn)
        for row, view in enumerate(views):
            with _timed(seconds, "wait for render"):
                one = next(rendered)
            with _timed(seconds, "encode"):
                image = self.shots.finish(one, view)
                images.append(_encoded(image, suffix, flags))
            with _timed(seconds, "detect"):
                for name, detector in detectors.items():
                    if (found := detector.detect(image)) is not None:
                        landmarks[name][row] = found
            on_image()
        for _ in rendered:  # the worker's closing receipt
            pass
        first = landmarks.pop(order.landmarks.detector)
        passes = None
        if order.passes:
            with _timed(seconds, "passes"):
                passes = list(self._passes(package, views, order.passes, outfits))
        rows = UnitRows(
            subject=order.head.subject,
            expression=order.head.expression,
            split=order.split,
            head_license=order.head.license,
            redistributable=order.head.redistributable,
            angles_deg=views.angles_deg,
            indices=np.array(order.indices, dtype=np.int16).reshape(-1, 3),
            cameras=views.cameras,
            looks=views.looks if self._mesh.scene is None else tuple(map(seen_look, views.looks)),
            detected=np.isfinite(first).all(axis=(1, 2)),
            landmarks=first,
            anchors=order.anchors,
            visible=visible,
            left_out=outfits.left_out,
            images=images,
            image_suffix=suffix,
            passes=passes,
            topology=topology,
            factor=order.factor,
            extra={further_column(name): points for name, points in landmarks.items()},
        )
        versions = self._versions(order.landmarks)
        with _timed(seconds, "write"):
            schema = part_schema(
                cast(ImageMode, order.images),
                versions,
                order.configuration_digest,
                topology,
                twins=bool(order.factor),
                also=order.landmarks.also,
            )
            part = commit_unit(rows, schema, Path(order.root), order.unit)
        return Built(part, seconds, versions)

    def _passes(
        self, package: Path, views: Views, names: tuple[str, ...], outfits: Outfits
    ) -> Iterator[tuple[bytes, str]]:
        """Each view's passes as (OpenEXR file, SHA-256 of its floats), rendered a few at a time."""
        for start in range(0, len(views), PASSES_AHEAD):
            few = slice(start, start + PASSES_AHEAD)
            some = views[few]
            rendered = self.renderer.render(package, some, passes=names, worn=outfits.worn[few])
            for view, path in zip(some, rendered, strict=True):
                channels = passes_from_blender(path, names, view.camera.distance_mm, self._eye(view))
                write_passes(channels, path)
                yield path.read_bytes(), passes_sha256(channels)
                path.unlink()

    def _eye(self, view: View) -> Eye | None:
        """Where the render worker's camera stands in the world of the head's scene, if it has one."""
        return self._mesh.scene.eye(view.camera) if self._mesh.scene else None

    def _unload(self) -> None:
        """Free what is known of the head before: parts of it know each other, and Python seldom looks for
        such where few objects hold much memory."""
        self._loaded = None
        gc.collect()

    def _package(self, order: BuildOrder) -> Path:
        """The head of an order for its render worker; made once as long as it is the same."""
        package = self._scratch / "head.npz"
        head, placement = order.head, order.placement
        tells, shaded = SEGMENTATION.name in order.passes, shades(order.views)
        wanted = head, placement, tells, shaded
        if wanted != self._loaded:
            self._unload()
            mesh = placement.normalise(head_alone(self.read(head), placement))
            self._mesh, self._surface = mesh, Surface(mesh)
            self._beside = Beside(mesh.scene, placement) if mesh.scene else None
            if shaded:
                mesh = with_occlusion(mesh, self._surface)
            if tells:
                mesh = labelled_head(head, mesh, order.anchors, self._scratch)
            save_package(mesh, package)
            self._loaded = wanted
        return package


def _encoded(image: np.ndarray, suffix: str, flags: list[int]) -> bytes:
    """An RGB image as a file."""
    return cv2.imencode(suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR), flags)[1].tobytes()


@contextmanager
def _timed(seconds: dict[str, float], stage: str) -> Iterator[None]:
    start = time.perf_counter()
    yield
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start
