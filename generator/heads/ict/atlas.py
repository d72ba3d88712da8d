# SPDX-License-Identifier: GPL-3.0-or-later
"""The atlas of ICT-FaceKit's mesh: what every texel of skin.png lies on, where paint is defined."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from generator.heads.ict.mesh import PARTS, IctMesh, ict_mesh
from generator.heads.ict.warp import Warp, warp_onto_base
from generator.heads.parametric.atlas import (
    LID_REACH,
    LIP_REACH,
    Atlas,
    along_loop,
    distance_to,
    head_atlas,
    texels_in_use,
)
from generator.heads.parametric.noise import smoothstep
from generator.heads.parametric.template import PARTS as TEMPLATE_PARTS
from generator.heads.parametric.template import head_template

IN_ATLAS = ("skin", "mouth", "socket_left", "socket_right", "gums", "teeth")
GUMS, TEETH = len(TEMPLATE_PARTS), len(TEMPLATE_PARTS) + 1
"""Of ``Atlas.part``: what the shared paint knows nothing of."""

_REACH = 0.06
"""Farther than so, dm, from lips or ears of the base mesh there are none."""


@dataclass(frozen=True, eq=False)
class Surface:
    """What all heads of a copy share. ear_distance, lip_distance: of every vertex from the ears, and
    from the line between the lips, canonical dm [V]; the latter is infinite but on skin and in the mouth.

    of_template: int [B], the vertex that lies where each vertex of MakeHuman's template does.
    """

    mesh: IctMesh
    warp: Warp
    atlas: Atlas
    ear_distance: np.ndarray
    lip_distance: np.ndarray
    of_template: np.ndarray


@lru_cache(maxsize=1)
def ict_surface(folder: Path) -> Surface:
    """The mesh of a folder's copy with its atlas. Some seconds, once a process."""
    mesh = ict_mesh(folder)
    warp = warp_onto_base(mesh)
    base = head_atlas()
    skin = np.unique(mesh.triangles[mesh.of_part("skin")])
    lips = along_loop(warp.points, mesh.triangles[mesh.of_part("skin")], mesh.lip_margin)
    lip_distance = np.full(len(warp.points), np.inf)
    soft = np.unique(mesh.triangles[mesh.of_part("skin", "mouth")])
    lip_distance[soft] = cKDTree(lips).query(warp.points[soft])[0]
    return Surface(
        mesh=mesh,
        warp=warp,
        atlas=_atlas(mesh, warp.points, base),
        ear_distance=cKDTree(base.points[base.ears > 0.5][::7]).query(warp.points)[0],
        lip_distance=lip_distance,
        of_template=skin[cKDTree(warp.points[skin]).query(head_template().canonical)[1]],
    )


def _atlas(mesh: IctMesh, canonical: np.ndarray, base: Atlas) -> Atlas:
    drawn, skin_triangles = mesh.of_part(*IN_ATLAS), mesh.triangles[mesh.of_part("skin")]
    texels = texels_in_use(mesh.uv[mesh.corners[drawn]])
    triangles = mesh.triangles[drawn]
    points = texels.blend(canonical, triangles)
    names = [*TEMPLATE_PARTS, "gums", "teeth"]
    part = np.array([names.index(PARTS[k]) for k in mesh.part[drawn]], dtype=np.int8)[texels.triangle]
    skin = part == TEMPLATE_PARTS.index("skin")
    lids, lips = (along_loop(canonical, skin_triangles, loop) for loop in (mesh.lid_margin, mesh.lip_margin))
    lid = distance_to(lids, points, LID_REACH)
    closed = texels.blend(_occlusion(canonical, base), triangles)

    def mask(theirs: np.ndarray) -> np.ndarray:
        """A mask of the base mesh at the texels that lie nearest."""
        bare = base.is_part("skin")
        there = base.points[(theirs > 0) & bare]
        low, high = there.min(0) - _REACH, there.max(0) + _REACH
        around = ((base.points > low) & (base.points < high)).all(2) & bare
        ours = ((points > low) & (points < high)).all(1) & skin
        found = np.zeros(part.shape, dtype=np.float32)
        found[ours] = theirs[around][cKDTree(base.points[around]).query(points[ours])[1]]
        return found

    return texels.atlas(
        points=points,
        part=part,
        # Lids that close show what is folded in when they are open.
        occlusion=closed * (0.25 + 0.75 * smoothstep(0.06, 0.15, lid)),
        lid=lid,
        lip_seam=distance_to(lips, points, LIP_REACH),
        lips=mask(base.lips),
        ears=mask(base.ears),
    )


def _occlusion(canonical: np.ndarray, base: Atlas) -> np.ndarray:
    """How closed in points [V, 3] are, [V]: as the base mesh is around there, which has other folds."""
    skin = base.is_part("skin")
    near = cKDTree(base.points[skin][::5]).query(canonical, k=24)[1]
    return base.occlusion[skin][::5][near].mean(1)
