# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that must hold within one part, found by reading it from end to end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.anchors_table import HeadAnchors
from generator.dataset.format.columns import EVERY, FURTHER, ROWS
from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.defaults import todays_schema, with_defaults
from generator.dataset.format.digest import digest_of, row_hashes
from generator.dataset.format.files import file_sha256
from generator.dataset.format.further import also_of
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest, configuration_digest, parts_configuration
from generator.dataset.format.open import as_array, dataset_topology
from generator.dataset.format.parquet import open_parquet
from generator.dataset.format.part import iter_stored, part_schema_of, reading
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import is_newer, part_schema
from generator.dataset.proof.context import RowContext, known_config, planned_views
from generator.dataset.proof.row_checks import row_checks
from generator.dataset.proof.twin_checks import TWINS, TwinPlan, by_factor, twin_problems
from generator.dataset.proof.verify_report import Check
from generator.errors import HeadturnError
from generator.escape import quoted


@dataclass
class PartFindings:
    """What one part showed.

    checks: by name; those without problems may be absent. digest: None where it could not be read.
    hashes: of its rows, see :func:`generator.dataset.format.digest.row_hashes`.
    heads, poses: int32 [N], the place of each known row in heads.parquet and poses.csv;
    detected: bool [N]. twins: of a part of twins instead: factor, heads and poses of some.
    measured: see :class:`generator.dataset.proof.context.RowContext`.
    """

    rows: int = 0
    digest: str | None = None
    hashes: bytes = b""
    measured: dict[str, float] = field(default_factory=dict)
    checks: dict[str, Check] = field(default_factory=dict)
    heads: list[np.ndarray] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    detected: list[np.ndarray] = field(default_factory=list)
    twins: list[tuple[str, np.ndarray, np.ndarray]] = field(default_factory=list)

    def add(self, name: str, problems: Iterable[str]) -> None:
        """Note problems of one check."""
        self.checks.setdefault(name, Check(name)).add(problems)


class PartChecker:
    """Checks parts of one dataset, one after the other."""

    def __init__(
        self,
        root: Path,
        manifest: Manifest,
        heads: list[HeadRow],
        poses: DatasetPoses,
        anchors: dict[tuple[str, str], HeadAnchors],
    ) -> None:
        self._root, self._manifest = root, manifest
        self._poses = poses
        self._checks = row_checks(manifest.schema_version)
        topology = dataset_topology(root, manifest)
        points = np.full((len(heads), topology.count, 3), np.nan)
        for place, head in enumerate(heads):
            found = anchors.get((head.subject, head.expression))
            if found is not None and found.points.shape == points.shape[1:]:
                points[place] = found.points
        self._context = RowContext(
            root=root,
            images=manifest.images,
            heads=heads,
            poses=poses,
            anchors=points,
            expected_view=planned_views(heads, poses, manifest, root),
        )
        common = configuration_digest(parts_configuration(manifest))
        self._schemas = {
            twins: part_schema(
                manifest.images, {}, common, topology, manifest.schema_version, twins, also_of(manifest)
            )
            for twins in (False, True)
        }
        named = ("schema_version", "landmark_topology", "images", "configuration_digest")
        keys = [f"headturn.{name}".encode() for name in named]
        self._metadata = {key: self._schemas[False].metadata[key] for key in keys}
        twins = TwinPlan(known_config(manifest, root), heads, poses)
        self._factors, self._twin_views = twins.factors, twins.views()

    def quick(self, part: PartInfo) -> PartFindings:
        """Size, footer and schema of a part, without reading its rows."""
        found = PartFindings(rows=part.rows, digest=part.digest)
        try:
            path = dataset_file(self._root, part.path)
            size = path.stat().st_size
            with reading(path), open_parquet(path) as file:
                footer, schema = file.metadata, file.schema_arrow
            rows = footer.num_rows
        except (OSError, HeadturnError) as error:
            found.add("part sizes", [f"{part.path} cannot be read: {error}"])
            return found
        if (size, rows) != (part.bytes, part.rows):
            found.add(
                "part sizes",
                [
                    f"{part.path} has {rows} rows in {size} bytes, "
                    f"the manifest says {part.rows} in {part.bytes}"
                ],
            )
        wrong = self._schema_problems(schema, part.of_twins)
        found.add("schema", (f"{part.path}: {problem}" for problem in wrong))
        found.add("part files", _other_heads(part, footer))
        return found

    def check(self, part: PartInfo) -> PartFindings:
        """Everything within a part: hash, schema, digest, and every row against the tables."""
        found = PartFindings()
        try:
            path = dataset_file(self._root, part.path)
            if file_sha256(path) != part.sha256:
                found.add(
                    "part hashes", [f"{part.path} was changed or damaged after the build (SHA-256 differs)"]
                )
            stored = part_schema_of(path)
            wrong = self._schema_problems(stored, part.of_twins)
            found.add("schema", (f"{part.path}: {problem}" for problem in wrong))
            if wrong:
                return found
            heads: set[tuple[str, str]] = set()
            rows, detected, hashes = 0, 0, bytearray()
            today = todays_schema(stored, str(path))
            for batch in iter_stored(path):
                if nulls := [name for name in batch.schema.names if _nulls(batch.column(name))]:
                    found.add("no nulls", (f"{part.path}: nulls in {name}" for name in nulls))
                    continue
                rows += len(batch)
                detected += int(as_array(batch, "detected").sum())
                names = (batch.column(name).to_pylist() for name in ("subject", "expression"))
                heads.update(zip(*names, strict=True))
                with reading(path):
                    hashes += row_hashes(batch)
                self._check_rows(with_defaults(batch, today), part, found)
        except (OSError, HeadturnError, UnicodeDecodeError) as error:
            found.add("part hashes", [f"{part.path} cannot be read: {error}"])
            return found
        found.rows, found.hashes, found.digest = rows, bytes(hashes), digest_of(hashes)
        if (rows, detected) != (part.rows, part.detected):
            found.add("part hashes", [f"{part.path} has {rows} rows, the manifest says {part.rows}"])
        said = (part.subject, part.expression)
        if said not in (heads.pop() if len(heads) == 1 else ("", ""), ("", "")):
            found.add("part hashes", [f"{part.path} is not of {'/'.join(said)}, as the manifest says"])
        if found.digest != part.digest:
            found.add("digest", [f"{part.path} holds other values than the manifest says"])
        return found

    def _check_rows(self, batch: pa.RecordBatch, part: PartInfo, found: PartFindings) -> None:
        heads, poses = self._poses.of(batch)
        known = (heads >= 0) & (poses >= 0)
        if not known.all():
            unknown = batch.filter(pa.array(~known)).column("sample_id").to_pylist()
            found.add("every row once", (f"{name} is not in heads.parquet x poses.csv" for name in unknown))
            batch, heads, poses = batch.filter(pa.array(known)), heads[known], poses[known]
        if part.of_twins:
            self._check_twins(batch, heads, poses, part, found)
            return
        if not len(batch):
            return
        found.heads.append(heads)
        found.poses.append(poses)
        found.detected.append(as_array(batch, "detected").astype(bool))
        context = replace(
            self._context,
            split=part.path.split("/")[1],
            head_index=heads,
            pose_index=poses,
            measured=found.measured,
        )
        for name, check in self._checks.items():
            found.add(name, check(batch, context))

    def _check_twins(
        self, batch: pa.RecordBatch, heads: np.ndarray, poses: np.ndarray, part: PartInfo, found: PartFindings
    ) -> None:
        """The same of twins, factor by factor, and each against the row of which it is the twin."""
        for factor, of_it in by_factor(batch):
            if factor not in self._factors:
                found.add(TWINS, [f"{part.path}: the configuration names no factor {quoted(factor)}"])
                continue
            some, of_head, of_pose = batch.filter(pa.array(of_it)), heads[of_it], poses[of_it]
            found.twins.append((factor, of_head, of_pose))
            context = replace(
                self._context,
                expected_view=self._twin_views(factor),
                split=part.path.split("/")[1],
                factor=factor,
                head_index=of_head,
                pose_index=of_pose,
                measured=found.measured,
            )
            for name, check in self._checks.items():
                found.add(name, check(some, context))
            found.add(TWINS, twin_problems(some, factor, self._root, self._manifest))

    def _schema_problems(self, schema: pa.Schema, twins: bool) -> list[str]:
        metadata = schema.metadata or {}
        wrong = [
            f"{key.decode()} is {metadata.get(key, b'missing').decode(errors='replace')!r}, "
            f"expected {value.decode()!r}"
            for key, value in self._metadata.items()
            if metadata.get(key) != value
        ]
        expected = self._schemas[twins]
        if is_newer(self._manifest.schema_version):  # it may have columns that we do not know
            known = EVERY if twins else {**ROWS, **FURTHER}
            schema = pa.schema([field for field in schema if field.name in known])
        if not schema.equals(expected):
            names = set(schema.names) ^ set(expected.names) or {
                field.name for field in expected if not schema.field(field.name).equals(field)
            }
            what = ", ".join(sorted(names)) or "their order"
            wrong.append(f"columns differ from schema {self._manifest.schema_version}: {what}")
        return wrong


def _other_heads(part: PartInfo, footer: pq.FileMetaData) -> Iterator[str]:
    """Rows of another head than the manifest says, as the smallest and largest names in the footer tell."""
    at = {footer.schema.column(k).path: k for k in range(footer.num_columns)}
    for name, said in (("subject", part.subject), ("expression", part.expression)):
        for group in range(footer.num_row_groups if said and name in at else 0):
            limits = footer.row_group(group).column(at[name]).statistics
            if limits is not None and limits.has_min_max and {limits.min, limits.max} != {said}:
                yield f"{part.path} is not of {said}, as the manifest says"
                return


def _nulls(column: pa.Array) -> bool:
    if column.null_count:
        return True
    return any(_nulls(child) for child in column.flatten()) if pa.types.is_struct(column.type) else False
