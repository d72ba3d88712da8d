# SPDX-License-Identifier: GPL-3.0-or-later
"""A prepared head on disk: one .npz that a render worker loads with numpy alone.

Vertices are in frame U, in millimetres, with the pivot at the origin. Texture
paths point to the source's own files.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from generator.codec import from_plain, to_plain
from generator.heads.mesh import HeadMesh, Material
from generator.heads.scene import BlendScene


def save_package(mesh: HeadMesh, path: Path) -> None:
    """Write mesh (frame U, mm, pivot at the origin) to path (.npz)."""
    materials = [
        {
            "name": m.name,
            "base_color": list(m.base_color),
            "texture": str(m.texture) if m.texture else None,
            "cutout": m.cutout,
            "tint": list(m.tint),
            "vertex_tint": m.vertex_tint,
            "wrap": m.wrap,
            "label": m.label,
            "label_map": str(m.label_map) if m.label_map else None,
            "gloss": m.gloss,
            "opacity": m.opacity,
        }
        for m in mesh.materials
    ]
    arrays = {
        "vertices": mesh.vertices,
        "triangles": mesh.triangles,
        "material_index": mesh.material_index,
        "materials": np.array(json.dumps(materials)),
    }
    if mesh.uv is not None:
        arrays["uv"] = mesh.uv
    if mesh.vertex_colors is not None:
        arrays["vertex_colors"] = mesh.vertex_colors
    if mesh.openness is not None:
        arrays["openness"] = mesh.openness
    if mesh.problems:
        arrays["problems"] = np.array(json.dumps(mesh.problems))
    if mesh.scene is not None:
        arrays["scene"] = np.array(json.dumps(to_plain(mesh.scene)))
    np.savez(path, **arrays)


def load_package(path: Path) -> HeadMesh:
    """The inverse of :func:`save_package`. Never unpickles.

    Packages of earlier releases say nothing of tints, wrap and what comes behind it, and knew none of them.
    """
    with np.load(path, allow_pickle=False) as data:
        materials = tuple(
            Material(
                m["name"],
                tuple(m["base_color"]),
                Path(m["texture"]) if m["texture"] else None,
                m["cutout"],
                tuple(m.get("tint", Material.tint)),
                m.get("vertex_tint", Material.vertex_tint),
                m.get("wrap", Material.wrap),
                m.get("label", Material.label),
                Path(m["label_map"]) if m.get("label_map") else None,
                m.get("gloss", Material.gloss),
                m.get("opacity", Material.opacity),
            )
            for m in json.loads(str(data["materials"]))
        )
        return HeadMesh(
            vertices=data["vertices"],
            triangles=data["triangles"],
            uv=data["uv"] if "uv" in data else None,
            vertex_colors=data["vertex_colors"] if "vertex_colors" in data else None,
            material_index=data["material_index"],
            materials=materials,
            openness=data["openness"] if "openness" in data else None,
            problems=tuple(json.loads(str(data["problems"]))) if "problems" in data else (),
            scene=from_plain(BlendScene, json.loads(str(data["scene"]))) if "scene" in data else None,
        )
