# SPDX-License-Identifier: GPL-3.0-or-later
"""One entry for all formats: check, gate, write, and only then put into place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from generator.dataset.export.licence import check_licences
from generator.dataset.export.options import LANDMARKS, ExportOptions, Format
from generator.dataset.export.readme import readme
from generator.dataset.export.source import Source
from generator.dataset.export.target import new_folder
from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.dataset.format.manifest import Manifest, read_manifest
from generator.dataset.format.open import dataset_topology
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.card import CARD_FILE
from generator.errors import DatasetError, UsageError
from generator.landmarks.topology import Topology
from generator.registries import FORMATS


@dataclass(frozen=True)
class Exported:
    """What an export holds. landmarks: "exact", "detected" or "" for a format without any.

    left_out: rows without a detection or landmarks. withheld: rows that may not be published.
    """

    target: Path
    format: str
    rows: int
    heads: int
    left_out: int
    filled: int
    withheld: int
    landmarks: str


def export_dataset(
    root: Path,
    name: str,
    target: Path,
    options: ExportOptions | None = None,
    progress: Callable[[int], None] | None = None,
) -> Exported:
    """Write a finished dataset in another form.

    name: one of :data:`generator.registries.FORMATS`.
    target: a folder that is new or empty; it is there in full or not at all.
    progress: called with the number of rows that were read.

    Raises
    ------
    UsageError: no such format or choice, the target is not empty, rows may not
        be published, or rows lack what the format needs.
    DatasetError: the dataset is not finished, of another version, or damaged; it has
        no images and the format needs them; the target cannot be written.
    """
    root, target, options = Path(root), Path(target), options or ExportOptions()
    chosen: Format = FORMATS.get(name)
    if options.landmarks not in LANDMARKS:
        raise UsageError(f"--landmarks {options.landmarks!r}: expected one of {', '.join(LANDMARKS)}")
    manifest = _sound(root)
    missing = options.missing or chosen.missing[0]
    if missing not in chosen.missing:
        raise UsageError(f"--missing {missing}: {name} takes one of {', '.join(chosen.missing)}")
    image_format = options.image_format or next(iter(chosen.image_formats), None)
    if image_format is not None and image_format not in chosen.image_formats:
        takes = (
            f"takes one of {', '.join(chosen.image_formats)}"
            if chosen.image_formats
            else "has no choice of it"
        )
        raise UsageError(f"--image-format {image_format}: {name} {takes}")
    public = options.public or chosen.public
    heads, kept_back = check_licences(root, manifest, read_heads(root), options, public)
    topology = dataset_topology(root, manifest)
    if chosen.landmarks and topology.ibug_68 is None:
        raise UsageError(
            f"{root}: {name} holds the 68 points of iBUG, which the landmarks {topology.name} do not say; "
            "choose another --format"
        )
    source = Source(
        root=root,
        manifest=manifest,
        topology=topology,
        heads=heads,
        options=options,
        landmarks=_landmarks(root, heads, options.landmarks, topology) if chosen.landmarks else "",
        missing=missing,
        wants_images=chosen.images,
        wants_boxes=chosen.boxes,
        image_format=image_format,
        progress=progress or (lambda _: None),
    )
    with new_folder(target, root) as folder:
        about = chosen.write(source, folder)
        if not source.rows:
            raise UsageError(f"{root}: no row is left to export; choose another --missing or --landmarks")
        if about:
            (folder / CARD_FILE).write_text(readme(source, name, about), encoding="utf-8")
    withheld = kept_back.rows if options.only_redistributable else 0
    return Exported(
        target, name, source.rows, len(heads), source.left_out, source.filled, withheld, source.landmarks
    )


def _sound(root: Path) -> Manifest:
    """The manifest of a dataset whose tables, sizes, footers and rows it is right about.

    The rows are not read for it: their names and images are checked while they are exported.
    Raises DatasetError, with the first thing that is wrong.
    """
    manifest = read_manifest(root)
    report = verify_dataset(root, quick=True)
    # No export reads the anchors; and where units failed, rows are missing and the manifest says so.
    spared = {"anchors", *(["rows"] if manifest.failures else [])}
    for check in report.checks:
        if check.problems and check.name not in spared:
            raise DatasetError(f"{root}: {check.problems[0]}; nothing was exported, see `headturn verify`")
    return manifest


def _landmarks(root: Path, heads: list[HeadRow], choice: str, topology: Topology) -> str:
    """Where the landmarks come from: one answer for the whole export."""
    without = [f"{head.subject}/{head.expression}" for head in heads if head.anchor_absent == topology.count]
    if choice == "exact" and len(without) == len(heads):
        raise UsageError(
            f"{root}: no head has exact landmarks (first: {without[0]}); take --landmarks detected"
        )
    if choice == "auto":
        return "detected" if without else "exact"
    return choice
