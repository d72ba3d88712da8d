# SPDX-License-Identifier: GPL-3.0-or-later
"""report.html: everything in one file that needs no network."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

from generator.dataset.format.dataset_poses import read_dataset_poses
from generator.dataset.format.files import write_anywhere
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import dataset_topology
from generator.dataset.show.report.atlas import collect_atlases
from generator.dataset.show.report.cells import PoseCells
from generator.dataset.show.report.facts import build_facts, head_facts, why_no_atlas
from generator.dataset.show.report.tiles import contact_sheet, thumbnails
from generator.dataset.show.report.twins import collect_twins
from generator.dataset.show.report.variety import collect_variety
from generator.escape import html_json


def write_report(root: Path, page: Path, progress: Callable[[int], None] | None = None) -> int:
    """Write the page; returns its size in bytes.

    progress: called with the number of rows read.

    Raises
    ------
    DatasetError: the dataset is not finished, of another version, or damaged;
        or the page cannot be written.
    """
    text = page_text(report_data(Path(root), progress or (lambda _: None)))
    write_anywhere(Path(page), text.encode())
    return len(text.encode())


def report_data(root: Path, progress: Callable[[int], None]) -> dict[str, Any]:
    """What the page shows, as plain values. Raises DatasetError as :func:`write_report` does."""
    manifest, heads = read_manifest(root), read_heads(root)
    poses = read_dataset_poses(root, heads)
    cells = PoseCells.of(poses)
    topology = dataset_topology(root, manifest)
    atlases = collect_atlases(root, manifest, heads, cells, progress, topology)
    atlas = next(iter(atlases.values()))
    return {
        "rows": manifest.rows,
        "heads_count": manifest.heads,
        "publishable": sum(head.redistributable for head in heads),
        "poses": poses.most,
        "images": manifest.images,
        "why_no_atlas": why_no_atlas(heads, atlas),
        **atlas.frame(),
        "detectors": [{"name": name, **one.as_dict()} for name, one in atlases.items()],
        "variety": collect_variety(root, manifest, heads),
        "twins": collect_twins(root, manifest),
        "sheet": contact_sheet(root, manifest, heads, poses, topology),
        "heads": head_facts(heads, thumbnails(root, manifest, heads, poses), atlas),
        "build": build_facts(root, manifest),
    }


def page_text(data: dict[str, Any]) -> str:
    """The page with its style, its script and its data inside."""
    folder = files("generator.dataset.show.report")
    template, style, script = (
        folder.joinpath(name).read_text(encoding="utf-8") for name in ("page.html", "page.css", "page.js")
    )
    for mark, content in (("/*STYLE*/", style), ("/*SCRIPT*/", script), ("/*DATA*/", html_json(data))):
        head, _, tail = template.partition(mark)
        template = head + content + tail
    return template
