# SPDX-License-Identifier: GPL-3.0-or-later
"""The detector, asked independently, sees the pose that the labels claim."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from placed_head import PlacedHead
from scipy.spatial.transform import Rotation

from generator.execution.lanes.renderer import Renderer
from generator.geometry.rotation import geodesic_deg, rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.landmarks.reference_face import fit_pose
from generator.landmarks.topology import FACE_MESH
from generator.placing.face import find_face
from generator.placing.looking import Eyes
from generator.placing.rendering import read_image
from generator.plan.config import BuildConfig
from generator.plan.settings import Render
from generator.plan.view_plan import plan_views

POSES = np.array(
    [
        [0, 0, 0],
        [30, 0, 0],
        [-30, 0, 0],
        [0, 25, 0],
        [0, -20, 0],
        [0, 0, 30],
        [0, 0, -30],
        [25, 15, 20],
        [-25, -10, -20],
    ],
    dtype=float,
)
LOOK = BuildConfig(render=Render(resolution=256, lens_mm=135.0, samples=2))


def disagreement(
    mesh: HeadMesh, radius_mm: float, renderer: Renderer, detector: MediaPipeFaceMesh, folder: Path
) -> np.ndarray:
    """Geodesic degrees between label and detector, the head's one constant offset taken out."""
    package = folder / "head.npz"
    save_package(mesh, package)
    views = plan_views(LOOK, "a/neutral", radius_mm, [tuple(pose) for pose in POSES.tolist()])
    labels, seen = [], []
    for pose, path in zip(POSES, renderer.render(package, views), strict=True):
        found = detector.detect(read_image(path))
        assert found is not None, f"no face at {pose}"
        labels.append(rotation_from_angles(pose))
        seen.append(fit_pose(found).rotation)
    r_c, fitted = np.stack(labels), np.stack(seen)
    offset = Rotation.from_matrix(np.swapaxes(r_c, 1, 2) @ fitted).mean().as_matrix()
    return geodesic_deg(r_c @ offset, fitted)


def test_on_a_parametric_head(
    placed_head: PlacedHead, renderer: Renderer, detector: MediaPipeFaceMesh, tmp_path: Path
) -> None:
    error = disagreement(placed_head.mesh, placed_head.placement.radius_mm, renderer, detector, tmp_path)
    assert np.median(error) < 5
    assert error.max() < 10


@pytest.mark.parametrize("name", ["lee_perry_smith_obj", "makehuman_asian_young_f"])
def test_on_real_heads(
    name: str, shared_heads: Path, renderer: Renderer, detector: MediaPipeFaceMesh, tmp_path: Path
) -> None:
    [head] = find_heads(shared_heads / name).heads
    mesh = read_mesh(head, tmp_path)
    placement = find_face(head, mesh, Eyes(renderer, detector, tmp_path))
    error = disagreement(placement.normalise(mesh), placement.radius_mm, renderer, detector, tmp_path)
    assert np.median(error) < 5
    assert error.max() < 10


def test_landmarks_are_isotropic_pixels(
    placed_head: PlacedHead, renderer: Renderer, detector, tmp_path
) -> None:
    """x and y lie on the face in the image, z shrinks towards the camera at the nose."""
    package = tmp_path / "head.npz"
    save_package(placed_head.mesh, package)
    [path] = renderer.render(
        package, plan_views(LOOK, "a/neutral", placed_head.placement.radius_mm, [(0, 0, 0)])
    )
    found = detector.detect(read_image(path))
    assert found.shape == (468, 3)
    assert found.dtype == np.float32
    assert 60 < found[:, :2].mean() < 200
    assert found[1, 2] == found[:, 2].min() or found[4, 2] == found[:, 2].min(), "the nose tip is nearest"


def test_an_image_without_a_face_is_none(detector: MediaPipeFaceMesh) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (128, 128, 3), dtype=np.uint8)
    assert detector.detect(noise) is None


def test_the_reference_face_is_symmetric_and_faces_the_viewer() -> None:
    face = FACE_MESH.reference_face()
    assert np.abs(face[33] * [-1, 1, 1] - face[263]).max() < 0.05
    assert face[1, 2] > face[:, 2].mean() + 20, "the nose points to +z"
    assert face[152, 1] < face[10, 1], "the chin is below the forehead"
