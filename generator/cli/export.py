# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn export`` and ``headturn report``."""

from __future__ import annotations

import json
from dataclasses import asdict
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import JsonFlag, err, out
from generator.cli.reporter import TerminalReporter


class FormatName(str, Enum):
    """Choices of --format."""

    nlml_hpe = "nlml-hpe"
    w300_lp = "300w-lp"
    sixdrepnet = "6drepnet"
    biwi = "biwi"
    huggingface = "huggingface"
    croissant = "croissant"
    coco = "coco"


class LandmarksName(str, Enum):
    """Choices of --landmarks."""

    auto = "auto"
    exact = "exact"
    detected = "detected"


class MissingName(str, Enum):
    """Choices of --missing."""

    keep = "keep"
    skip = "skip"
    exact = "exact"
    fail = "fail"


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A dataset made by headturn build.")],
    format_: Annotated[FormatName, typer.Option("--format", help="The form to write.")],
    target: Annotated[Path, typer.Option("--out", help="Folder of the export; must be new or empty.")],
    landmarks: Annotated[
        LandmarksName,
        typer.Option(
            help="Of formats with landmarks: the mesh's, the detector's; auto: the mesh's if all have."
        ),
    ] = LandmarksName.auto,
    missing: Annotated[
        MissingName | None,
        typer.Option(help="Rows without a detection or landmarks: keep, skip, fill with exact, or fail."),
    ] = None,
    public: Annotated[
        bool, typer.Option("--public", help="It will be published, whatever the format.")
    ] = False,
    only_redistributable: Annotated[
        bool, typer.Option("--only-redistributable", help="Leave out heads that may not be published.")
    ] = False,
    may_publish: Annotated[
        bool,
        typer.Option("--i-may-publish-these-heads", help="I hold the right to publish all of these heads."),
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Write a dataset in another form: for other code, or for publication.

    huggingface and croissant are meant for publication: they refuse heads that may not be published.
    """
    from generator.dataset.export.options import ExportOptions
    from generator.dataset.export.run import export_dataset
    from generator.dataset.format.manifest import read_manifest

    options = ExportOptions(
        landmarks=landmarks.value,
        missing=missing.value if missing else None,
        public=public,
        only_redistributable=only_redistributable,
        may_publish=may_publish,
    )
    with TerminalReporter(err) as reporter:
        reporter.stage(f"{format_.value} export", read_manifest(folder).rows)
        done = export_dataset(folder, format_.value, target, options, reporter.advance)
    if as_json:
        typer.echo(json.dumps({**asdict(done), "target": str(done.target)}))
        return
    landmarks_used = f", {done.landmarks} landmarks" if done.landmarks else ""
    lines = [f"{done.rows} rows of {done.heads} heads as {done.format}{landmarks_used} in {done.target}"]
    if done.filled:
        lines.append(f"filled    {done.filled} rows with exact landmarks, each marked")
    if done.left_out:
        lines.append(f"left out  {done.left_out} rows without a detection or landmarks")
    if done.withheld:
        lines.append(f"left out  {done.withheld} rows that may not be published")
    lines.append(f"read      {done.target / 'README.md'}")
    for line in lines:
        out.print(line, highlight=False, markup=False, soft_wrap=True)


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A dataset made by headturn build.")],
    page: Annotated[
        Path | None, typer.Option("--out", help="The page; report.html in the dataset if absent.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Write report.html: images, detection, the detector's error, heads, licences. One file, no network."""
    from generator.dataset.format.manifest import read_manifest
    from generator.dataset.show.report.page import write_report

    page = page or folder / "report.html"
    with TerminalReporter(err) as reporter:
        reporter.stage("report", read_manifest(folder).rows)
        size = write_report(folder, page, reporter.advance)
    if as_json:
        typer.echo(json.dumps({"page": str(page), "bytes": size}))
    else:
        out.print(f"{page} ({size / 1e6:.1f} MB)", highlight=False, markup=False, soft_wrap=True)


def register(app: typer.Typer) -> None:
    """Add both commands."""
    app.command(epilog="Example: headturn export dataset --format 300w-lp --out dataset-300w-lp")(export)
    app.command(epilog="Example: headturn report dataset --out report.html")(report)
