# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview server: what an interface needs of the host while its user tries things out.

One JSON object a line on stdin, one answer a line on stdout, in order. A request
that fails is answered with ``{"error": "one line"}``. It ends when stdin closes.

Each has a configuration, its tables as in TOML. Those that need its heads have ``"made": FOLDER``, too, where
parametric heads are made, by one process at a time. While they are, and only if ``"progress": true`` asks for
it, events of progress as those of ``headturn build --json`` come before the answer.

``{"op": "list", "config": {...}, "made"}``
    the heads that a configuration names:
    ``{"kind", "heads": [{"subject", "expression", "problems"}], "skipped": [...]}``
``{"op": "place", "config", "made", "subject", "expression", "package": FILE.npz}``
    finds the head's face and writes it as frame U, mm, pivot at the origin:
    ``{"radius_mm", "vertices", "notes"}``
``{"op": "pictures", "config", "made", "package": FILE.npz, "head": NAME, "radius_mm", "poses": [...],
"folder", "landmarks": bool, "sheet": columns}``
    renders poses as a build would: ``{"pictures": [path, ...], "landmarks": [[[x, y], ...] or null, ...]}``
    and, with columns, ``"sheet": path``, all of them in one picture with the landmarks drawn
``{"op": "looks", "config", "made", "package", "head", "radius_mm", "pose", "seeds": [...], "folder",
"sheet": columns}``
    the looks that builds with these seeds draw for one pose: ``{"pictures", "drawn": [{key: value}, ...]}``,
    ``"left_out"``, what each could not wear and why, and ``"sheet"``, with each one's seed
``{"op": "thumbnail", "config", "made", "subject", "expression", "pixels", "cache": FOLDER}``
    a small picture of a head at pose zero, made once for the same files: ``{"picture": path}``
``{"op": "plan", "config", "subject", "expression", "file": FILE.npy}``
    writes the poses of a head as float64 [N, 3], degrees: ``{"count": N}``
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.files import file_sha256
from generator.errors import HeadError, HeadturnError, UsageError
from generator.execution.build.place import in_placing_order
from generator.execution.build.sources import find_source
from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.execution.lanes.renderer import check_blender
from generator.execution.lanes.scratch import scratch_folder
from generator.execution.preview.picture import draw_points
from generator.execution.preview.sheets import named, write_image, write_images
from generator.geometry.scene_camera import SceneCamera
from generator.heads.head import Head, HeadSource, is_scene
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.placement import Placement
from generator.heads.surroundings import head_alone
from generator.landmarks.occlusion import with_occlusion
from generator.locks import alone
from generator.picture.scenery import folders_of
from generator.picture.settled import settled
from generator.plan.config import BuildConfig, load_config
from generator.plan.pose_plans import plan_poses
from generator.plan.settings import Values
from generator.plan.view_plan import drawn_values, plan_views
from generator.plan.views import Pose, Views
from generator.plan.wear import Worn
from generator.worn.wardrobe import Outfits

Tell = Callable[[dict[str, Any]], None]
"""Says something before the answer."""


class _Teller:
    """Says how far heads are that are made."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell

    def stage(self, name: str, total: int) -> None:
        self._name, self._done, self._total, self._began = name, 0, total, time.monotonic()
        self._tell({"event": "stage", "stage": name, "total": total})

    def advance(self, steps: int = 1) -> None:
        self._done += steps
        rate = self._done / max(time.monotonic() - self._began, 0.001)
        left = (self._total - self._done) / rate
        counted = {"done": self._done, "total": self._total, "rate": rate, "eta_s": left}
        self._tell({"event": "progress", "stage": self._name, **counted})


class PreviewServer:
    """Answers requests; Blender and the detector start with the first that needs them."""

    def __init__(
        self,
        scratch: Path,
        stack: ExitStack,
        blender: str | None = None,
        tell: Tell = lambda message: None,
        blender_of_scenes: str | None = None,
    ) -> None:
        self._blender, self._blender_of_scenes = blender, blender_of_scenes or blender
        self._asked_with = blender
        self._scratch = scratch
        self._stack = stack
        self._tell, self._tells = tell, False
        self._lanes: dict[str | None, Lane] = {}
        self._made = scratch / "made"
        self._source: HeadSource | None = None
        self._placed: dict[tuple[str, str, Any], Placement] = {}

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to one request. Raises HeadturnError."""
        operations: dict[str, Callable[..., dict[str, Any]]] = {
            "list": self._list,
            "place": self._place,
            "pictures": self._pictures,
            "looks": self._looks,
            "thumbnail": self._thumbnail,
            "plan": _draw_plan,
        }
        operation = operations.get(name := request.pop("op"))
        if operation is None:
            raise UsageError(f"the preview server knows no {name!r}: extension and host differ in version")
        values: Values = request.pop("config")
        source = str(values.get("heads", {}).get("source", ""))
        self._asked_with = self._blender_of_scenes if is_scene(source) else self._blender
        self._made = Path(request.pop("made", self._made))
        self._tells = request.pop("progress", False)
        return operation(load_config(None, values), **request)

    def _list(self, config: BuildConfig) -> dict[str, Any]:
        self._source = None
        source = self._heads(config)
        return {
            "kind": source.kind,
            "heads": [
                {"subject": h.subject, "expression": h.expression, "problems": h.problems}
                for h in source.heads
            ],
            "skipped": [f"{s.subject}/{s.expression}: {s.reason}" for s in source.skipped],
        }

    def _place(self, config: BuildConfig, subject: str, expression: str, package: str) -> dict[str, Any]:
        head = self._head(config, subject, expression)
        placement = self._placement(config, subject)
        # Looks of all kinds are tried out on a head that is placed.
        mesh_problems, vertices = self._package(head, placement, Path(package), with_occlusion)
        return {
            "radius_mm": placement.radius_mm,
            "vertices": vertices,
            "notes": [*head.problems, *mesh_problems, *placement.notes],
        }

    def _pictures(
        self,
        config: BuildConfig,
        package: str,
        head: str,
        radius_mm: float,
        poses: list[Pose],
        folder: str,
        landmarks: bool,
        sheet: int = 0,
    ) -> dict[str, Any]:
        config = settled(config)
        own = self._scene_camera(config, head)
        views = plan_views(config, head, radius_mm, [(y, p, r) for y, p, r in poses], own)
        found, tiles = [], []
        worn = self._outfits(config, head, views).worn
        images = [*self._render(Path(package), views, config, worn)]
        for image in images:
            detector = self._open_lane().detector(config.detecting) if landmarks else None
            points = detector.detect(image) if detector else None
            found.append(None if points is None else np.round(points[:, :2], 2).tolist())
            tiles.append(image if points is None else draw_points(image, points))
        return {**write_images(images, Path(folder), tiles, sheet), "landmarks": found}

    def _looks(
        self,
        config: BuildConfig,
        package: str,
        head: str,
        radius_mm: float,
        pose: Pose,
        seeds: list[int],
        folder: str,
        sheet: int = 0,
    ) -> dict[str, Any]:
        config, (yaw, pitch, roll) = settled(config), pose
        seeded = [replace(config, poses=replace(config.poses, seed=seed)) for seed in seeds]
        own = self._scene_camera(config, head)
        planned = [plan_views(one, head, radius_mm, [(yaw, pitch, roll)], own)[0] for one in seeded]
        views = Views.of(planned)
        outfits = self._outfits(config, head, views)
        images = [*self._render(Path(package), views, config, outfits.worn)]
        tiles = [named(image, str(seed)) for image, seed in zip(images, seeds, strict=True)]
        drawn = [drawn_values(one, head, (yaw, pitch, roll)) for one in seeded]
        left_out = [*outfits.left_out] or [""] * len(seeds)
        return {**write_images(images, Path(folder), tiles, sheet), "drawn": drawn, "left_out": left_out}

    def _thumbnail(
        self, config: BuildConfig, subject: str, expression: str, pixels: int, cache: str
    ) -> dict[str, Any]:
        head = self._head(config, subject, expression)
        try:
            content = [file_sha256(file) for file in head.files]
        except OSError as error:
            raise HeadError(f"{head.name}: {error.filename}: {error.strerror}") from error
        name = hashlib.sha256(
            json.dumps([content, config.poses.frame, pixels, *head.without]).encode()
        ).hexdigest()[:32]
        picture = Path(cache) / f"{name}.png"
        if not picture.exists():
            placement = self._placement(config, subject)
            package = self._scratch / "thumbnail.npz"
            self._package(head, placement, package)
            small = load_config(None, {"render": {"resolution": pixels}})
            views = plan_views(small, head.name, placement.radius_mm, [(0.0, 0.0, 0.0)])
            [image] = self._render(package, views, small)
            picture.parent.mkdir(parents=True, exist_ok=True)
            half = picture.with_name(f".{os.getpid()}-{picture.name}")  # another Blender may write it too
            write_image(image, half)
            os.replace(half, picture)
        return {"picture": str(picture)}

    def _heads(self, config: BuildConfig) -> HeadSource:
        """The heads of a configuration, found once: whoever asks may have listed them long ago."""
        if self._source is None:
            self._made.mkdir(parents=True, exist_ok=True)
            self._placed = {}
            teller = _Teller(self._tell if self._tells else lambda message: None)
            with alone(self._made.with_suffix(".lock")):
                self._source = find_source(config, self._made, teller)
        return self._source

    def _head(self, config: BuildConfig, subject: str, expression: str) -> Head:
        for head in self._heads(config).heads:
            if (head.subject, head.expression) == (subject, expression):
                return head
        raise UsageError(f"there is no {subject}/{expression}: list the heads again")

    def _placement(self, config: BuildConfig, subject: str) -> Placement:
        """Where a subject stands, as a build finds it; found once."""
        key = (subject, config.poses.frame, config.detecting)
        if key not in self._placed:
            heads = [head for head in self._heads(config).heads if head.subject == subject]
            placer = self._open_lane().placer(config.detecting)
            self._placed[key] = placer.stand(in_placing_order(heads), config.poses.frame)
        return self._placed[key]

    def _scene_camera(self, config: BuildConfig, name: str) -> SceneCamera | None:
        """The camera of a head's scene, where images are to be seen through it."""
        if not config.render.scene_camera:
            return None
        return self._placement(config, name.partition("/")[0]).scene_camera

    def _package(
        self,
        head: Head,
        placement: Placement,
        target: Path,
        finish: Callable[[HeadMesh], HeadMesh] = lambda mesh: mesh,
    ) -> tuple[tuple[str, ...], int]:
        """Write the placed head, with textures that are made for it beside it: (problems, vertices)."""
        textures = target.with_suffix("")
        shutil.rmtree(textures, ignore_errors=True)
        textures.mkdir(parents=True)
        mesh = self._open_lane().read(head, textures)
        save_package(finish(placement.normalise(head_alone(mesh, placement))), target)
        return mesh.problems, len(mesh.vertices)

    def _outfits(self, config: BuildConfig, name: str, views: Views) -> Outfits:
        """What a head wears in some views."""
        if not any(look.wears for look in views.looks):
            return Outfits()
        head = self._head(config, *name.split("/"))
        placement, lane = self._placement(config, head.subject), self._open_lane()
        things = folders_of(config).things
        return lane.dressed(head, lane.read(head), placement, views, config.detecting, things)

    def _render(
        self, package: Path, views: Views, config: BuildConfig, worn: tuple[tuple[Worn, ...], ...] = ()
    ) -> Iterator[np.ndarray]:
        return self._open_lane().shots.take(package, views, folders_of(config), worn)

    def _open_lane(self) -> Lane:
        blender = self._asked_with
        if blender not in self._lanes:
            scratch = self._scratch / f"lane-{len(self._lanes)}"
            scratch.mkdir()
            self._lanes[blender] = Lane(LaneOptions(scratch=str(scratch), blender=blender))
            self._stack.callback(self._lanes[blender].close)
        return self._lanes[blender]


def _draw_plan(config: BuildConfig, subject: str, expression: str, file: str) -> dict[str, Any]:
    plan = plan_poses(config, [(subject, expression)]).of(subject, expression)
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    np.save(file, plan.angles_deg)
    return {"count": len(plan)}


def answers(server: PreviewServer, lines: Iterator[str]) -> Iterator[dict[str, Any]]:
    """One answer a request."""
    for line in lines:
        try:
            yield server.answer(json.loads(line))
        except HeadturnError as error:
            yield {"error": str(error)}


def serve(blender: str | None = None, blender_of_scenes: str | None = None) -> None:
    """Serve requests from stdin until it closes. blender_of_scenes: for heads in Blender scenes."""
    if blender is not None:
        check_blender(blender)
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints is no answer
    with ExitStack() as stack:
        scratch = stack.enter_context(scratch_folder())

        def say(message: dict[str, Any]) -> None:
            out.write(json.dumps(message) + "\n")

        for answer in answers(
            PreviewServer(scratch, stack, blender, say, blender_of_scenes), iter(sys.stdin)
        ):
            say(answer)
