# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``headturn heads list`` shows."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

from generator.errors import HeadError
from generator.escape import printable
from generator.heads.head import Head, HeadSource
from generator.heads.read import ImportWithBlender, read_mesh
from generator.heads.textures import image_size


def describe_source(
    source: HeadSource, *, deep: bool, import_with_blender: ImportWithBlender | None = None
) -> list[dict[str, Any]]:
    """A row per head, then one per skipped head, with plain values only.

    Keys: subject, expression, source, path, vertices, triangles, texture
    ([width, height] of the first), vertex_colors, license, redistributable,
    units (None: to be guessed), problems (list of lines), skipped (bool: a build would leave it out).
    What is not known, or not looked for without ``deep``, is None.

    deep: read every mesh and texture; what fails becomes a problem of its row, which is then skipped.
    """
    rows = [_describe(head, deep, import_with_blender) for head in source.heads]
    for skip in source.skipped:
        row = _row(skip.subject, skip.expression, source.kind, skip.path)
        rows.append({**row, "problems": [skip.reason], "skipped": True})
    return rows


def _row(subject: str, expression: str, source: str, path: Path) -> dict[str, Any]:
    unknown = ("vertices", "triangles", "texture", "vertex_colors", "license", "redistributable", "units")
    identity = {"subject": subject, "expression": expression, "source": source, "path": printable(str(path))}
    return {**identity, **dict.fromkeys(unknown), "problems": [], "skipped": False}


def _describe(head: Head, deep: bool, import_with_blender: ImportWithBlender | None) -> dict[str, Any]:
    row = _row(head.subject, head.expression, head.source, head.mesh_path)
    row |= {"license": head.license, "redistributable": head.redistributable, "units": head.units}
    row["problems"] = list(head.problems)
    if not deep:
        return row
    try:
        with tempfile.TemporaryDirectory(prefix="headturn-") as scratch:
            mesh = read_mesh(head, Path(scratch), import_with_blender=import_with_blender)
            texture = next((m.texture for m in mesh.materials if m.texture), None)
            row["texture"] = list(image_size(texture)) if texture else None
    except HeadError as error:
        row["problems"].append(str(error))
        row["skipped"] = True
        return row
    row |= {"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)}
    row["vertex_colors"] = mesh.vertex_colors is not None
    row["problems"] += mesh.problems
    return row
