# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's own things, put on a head by their points of attachment."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError, UsageError
from generator.geometry.rigid import fit_rotations, fit_similarity
from generator.heads.head import NEUTRAL, Head
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.plan.config import BuildConfig
from generator.plan.thing import MM_PER_UNIT, SUFFIXES, Attachment, read_attachment
from generator.plan.wear import NOTHING
from generator.worn.fit import CannotWear, Fit, Kind


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`. style: the name of the thing; it is the same for every rng."""
    path = find(Path(fit.things), style)
    try:
        said = read_attachment(path)
        mesh = read(path, Path(fit.scratch) / path.name)
    except (UsageError, HeadError) as error:
        raise CannotWear(str(error)) from error
    targets = fit.at(*(landmark for landmark, _ in said.points))
    return attached(mesh, said, targets)


def check_things(config: BuildConfig) -> None:
    """Can the meshes of the things that a settled configuration names be read? Raises UsageError if not."""
    drawn = config.drawn.get("render.thing")
    for name in dict.fromkeys(drawn.texts if drawn else (config.render.thing,)):
        if name == NOTHING:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            try:
                read(find(config.located(config.render.things or ""), name), Path(scratch) / name)
            except HeadError as error:
                raise UsageError(f"render.things: {error}") from error


def find(folder: Path, name: str) -> Path:
    """The mesh of a thing. Raises CannotWear if it is not there."""
    for suffix in SUFFIXES:
        for path in (folder / f"{name}{suffix}", folder / f"{name}{suffix.upper()}"):
            if path.is_file():
                return path
    raise CannotWear(f"{folder}: no {name!r} is in it")


def read(path: Path, scratch: Path) -> HeadMesh:
    """A thing's mesh in its own units; textures that it embeds go into a folder of their own.

    Raises HeadError: it cannot be read, or a texture has a name that does not begin with the thing's.
    """
    scratch.mkdir(parents=True, exist_ok=True)
    mesh = read_mesh(Head(path.stem, NEUTRAL, "mesh", path, (path,)), scratch)
    for material in mesh.materials:
        texture = material.texture
        if texture is not None and scratch not in texture.parents and not texture.name.startswith(path.stem):
            raise HeadError(
                f"{path}: its texture {texture.name} is to have a name that begins with {path.stem}"
            )
    return mesh


def attached(mesh: HeadMesh, said: Attachment, targets: np.ndarray) -> HeadMesh:
    """A thing where its points meet landmarks best, in the least squares; targets: float [N, 3], frame U, mm.

    Rigid where its units are known, else scaled, too.
    """
    points = np.array([place for _, place in said.points])
    if said.units is None:
        found = fit_similarity(points, targets)
        scale, rotation = found.scale, found.rotation
    else:
        scale, rotation = MM_PER_UNIT[said.units], fit_rotations(points, targets[None])[0]
    moved = scale * (mesh.vertices - points.mean(axis=0)) @ rotation.T + targets.mean(axis=0)
    materials = tuple(
        replace(
            material,
            label=said.label,
            opacity=material.opacity if said.opacity is None else said.opacity,
            gloss=material.gloss if said.gloss is None else said.gloss,
        )
        for material in mesh.materials
    )
    return replace(mesh, vertices=moved, materials=materials)


KIND = Kind(make)
