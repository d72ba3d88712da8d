# SPDX-License-Identifier: GPL-3.0-or-later
"""Render samples of a finished dataset again, the way they were built, and compare."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from itertools import groupby, islice
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.anchors_table import read_anchors
from generator.dataset.format.files import write_anywhere
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import dataset_topology, image_bytes, read_samples
from generator.dataset.format.part import read_part
from generator.dataset.proof.compare import row_differences
from generator.dataset.proof.context import known_config
from generator.dataset.proof.stored import Stored, read_stored
from generator.errors import DatasetError, HeadturnError, UsageError, WorkerError
from generator.escape import printable, quoted
from generator.execution.build.units import build_order
from generator.execution.executors.executor import Executor
from generator.execution.executors.open import open_executor
from generator.execution.lanes.scratch import scratch_folder
from generator.execution.lanes.slot import Outcome
from generator.execution.recorded_heads import RecordedHeads
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.messages import BuildOrder, Built, VersionsOrder, expect
from generator.picture.settled import check_files
from generator.plan.config import BuildConfig
from generator.plan.factors import FACTORS
from generator.plan.twins import plan_twins
from generator.plan.view_plan import plan_views
from generator.plan.views import Pose

Row = Mapping[str, Any]

WINDOW = 256
"""Rows that are read, rendered and compared at a time; bounds the memory of a replay of all of them."""

VIEWS = 8
"""Rows of one head in one order."""


@dataclass(frozen=True)
class Replay:
    """What came out the second time.

    same: image, passes, detection and landmarks are the recorded ones, bit by bit, and so are the files.
    differences: a line each. versions: what ran then and now, where it is not the same.
    compared: which files, hashes and images. decoded: a stored image is one, of the right kind and size.
    not_rendered: why only the files were looked at, and nothing rendered.
    """

    sample_id: str
    same: bool
    differences: tuple[str, ...]
    versions: tuple[str, ...] = ()
    compared: str = ""
    decoded: bool = False
    not_rendered: HeadturnError | None = None

    def text(self) -> str:
        """For people, a line a difference."""
        if self.same:
            lines = [f"{self.sample_id}: the same image, landmarks and labels, bit by bit", self.compared]
        else:
            lines = [f"{self.sample_id}: not the same", *self.differences, *self.versions]
        return "\n".join(map(printable, lines))

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "sample_id": self.sample_id,
            "same": self.same,
            "differences": self.differences,
            "versions": self.versions,
            "compared": self.compared,
        }


def replay_sample(
    root: Path,
    sample_id: str,
    *,
    heads: Path | None = None,
    picture: Path | None = None,
    blender: str | None = None,
) -> Replay:
    """Build one row again from the dataset's configuration and head files.

    Parameters
    ----------
    heads: where the head source lies now, if it was moved.
    picture: where the new image is written, if anywhere.

    Raises
    ------
    UsageError: there is no such sample. HeadError: the head's files are gone or
    were changed. DatasetError: the dataset cannot be read.
    """

    def keep(_: str, image: bytes) -> None:
        if picture is not None:
            write_anywhere(picture, image)

    found = [*replay_samples(root, [sample_id], heads=heads, blender=blender, workers=1, on_render=keep)]
    if found:
        if found[0].not_rendered is not None:
            raise found[0].not_rendered
        return found[0]
    example = next(iter(read_manifest(root).parts)).subject or "subject"
    raise UsageError(
        f"{root}: no sample {sample_id!r}; names are like {example}/neutral/y+30_p-10_r+0, "
        "see the column sample_id"
    )


def replay_samples(
    root: Path,
    sample_ids: Iterable[str],
    *,
    heads: Path | None = None,
    blender: str | None = None,
    workers: int | None = None,
    on_image: Callable[[], None] = lambda: None,
    on_render: Callable[[str, bytes], None] = lambda name, image: None,
) -> Iterator[Replay]:
    """Build rows again, all in the same lanes; see :func:`replay_sample`.

    sample_ids: best head by head. Those that are not in the dataset are left out.
    workers: lanes, default one a core. on_image: called after each, from any thread; on_render: with the
        name and the new image of each.
    What keeps a row, or all of them, from being rendered is said in Replay.not_rendered.

    Raises
    ------
    DatasetError: the dataset cannot be read.
    """
    manifest = read_manifest(root)
    names = iter(sample_ids)
    with ExitStack() as stack:
        studio: _Studio | None = None
        while window := list(islice(names, WINDOW)):
            rows = read_samples(root, manifest, window)
            if not rows:
                continue
            if studio is None:  # nothing is started for rows that are not there
                studio = _Studio(stack, root, heads, blender, workers)
            yield from studio.replay([rows[name] for name in window if name in rows], on_image, on_render)


class _Studio:
    """The tables of a dataset, and the lanes in which its rows are rendered again."""

    def __init__(
        self, stack: ExitStack, root: Path, moved: Path | None, blender: str | None, workers: int | None
    ) -> None:
        self._root, self._manifest = root, read_manifest(root)
        self._config = known_config(self._manifest, root)
        self._heads = RecordedHeads(root, self._config, moved)
        self._anchors = read_anchors(root)
        self._points = dataset_topology(root, self._manifest).count
        self._scratch = stack.enter_context(scratch_folder())
        self._lanes = cache(lambda: _open_lanes(stack, self._config, blender, workers))

    def replay(
        self, rows: Sequence[Row], on_image: Callable[[], None], on_render: Callable[[str, bytes], None]
    ) -> Iterator[Replay]:
        """Those of some rows, in their order."""
        found: dict[str, Replay] = {}
        orders: dict[str, tuple[BuildOrder, list[Row]]] = {}
        for (subject, expression, _), group in groupby(rows, key=_together):
            together, key = list(group), (subject, expression)
            try:
                head = self._heads.of(key)
                if isinstance(closed := self._lanes(), HeadturnError):
                    raise closed
            except HeadturnError as error:
                found.update((row["sample_id"], self._looked_at(row, error)) for row in together)
                continue
            for start in range(0, len(together), VIEWS):
                some = together[start : start + VIEWS]
                order = self._order(key, head, some, f"again{len(orders)}")
                orders[order.unit] = order, some
        outcomes: Iterable[Outcome] = ()
        if orders and not isinstance(lanes := self._lanes(), HeadturnError):
            outcomes = lanes.run([order for order, _ in orders.values()], on_image)
        for outcome in outcomes:
            order, some = orders[expect(BuildOrder, outcome.order).unit]
            folder = Path(order.root)
            if outcome.receipt is None:
                name = order.head.name
                why = WorkerError(f"{name}: cannot be rendered again: {outcome.error}", outcome.log)
                found.update((row["sample_id"], self._looked_at(row, why)) for row in some)
            else:
                built = expect(Built, outcome.receipt)
                again = read_part(folder / built.part.path).to_pylist()
                for row, now in zip(some, again, strict=True):
                    image = image_bytes(folder, now)
                    on_render(row["sample_id"], image)
                    found[row["sample_id"]] = self._compared(row, now, image, built.versions)
            shutil.rmtree(folder, ignore_errors=True)
        for row in rows:
            yield found[row["sample_id"]]

    def _order(self, key: tuple[str, str], head: Head, rows: Sequence[Row], unit: str) -> BuildOrder:
        """The build order of some rows of a head, or of twins, with what placing it found at the time."""
        row, config = self._heads.rows[key], self._config
        anchors = self._anchors.get(key)
        points = np.full((self._points, 3), np.nan) if anchors is None else anchors.points
        poses: list[Pose] = [(r["yaw_deg"], r["pitch_deg"], r["roll_deg"]) for r in rows]
        indices = tuple((r["yaw_index"], r["pitch_index"], r["roll_index"]) for r in rows)
        _, _, factor = _together(rows[0])
        if factor and factor not in FACTORS:
            raise DatasetError(f"{self._root}: there is no factor {quoted(factor)}; see `headturn verify`")
        if factor:
            views = plan_twins(config, head.name, row.radius_mm, poses, factor, row.own_camera)
        else:
            views = plan_views(config, head.name, row.radius_mm, poses, row.own_camera)
        root = self._scratch / unit
        root.mkdir()
        order = build_order(head, _placement(row), points, row.split, views, indices, config, root)
        return replace(order, unit=unit, images="embedded", factor=factor)

    def _stored(self, row: Row) -> Stored:
        return read_stored(self._root, row, self._manifest.images, self._config.dataset)

    def _looked_at(self, row: Row, why: HeadturnError) -> Replay:
        stored = self._stored(row)
        return Replay(
            row["sample_id"], False, tuple(stored.problems), decoded=stored.decoded, not_rendered=why
        )

    def _compared(self, row: Row, now: Row, image: bytes, versions: Mapping[str, str]) -> Replay:
        stored, recorded = self._stored(row), self._manifest.versions
        differences = [*stored.problems, *row_differences(row, now, stored.files(image, row))]
        changed = [
            f"{name}: {recorded.get(name, 'none')} then, {version} now"
            for name, version in versions.items()
            if recorded.get(name) != version
        ]
        name, same = row["sample_id"], not differences
        return Replay(name, same, tuple(differences), tuple(changed), stored.compared(), stored.decoded)


def _together(row: Row) -> tuple[str, str, str]:
    """What rows of one order share: subject, expression and, of twins, the factor."""
    return row["subject"], row["expression"], row.get("factor", "")


def _open_lanes(
    stack: ExitStack, config: BuildConfig, blender: str | None, workers: int | None
) -> Executor | HeadturnError:
    """Lanes that answer, or why there are none here."""
    try:
        check_files(config)
        lanes = stack.enter_context(open_executor("local", workers=workers, blender=blender))
    except UsageError as error:  # no Blender, or other panoramas
        return error
    [outcome] = lanes.run([VersionsOrder(config.detecting)], lambda: None)
    if outcome.receipt is None:
        return WorkerError(f"nothing can be rendered here: {outcome.error}", outcome.log)
    return lanes


def _placement(row: HeadRow) -> Placement:
    return Placement(
        units=row.units,
        mm_per_unit=row.mm_per_unit,
        up=row.up,
        forward=row.forward,
        pivot=row.pivot,
        radius_mm=row.radius_mm,
        eye_distance_mm=float("nan"),
        frame=row.frame,
        correction=row.correction,
        correction_sd_deg=row.correction_sd_deg,
        scene_camera=row.own_camera,
    )
