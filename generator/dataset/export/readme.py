# SPDX-License-Identifier: GPL-3.0-or-later
"""README.md of an export: what it is, what was left out, under which licences."""

from __future__ import annotations

from generator.dataset.export.options import OVERRIDE
from generator.dataset.export.source import Source
from generator.dataset.format.missing import Missing
from generator.dataset.format.schema import conventions as conventions_of
from generator.dataset.show.card import licences_text
from generator.dataset.show.column_tables import markdown_table
from generator.escape import markdown, markdown_code

_MISSING: dict[Missing, str] = {
    "keep": "kept: their labels are exact all the same",
    "skip": "left out",
    "exact": "filled with the exact landmarks, each marked as such",
    "fail": "there are none",
}


def facts(source: Source, name: str) -> str:
    """What this export is and where it comes from, as Markdown."""
    manifest = source.manifest
    rows = [
        ("format", name),
        ("rows", f"{source.rows} of {manifest.rows}"),
        ("heads", f"{len(source.heads)} of {manifest.heads}"),
        (f"rows without {'landmarks' if source.landmarks else 'a detection'}", _MISSING[source.missing]),
        ("made from", f"content digest {markdown_code(manifest.digest)}"),
        ("rebuilt by", markdown_code(manifest.created_by)),
        ("versions", ", ".join(markdown(f"{k} {v}") for k, v in sorted(manifest.versions.items()))),
    ]
    if source.left_out:
        rows.insert(2, ("rows left out", f"{source.left_out}, for lack of a detection or landmarks"))
    if source.landmarks:
        filled = f", {source.filled} rows filled with exact ones" if source.filled else ""
        rows.insert(2, ("landmarks", source.landmarks + filled))
    return markdown_table(("what", "value"), rows)


def licences(source: Source) -> str:
    """The licences of what is inside, what was left out, and what was overridden."""
    text = licences_text(source.heads)
    if source.options.only_redistributable:
        text += "\n\nOnly heads whose images may be published are in this export."
    if source.options.may_publish and not all(head.redistributable for head in source.heads):
        text += (
            f"\n\nIt was exported with `{OVERRIDE}`: whoever made it says that they may publish these heads."
        )
    return text


def conventions(source: Source) -> str:
    """The conventions of the dataset, as Markdown."""
    return markdown_table(("what", "definition"), tuple(conventions_of(source.topology).items()))


def readme(source: Source, name: str, about: str) -> str:
    """The whole text."""
    sections = [
        f"# Head poses, exported as {name}",
        facts(source, name),
        "## Format\n\n" + about.rstrip(),
        "## Licences\n\n" + licences(source),
        "## Conventions of the dataset\n\n" + conventions(source),
    ]
    return "\n\n".join(sections) + "\n"
