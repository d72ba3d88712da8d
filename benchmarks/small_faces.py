# SPDX-License-Identifier: MIT
"""What the size of a face in its picture does to its landmarks, and what a closer look mends.

python benchmarks/small_faces.py DATASET    # one with images; every face is pasted into larger pictures

Truth is the rotation of the same face where it fills its picture, so that the figures are the detector's
own: degrees between the rigid fits of the two sets of landmarks.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import fit_rotation
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.pictures import read_bgr

SHARES = (0.5, 0.35, 0.25, 0.2, 0.15, 0.12, 0.1, 0.08, 0.06)
PICTURES = 60
GREY = 90


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    files = sorted((Path(sys.argv[1]) / "images").rglob("*.png"))
    files = files[:: max(1, len(files) // PICTURES)]
    rng = np.random.default_rng(0)
    plain, closer = FaceDetector(), FaceDetector()
    pictures = [read_bgr(file) for file in files]
    large = [plain.faces(picture) for picture in pictures]
    print("face / picture   Face Mesh alone: missed, mean error     with a closer look: missed, mean error")
    for share in SHARES:
        errors: tuple[list[float], list[float]] = ([], [])
        count = 0
        for picture, truth in zip(pictures, large, strict=True):
            if not len(truth):
                continue
            size = int(np.ptp(truth[0, :, :2], axis=0).max() / share)
            height, width = picture.shape[:2]
            if size < max(height, width):
                continue
            count += 1
            left, top = rng.integers(size - width + 1), rng.integers(size - height + 1)
            whole = np.full((size, size, 3), GREY, dtype=np.uint8)
            whole[top : top + height, left : left + width] = picture
            found = plain.mesh(np.ascontiguousarray(whole[..., ::-1])), closer.faces(whole)
            for faces, into in zip(found, errors, strict=True):
                if len(faces):
                    into.append(float(geodesic_errors(fit_rotation(truth[0], faces[0][None])[0], np.eye(3))))
        if count:
            cells = [
                f"{count - len(e):4} of {count:4}, {np.mean(e) if e else np.nan:5.2f} deg" for e in errors
            ]
            print(f"{share:14.2f}   {cells[0]:37}   {cells[1]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
