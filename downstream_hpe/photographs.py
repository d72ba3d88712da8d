# SPDX-License-Identifier: MIT
"""Labelled photographs: AFLW2000-3D and BIWI as they are distributed. Neither comes with this program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.pictures import read_bgr
from downstream_hpe.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.tables import Rows

LARGEST_DEG = 99.0
"""The usual filter of AFLW2000-3D: a label with a larger angle is left out."""


@dataclass(frozen=True)
class Photograph:
    """bgr uint8 [H, W, 3]; rotation float64 [3, 3], R_C; subject: who it is,
    or the picture's own name where that is unknown."""

    name: str
    subject: str
    bgr: np.ndarray
    rotation: np.ndarray


def aflw2000(folder: Path) -> Iterator[Photograph]:
    """AFLW2000-3D: image00002.jpg beside image00002.mat, whose Pose_Para is pitch, yaw, roll in radians.

    Raises
    ------
    DataError: no .mat file, one without Pose_Para, or without its picture.
    """
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    for file in _some(folder, "*.mat"):
        try:
            pose = np.asarray(loadmat(file, variable_names=["Pose_Para"])["Pose_Para"], dtype=np.float64)
        # scipy raises what it likes at a damaged file.
        except (MatReadError, OSError, KeyError, ValueError, TypeError, NotImplementedError) as error:
            raise DataError(f"{file}: no Pose_Para can be read from it") from error
        if pose.size < 3:
            raise DataError(f"{file}: Pose_Para has {pose.size} numbers, expected pitch, yaw, roll, ...")
        pitch, yaw, roll = np.rad2deg(pose.ravel()[:3])
        if max(abs(yaw), abs(pitch), abs(roll)) <= LARGEST_DEG:
            picture = file.with_suffix(".jpg")
            yield Photograph(
                file.stem, file.stem, read_bgr(picture), rotation_from_angles(np.array([yaw, pitch, roll]))
            )


def biwi(folder: Path) -> Iterator[Photograph]:
    """BIWI Kinect as published: NN/frame_00003_rgb.png beside NN/frame_00003_pose.txt.

    The first three lines of a pose file are a matrix M = R_C^T (the reading of FSA-Net and the papers
    after it).

    Raises
    ------
    DataError: no pose file, one that holds no rotation, or without its picture.
    """
    for file in _some(folder, "*/frame_*_pose.txt"):
        try:
            matrix = np.loadtxt(file, max_rows=3)
        except (OSError, ValueError) as error:
            raise DataError(f"{file}: expected three lines of three numbers") from error
        if matrix.shape != (3, 3) or np.abs(matrix @ matrix.T - np.eye(3)).max() > 1e-2:
            raise DataError(f"{file}: its first three lines are not a rotation")
        picture = file.with_name(file.name.replace("_pose.txt", "_rgb.png"))
        yield Photograph(f"{file.parent.name}/{picture.stem}", file.parent.name, read_bgr(picture), matrix.T)


def biwi_npz(file: Path) -> Iterator[Photograph]:
    """BIWI as FSA-Net packs it: image uint8 [N, H, W, 3] (BGR) and pose [N, 3] (yaw, pitch, roll), degrees.

    Raises
    ------
    DataError: not such a file.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            images, poses = arrays["image"], np.asarray(arrays["pose"], dtype=np.float64)
    except (OSError, KeyError, ValueError) as error:
        raise DataError(f"{file}: expected an .npz with the arrays image and pose") from error
    if images.ndim != 4 or images.shape[3] != 3 or poses.shape != (len(images), 3):
        raise DataError(f"{file}: image {images.shape} and pose {poses.shape} do not belong together")
    for n, (image, pose) in enumerate(zip(images, poses, strict=True)):
        yield Photograph(f"{n:06d}", file.stem, image.astype(np.uint8), rotation_from_angles(pose))


FORMATS: dict[str, Callable[[Path], Iterator[Photograph]]] = {
    "aflw2000": aflw2000,
    "biwi": biwi,
    "biwi-npz": biwi_npz,
}


def detected_rows(
    photographs: Iterator[Photograph], landmarks: Callable[[np.ndarray], np.ndarray | None]
) -> Rows:
    """Rows of the photographs in which a face is found.

    landmarks: :meth:`downstream_hpe.predictor.Predictor.landmarks`.

    Raises
    ------
    DataError: none found.
    """
    subjects, rotations, found = [], [], []
    undetected = 0
    for photograph in photographs:
        points = landmarks(photograph.bgr)
        if points is None:
            undetected += 1
            continue
        subjects.append(photograph.subject)
        rotations.append(photograph.rotation)
        found.append(points.astype(np.float32))
    if not found:
        raise DataError(f"no face found in {undetected} photographs")
    names, rotation = np.array(subjects), np.stack(rotations)
    return Rows(names, names, angles_from_rotation(rotation), rotation, np.stack(found), undetected)


def _some(folder: Path, pattern: str) -> list[Path]:
    files = sorted(folder.glob(pattern))
    if not files:
        raise DataError(f"{folder}: no {pattern} in it")
    return files
