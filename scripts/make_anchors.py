# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the anchors that all parametric heads share: generator/landmarks/parametric_anchors.csv.

    python scripts/make_anchors.py [--heads 24] [--model canonical_face.csv] [--zero | --check]

Places heads one by one, each by 14 detections of its own, averages what was found on the mean head, and
prints how far single heads are from it. A few minutes. ``--model`` is the detector's own model face, a
table of x,y,z: where the detector reads our reference face by it is ``level_pitch_deg`` of
generator/landmarks/topology.py. ``--check`` writes nothing.

Shapes are fitted to these points (scripts/fit_faces.py), and where a detector finds them follows shapes in
turn, farther each time. So they were found once, on MakeHuman's own shapes, and stay; after a change of
shapes ``--zero`` measures anew where the detector reads level, and nothing else.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, angles_from_rotation, graphics_rotation
from generator.heads.parametric.folder import head_triangles
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.landmarks.facing import facing
from generator.landmarks.shared import SharedAnchors, packaged, write_shared
from generator.landmarks.topology import FACE_MESH
from generator.placing.placer import Placer, own_anchors
from generator.placing.sharing import OwnAnchors, share
from generator.plan.settings import Landmarks

TARGET = Path(__file__).resolve().parents[1] / "generator" / "landmarks" / FACE_MESH.packaged_anchors[0]
SEED = 2024


def found_alone(count: int) -> list[OwnAnchors]:
    """Neutral parametric heads, each with the anchors that were found on it alone."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        make_heads(root / "heads", count=count, seed=SEED)
        (root / "scratch").mkdir()
        lane = Lane(LaneOptions(scratch=str(root / "scratch")))
        found = []
        try:
            placer = Placer(lane.renderer, lane.detector(Landmarks()), root / "scratch", lane.read)
            for head in find_heads(root / "heads").heads:
                placed = placer.subject([head], "source")
                [facts] = placed.facts
                if facts.anchors is None or not facts.anchors.views:
                    raise SystemExit(f"{head.name}: no face was found")
                found.append(own_anchors(lane.read(head), placed.placement, facts.anchors))
        finally:
            lane.close()
    return found


def with_points_of(points: SharedAnchors, found: list[OwnAnchors], zero: SharedAnchors) -> SharedAnchors:
    """Anchors whose places are some, and whose pose zero is others'; their points are the mean over heads."""
    where = [points.points(head.mesh.vertices, head.mesh.triangles) for head in found]
    there = np.mean(where, axis=0) @ CAMERA_FROM_GRAPHICS
    return replace(
        points,
        anchors=replace(points.anchors, points=there),
        correction=zero.correction,
        correction_sd_deg=zero.correction_sd_deg,
    )


def report(found: list[OwnAnchors], shared: SharedAnchors) -> None:
    """Print how far single heads' anchors and zeros are from what they share."""
    apart = []
    for head in found:
        own = head.mesh.vertices[head.mesh.triangles[head.anchors.triangles]]
        own = (head.anchors.weights[:, :, None] * own).sum(1)
        apart.append(np.linalg.norm(own - shared.points(head.mesh.vertices, head.mesh.triangles), axis=1))
    level = graphics_rotation(np.reshape(shared.correction, (3, 3)))
    own, turned = (
        facing(points, FACE_MESH) for points in (shared.anchors.points, shared.anchors.points @ level.T)
    )
    assert own is not None and turned is not None, "all points are there"
    surface, at_level = (angles_from_rotation(fit)[1] for fit in (own, turned))
    detector = angles_from_rotation(level.T)[1]
    print(
        f"pitch of the heads' own axes: {detector:.2f} by the detector, {surface:.2f} by the surface; ",
        end="",
    )
    print(f"at pose zero level: 0.00 and {at_level:.2f}")
    zeros = angles_from_rotation(graphics_rotation(np.stack([head.correction for head in found])))
    print(f"{len(found)} heads, {shared.anchors.views} detections")
    print(f"single heads' anchors from the shared: median {np.nanmedian(apart):.2f} mm, ", end="")
    print(f"95 % within {np.nanpercentile(apart, 95):.2f} mm")
    halves = [share(found[k::2], FACE_MESH, count=shared.count, way="package").anchors.points for k in (0, 1)]
    between = np.linalg.norm((halves[0] - halves[0].mean(0)) - (halves[1] - halves[1].mean(0)), axis=1)
    print(f"those of half of the heads from those of the others: median {np.median(between):.2f} mm")
    for name, values in zip(("yaw", "pitch", "roll"), zeros.T, strict=True):
        print(f"axes to level, {name}: mean {values.mean():.2f} degrees, sd {values.std(ddof=1):.2f} a head")


def level_pitch(model: Path) -> float:
    """Pitch of the reference face as the rigid fit of a model face reads it, degrees."""
    points = np.loadtxt(model, delimiter=",", comments="#")
    reference = FACE_MESH.reference_face() @ CAMERA_FROM_GRAPHICS
    fit = fit_similarity(points @ CAMERA_FROM_GRAPHICS, reference)
    return float(angles_from_rotation(fit.rotation)[1])


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--heads", type=int, default=24)
    parser.add_argument("--model", type=Path)
    parser.add_argument("--zero", action="store_true")
    parser.add_argument("--check", action="store_true")
    wanted = parser.parse_args()
    if wanted.model is not None:
        print(f"level_pitch_deg: {level_pitch(wanted.model):.3f}, used: {FACE_MESH.level_pitch_deg}")
    found = found_alone(wanted.heads)
    count = len(head_triangles(long_hair=False)[0])
    shared = share(found, FACE_MESH, count=count, way="package")
    if wanted.zero:
        shared = with_points_of(packaged(FACE_MESH)[0], found, shared)
    report(found, shared)
    if not wanted.check:
        write_shared(shared, TARGET, "scripts/make_anchors.py")
        print(f"{TARGET.name} written")


if __name__ == "__main__":
    main()
