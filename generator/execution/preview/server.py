# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview server: what an interface needs of the host while its user tries things out.

One JSON object a line on stdin, one answer a line on stdout, in order. A request
that fails is answered with ``{"error": "one line"}``. It ends when stdin closes.

``{"op": "list", "heads": {...}, "cache": FOLDER}``
    the heads of a source (the [heads] table of a configuration; parametric ones
    are made in FOLDER): ``{"kind", "heads": [{"subject", "expression", "problems"}], "skipped": [...]}``
``{"op": "place", "subject", "expression", "frame", "package": FILE.npz}``
    finds the head's face and writes it as frame U, mm, pivot at the origin:
    ``{"radius_mm", "vertices", "notes"}``
``{"op": "pictures", "package": FILE.npz, "render": {...}, "distance_mm", "poses": [...],
"folder", "landmarks": bool, "sheet": columns}``
    renders poses as a build would: ``{"pictures": [path, ...], "landmarks": [[[x, y], ...] or null, ...]}``
    and, with columns, ``"sheet": path``, all of them in one picture with the landmarks drawn
``{"op": "thumbnail", "subject", "expression", "frame", "pixels", "cache": FOLDER}``
    a small picture of a head at pose zero, made once for the same files: ``{"picture": path}``
``{"op": "plan", "poses": {...}, "file": FILE.npy}``
    writes the poses of a [poses] table as float64 [N, 3], degrees: ``{"count": N}``
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from generator.dataset.format.files import file_sha256
from generator.errors import HeadError, HeadturnError, UsageError
from generator.execution.build.run import find_source
from generator.execution.build.units import camera_distance
from generator.execution.lanes.lane import Lane, LaneOptions
from generator.execution.lanes.renderer import check_blender
from generator.execution.lanes.scratch import scratch_folder
from generator.execution.preview.picture import DOT
from generator.heads.head import NEUTRAL, Head, HeadSource
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.placing.face import Prepared
from generator.plan.config import load_config


class _Quiet:
    """A reporter that says nothing: answers are all that goes out."""

    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...

    def note(self, text: str) -> None: ...


class _PreviewLane(Lane):
    """A lane that hands out what a build keeps to itself."""

    def find(self, head: Head, frame: str) -> Prepared:
        """Where a build would place the head, were it the first of its subject. Raises HeadError."""
        return Prepared.from_dict(self._prepare([head], frame)["prepared"])

    def package(self, head: Head, prepared: Prepared, target: Path) -> dict[str, Any]:
        """Write the placed head, with textures that are made for it beside it."""
        textures = target.with_suffix("")
        shutil.rmtree(textures, ignore_errors=True)
        textures.mkdir(parents=True)
        mesh = read_mesh(head, textures, import_with_blender=self._renderer.import_mesh)
        save_package(prepared.normalise(mesh), target)
        return {
            "radius_mm": prepared.radius_mm,
            "vertices": len(mesh.vertices),
            "notes": [*head.problems, *mesh.problems, *prepared.notes],
        }

    def pictures(
        self,
        package: str,
        render: dict[str, Any],
        distance_mm: float,
        poses: list[list[float]],
        folder: str,
        landmarks: bool,
        sheet: int = 0,
    ) -> dict[str, Any]:
        """See the module's docstring."""
        settings = load_config(None, {"render": render}).render.settings()
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        paths, found, tiles = [], [], []
        for index, frame in enumerate(self._renderer.render(Path(package), settings, distance_mm, poses)):
            image = cv2.imread(str(frame))
            frame.unlink()
            points = self._detector.detect(cv2.cvtColor(image, cv2.COLOR_BGR2RGB)) if landmarks else None
            found.append(None if points is None else np.round(points[:, :2], 2).tolist())
            path = target / f"{index:03d}.png"
            cv2.imwrite(str(path), image)
            paths.append(str(path))
            tiles.append(image if points is None else draw_points(image, points))
        answer: dict[str, Any] = {"pictures": paths, "landmarks": found}
        if sheet:
            rows = [np.hstack(tiles[k : k + sheet]) for k in range(0, len(tiles), sheet)]
            cv2.imwrite(str(target / "sheet.png"), np.vstack(rows))
            answer["sheet"] = str(target / "sheet.png")
        return answer


class PreviewServer:
    """Answers requests; Blender and the detector start with the first that needs them."""

    def __init__(self, scratch: Path, stack: ExitStack, blender: str | None = None) -> None:
        self._options = LaneOptions(scratch=str(scratch), blender=blender)
        self._scratch = scratch
        self._stack = stack
        self._lane: _PreviewLane | None = None
        self._source: HeadSource | None = None
        self._placed: dict[tuple[str, str], Prepared] = {}

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to one request. Raises HeadturnError."""
        operation = request.pop("op")
        if operation == "list":
            return self._list(**request)
        if operation == "place":
            return self._place(**request)
        if operation == "pictures":
            return self._open_lane().pictures(**request)
        if operation == "thumbnail":
            return self._thumbnail(**request)
        if operation == "plan":
            return _draw_plan(**request)
        raise UsageError(f"the preview server knows no {operation!r}: extension and host differ in version")

    def _list(self, heads: dict[str, Any], cache: str) -> dict[str, Any]:
        config = load_config(None, {"heads": heads})
        Path(cache).mkdir(parents=True, exist_ok=True)
        self._placed = {}
        self._source = source = find_source(config.heads, Path(cache), _Quiet())
        return {
            "kind": source.kind,
            "heads": [
                {"subject": h.subject, "expression": h.expression, "problems": h.problems}
                for h in source.heads
            ],
            "skipped": [f"{s.subject}/{s.expression}: {s.reason}" for s in source.skipped],
        }

    def _place(self, subject: str, expression: str, frame: str, package: str) -> dict[str, Any]:
        head = self._head(subject, expression)
        return self._open_lane().package(head, self._prepared(subject, frame), Path(package))

    def _thumbnail(
        self, subject: str, expression: str, frame: str, pixels: int, cache: str
    ) -> dict[str, Any]:
        head = self._head(subject, expression)
        try:
            content = [file_sha256(file) for file in head.files]
        except OSError as error:
            raise HeadError(f"{head.name}: {error.filename}: {error.strerror}") from error
        name = hashlib.sha256(json.dumps([content, frame, pixels]).encode()).hexdigest()[:32]
        picture = Path(cache) / f"{name}.png"
        if not picture.exists():
            prepared = self._prepared(subject, frame)
            package = self._scratch / "thumbnail.npz"
            lane = self._open_lane()
            lane.package(head, prepared, package)
            config = load_config(None, {"render": {"resolution": pixels}})
            distance = camera_distance(config, prepared)
            zero = [[0.0, 0.0, 0.0]]
            render = {"resolution": pixels}
            made = lane.pictures(str(package), render, distance, zero, str(self._scratch), False)
            picture.parent.mkdir(parents=True, exist_ok=True)
            half = picture.with_name(f".{os.getpid()}-{picture.name}")  # another Blender may write it too
            shutil.copyfile(made["pictures"][0], half)
            os.replace(half, picture)
        return {"picture": str(picture)}

    def _head(self, subject: str, expression: str) -> Head:
        heads = () if self._source is None else self._source.heads
        for head in heads:
            if (head.subject, head.expression) == (subject, expression):
                return head
        raise UsageError(f"there is no {subject}/{expression}: list the heads again")

    def _prepared(self, subject: str, frame: str) -> Prepared:
        """Where a subject stands; found once."""
        key = (subject, frame)
        if key not in self._placed:
            assert self._source is not None, "a head that was found has a source"
            heads = [head for head in self._source.heads if head.subject == subject]
            heads.sort(key=lambda head: (head.expression != NEUTRAL, head.expression))
            self._placed[key] = self._find(heads, frame)
        return self._placed[key]

    def _find(self, heads: list[Head], frame: str) -> Prepared:
        """As a build places a subject: by its neutral face, or the first that shows one."""
        reason = ""
        for head in heads:
            try:
                return self._open_lane().find(head, frame)
            except HeadError as error:
                reason = reason or str(error)
        raise HeadError(reason)

    def _open_lane(self) -> _PreviewLane:
        if self._lane is None:
            self._lane = _PreviewLane(self._options)
            self._stack.callback(self._lane.close)
        return self._lane


def _draw_plan(poses: dict[str, Any], file: str) -> dict[str, Any]:
    plan = load_config(None, {"poses": poses}).poses.plan()
    Path(file).parent.mkdir(parents=True, exist_ok=True)
    np.save(file, plan.angles_deg)
    return {"count": len(plan)}


def draw_points(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A copy of a BGR image with a dot on each point. points: float [N, 2 or more], pixels."""
    drawn = image.copy()
    for x, y in points[:, :2]:
        cv2.circle(drawn, (round(x), round(y)), max(1, len(image) // 300), DOT, -1, cv2.LINE_AA)
    return drawn


def answers(server: PreviewServer, lines: Iterator[str]) -> Iterator[dict[str, Any]]:
    """One answer a request."""
    for line in lines:
        try:
            yield server.answer(json.loads(line))
        except HeadturnError as error:
            yield {"error": str(error)}


def serve(blender: str | None = None) -> None:
    """Serve requests from stdin until it closes."""
    if blender is not None:
        check_blender(blender)
    out = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints is no answer
    with ExitStack() as stack:
        scratch = stack.enter_context(scratch_folder())
        for answer in answers(PreviewServer(scratch, stack, blender), iter(sys.stdin)):
            out.write(json.dumps(answer) + "\n")
