# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn export`` and ``headturn report``."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, cast

import typer

from generator.cli.console import JsonFlag, err, say
from generator.cli.reporter import TerminalReporter
from generator.registries import FORMATS
from generator.words import plural

_FORMATS = ", ".join(FORMATS)


def export(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A dataset made by headturn build.")],
    format_: Annotated[str, typer.Option("--format", help=f"The form to write: {_FORMATS}.")],
    target: Annotated[Path, typer.Option("--out", help="Folder of the export; must be new or empty.")],
    landmarks: Annotated[
        str,
        typer.Option(
            help="Exact landmarks (the mesh's), detected ones, or auto: exact if all heads have them."
        ),
    ] = "auto",
    missing: Annotated[
        str | None,
        typer.Option(help="Rows without a detection or landmarks: fail, keep, skip, or exact to fill."),
    ] = None,
    image_format: Annotated[
        str | None,
        typer.Option(
            "--image-format", help="For nlml-hpe, whose versions look for one or the other: jpg or png."
        ),
    ] = None,
    public: Annotated[
        bool, typer.Option("--public", help="The export will be published, whatever the format.")
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
    from generator.dataset.export.options import ExportOptions, Format, ImageFormat, Landmarks
    from generator.dataset.export.run import export_dataset
    from generator.dataset.format.manifest import read_manifest
    from generator.dataset.format.missing import Missing

    chosen: Format = FORMATS.get(format_)  # before anything is read
    # All three are checked where they are used, against what the format takes.
    options = ExportOptions(
        landmarks=cast(Landmarks, landmarks),
        missing=cast("Missing | None", missing),
        image_format=cast("ImageFormat | None", image_format),
        public=public,
        only_redistributable=only_redistributable,
        may_publish=may_publish,
    )
    with TerminalReporter(err) as reporter:
        reporter.stage(f"{format_} export", read_manifest(folder).rows)
        done = export_dataset(folder, format_, target, options, reporter.advance)
    if as_json:
        typer.echo(json.dumps({**asdict(done), "target": str(done.target)}))
        return
    landmarks_used = f", {done.landmarks} landmarks" if done.landmarks else ""
    what = f"{plural(done.rows, 'row')} of {plural(done.heads, 'head')}"
    lines = [f"{what} as {done.format}{landmarks_used} in {done.target}"]
    if done.filled:
        lines.append(f"filled    {plural(done.filled, 'row')} with exact landmarks, each marked")
    if done.left_out:
        lines.append(f"left out  {plural(done.left_out, 'row')} without a detection or landmarks")
    if done.withheld:
        lines.append(f"left out  {plural(done.withheld, 'row')} that may not be published")
    if chosen.note:
        lines.append(f"note      {chosen.note}")
    lines.append(f"read      {done.target / 'README.md'}")
    for line in lines:
        say(line)


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
        say(f"{page} ({size / 1e6:.1f} MB)")


def register(app: typer.Typer) -> None:
    """Add both commands."""
    app.command(epilog="Example: headturn export dataset --format 300w-lp --out dataset-300w-lp")(export)
    app.command(epilog="Example: headturn report dataset --out report.html")(report)
