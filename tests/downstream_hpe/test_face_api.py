# SPDX-License-Identifier: MIT
"""What benchmarks/face_api.py computes, on made-up faces and a made-up package."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import rotation_from_angles

pytestmark = pytest.mark.slow

for needed in ("torch", "cv2"):
    pytest.importorskip(needed, reason=f"{needed} is not installed")
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))

import face_api  # noqa: E402  # where the benchmarks lie


def test_a_flat_face_tells_the_rotation():
    face, rng = mean_head()[face_api.INNER], np.random.default_rng(0)
    rotation = rotation_from_angles(rng.uniform(-50, 50, (40, 3)))
    turned = face @ np.swapaxes(rotation, 1, 2)
    flat = 0.7 * turned[..., :2] + rng.uniform(-99, 99, (40, 1, 2))
    found = np.array([face_api.fitted(face, points) for points in flat])
    assert geodesic_errors(found, rotation).max() < 0.01


def test_what_a_detector_means_by_its_points_is_learned():
    rng = np.random.default_rng(0)
    rotation = rotation_from_angles(rng.uniform(-50, 50, (40, 3)))
    exact = mean_head()[face_api.INNER] @ np.swapaxes(rotation, 1, 2) + rng.uniform(-99, 99, (40, 1, 3))
    meant = rng.normal(0, 50, (68, 3))
    seen = (meant @ np.swapaxes(rotation, 1, 2) + exact.mean(axis=1, keepdims=True))[..., :2]
    face = face_api.learned(seen, rotation, exact)
    size = np.sqrt(np.square(exact[0] - exact[0].mean(axis=0)).sum(axis=1).mean())
    np.testing.assert_allclose(face * size, meant, atol=1e-6)


def package(folder: Path) -> Path:
    """One whose convolutions give nothing but a bias of 1 in the last, and whose fc/bias counts up."""
    entries, content = [], b""

    def add(name: str, shape: tuple[int, ...], byte: bytes, scale: float = 1.0, least: float = 0.0) -> None:
        nonlocal content
        entries.append({"name": name, "shape": shape, "quantization": {"scale": scale, "min": least}})
        content += byte if len(byte) > 1 else byte * int(np.prod(shape))

    wide = 3
    for block, out in enumerate((32, 64, 128, 256)):
        for layer in range(4):
            if block == layer == 0:
                add("dense0/conv0/filters", (3, 3, 3, out), b"\0")
            else:
                add(f"dense{block}/conv{layer}/depthwise_filter", (3, 3, wide, 1), b"\0")
                add(f"dense{block}/conv{layer}/pointwise_filter", (1, 1, wide, out), b"\0")
            add(f"dense{block}/conv{layer}/bias", (out,), b"\1" if block == layer == 3 else b"\0")
            wide = out
    add("fc/weights", (256, 136), b"\2", 1 / 512)
    add("fc/bias", (136,), bytes(range(136)), 0.5, -3)
    (folder / "model").mkdir()
    (folder / f"{face_api.MODEL}.bin").write_bytes(content)
    manifest = [{"paths": ["face_landmark_68_model.bin"], "weights": entries}]
    (folder / f"{face_api.MODEL}-weights_manifest.json").write_text(json.dumps(manifest))
    return folder


def test_weights_are_bytes_with_a_scale_and_a_least_value(tmp_path):
    network = face_api.FaceLandmark68(package(tmp_path))
    [found] = network(np.zeros((1, face_api.SIZE, face_api.SIZE, 3), dtype=np.float32))
    # 256 channels of 1, each times 2/512, and the bias.
    np.testing.assert_allclose(found, (1 + 0.5 * np.arange(136) - 3).reshape(68, 2), atol=1e-5)


def test_another_folder_is_one_clear_line(tmp_path):
    with pytest.raises(DataError, match=r"weights_manifest\.json: no package of @vladmandic/face-api"):
        face_api.FaceLandmark68(tmp_path)
