# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that must hold within one part, found by reading it from end to end."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.anchors_table import HeadAnchors
from generator.dataset.format.digest import add_digests, content_digest
from generator.dataset.format.files import file_sha256
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest, configuration_digest
from generator.dataset.format.open import as_array
from generator.dataset.format.part import PartInfo, iter_part, part_schema_of, reading
from generator.dataset.format.schema import LANDMARK_TOPOLOGY, LANDMARKS, SCHEMA_VERSION, part_schema
from generator.dataset.proof.exact_checks import exact_problems
from generator.dataset.proof.pass_checks import pass_problems
from generator.dataset.proof.row_checks import (
    camera_problems,
    identity_problems,
    image_problems,
    landmark_problems,
    rotation_problems,
)
from generator.dataset.proof.verify_report import Check
from generator.dataset.show.detection import Places
from generator.errors import HeadturnError
from generator.plan.first_settings import common_values
from generator.plan.poses import PosePlan, pose_name


@dataclass
class PartFindings:
    """What one part showed.

    checks: by name; those without problems may be absent. digest: None where it could not be read.
    heads, poses: int32 [N], the place of each known row in heads.parquet and poses.csv;
    detected: bool [N]. closure_deg: see :class:`generator.dataset.proof.verify_report.VerifyReport`.
    """

    rows: int = 0
    digest: str | None = None
    closure_deg: float = 0.0
    checks: dict[str, Check] = field(default_factory=dict)
    heads: list[np.ndarray] = field(default_factory=list)
    poses: list[np.ndarray] = field(default_factory=list)
    detected: list[np.ndarray] = field(default_factory=list)

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
        plan: PosePlan,
        anchors: dict[tuple[str, str], HeadAnchors],
    ) -> None:
        self._root, self._manifest, self._heads, self._plan = root, manifest, heads, plan
        self._places = Places(heads, plan)
        self._names = [pose_name(*pose) for pose in plan.angles_deg.tolist()]
        self._points = np.full((len(heads), LANDMARKS, 3), np.nan)
        for place, head in enumerate(heads):
            if found := anchors.get((head.subject, head.expression)):
                self._points[place] = found.points
        common = configuration_digest(common_values(manifest.configuration))
        self._schema = part_schema(manifest.images, {}, common)
        self._metadata = {
            b"headturn.schema_version": manifest.schema_version.encode(),
            b"headturn.landmark_topology": LANDMARK_TOPOLOGY.encode(),
            b"headturn.images": manifest.images.encode(),
            b"headturn.configuration_digest": common.encode(),
        }

    def quick(self, part: PartInfo) -> PartFindings:
        """Size, footer and schema of a part, without reading its rows."""
        found, path = PartFindings(rows=part.rows, digest=part.digest), self._root / part.path
        try:
            size = path.stat().st_size
            with reading(path):
                footer = pq.read_metadata(path)
            rows, schema = footer.num_rows, footer.schema.to_arrow_schema()
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
        found.add("schema", (f"{part.path}: {problem}" for problem in self._schema_problems(schema)))
        return found

    def check(self, part: PartInfo) -> PartFindings:
        """Everything within a part: hash, schema, digest, and every row against the tables."""
        found, path = PartFindings(), self._root / part.path
        try:
            if file_sha256(path) != part.sha256:
                found.add(
                    "part hashes", [f"{part.path} was changed or damaged after the build (SHA-256 differs)"]
                )
            wrong = self._schema_problems(part_schema_of(path))
            found.add("schema", (f"{part.path}: {problem}" for problem in wrong))
            if wrong:
                return found
            rows, detected, digests = 0, 0, []
            for batch in iter_part(path):
                if nulls := [name for name in batch.schema.names if _nulls(batch.column(name))]:
                    found.add("no nulls", (f"{part.path}: nulls in {name}" for name in nulls))
                    continue
                rows += len(batch)
                detected += int(as_array(batch, "detected").sum())
                digests.append(content_digest(batch))
                self._check_rows(batch, part, found)
        except (OSError, HeadturnError, UnicodeDecodeError) as error:
            found.add("part hashes", [f"{part.path} cannot be read: {error}"])
            return found
        found.rows, found.digest = rows, add_digests(digests)
        if (rows, detected) != (part.rows, part.detected):
            found.add("part hashes", [f"{part.path} has {rows} rows, the manifest says {part.rows}"])
        if found.digest != part.digest:
            found.add("digest", [f"{part.path} holds other values than the manifest says"])
        return found

    def _check_rows(self, batch: pa.RecordBatch, part: PartInfo, found: PartFindings) -> None:
        heads, poses = self._places.of(batch)
        known = (heads >= 0) & (poses >= 0)
        if not known.all():
            unknown = batch.filter(pa.array(~known)).column("sample_id").to_pylist()
            found.add("every row once", (f"{name} is not in heads.parquet x poses.csv" for name in unknown))
            batch, heads, poses = batch.filter(pa.array(known)), heads[known], poses[known]
        if not len(batch):
            return
        found.heads.append(heads)
        found.poses.append(poses)
        found.detected.append(as_array(batch, "detected").astype(bool))
        split = part.path.split("/")[1]
        found.add(
            "identity",
            identity_problems(batch, self._heads, self._plan, self._names, heads, poses, split),
        )
        found.add("rotation", rotation_problems(batch))
        found.add("camera", camera_problems(batch, self._heads, heads))
        found.add("landmarks", landmark_problems(batch))
        problems, closure = exact_problems(batch, self._heads, heads, self._points)
        found.add("exact landmarks", problems)
        found.closure_deg = max(found.closure_deg, closure)
        found.add("images", image_problems(batch, self._manifest.images, self._root))
        found.add("passes", pass_problems(batch, self._heads, heads, self._root))

    def _schema_problems(self, schema: pa.Schema) -> list[str]:
        metadata = schema.metadata or {}
        wrong = [
            f"{key.decode()} is {metadata.get(key, b'missing').decode(errors='replace')!r}, "
            f"expected {value.decode()!r}"
            for key, value in self._metadata.items()
            if metadata.get(key) != value
        ]
        if not schema.equals(self._schema):
            names = set(schema.names) ^ set(self._schema.names) or {
                field.name for field in self._schema if not schema.field(field.name).equals(field)
            }
            what = ", ".join(sorted(names)) or "their order"
            wrong.append(f"columns differ from schema {SCHEMA_VERSION}: {what}")
        return wrong


def _nulls(column: pa.Array) -> bool:
    if column.null_count:
        return True
    return any(_nulls(child) for child in column.flatten()) if pa.types.is_struct(column.type) else False
