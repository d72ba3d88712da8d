# SPDX-License-Identifier: MIT
"""Labelled photographs: AFLW2000-3D and BIWI as they are distributed. Neither comes with this program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.archive import read_npz
from downstream_hpe.evaluation.matlab import read_arrays
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.reading import MAX_TEXT_BYTES, read_limited
from downstream_hpe.tables.rows import Rows

LARGEST_DEG = 99.0
"""The usual filter of AFLW2000-3D: a label with a larger angle is left out."""
FARTHEST_PX = 1e6
"""A point of a label beyond it, or that is no number, is none."""
FACES = 5
"""So many faces are looked for where the label says which one is meant."""


@dataclass(frozen=True)
class Photograph:
    """bgr uint8 [H, W, 3]; rotation float64 [3, 3], R_C; subject: who it is, or the picture's own name
    where that is unknown; centre float [2]: where in the picture the labelled face is, pixels, None
    where the label does not say. points float64 [68, 3], frame C: iBUG's, as the label itself places them,
    None where it has none."""

    name: str
    subject: str
    bgr: np.ndarray
    rotation: np.ndarray
    centre: np.ndarray | None = None
    points: np.ndarray | None = None


@dataclass
class LeftOut:
    """Labelled photographs that are not scored. filtered: how many the usual protocol drops, by its reason.
    damaged: a line for each whose picture or label is missing or cannot be read."""

    filtered: Counter[str] = field(default_factory=Counter)
    damaged: list[str] = field(default_factory=list)


Loader = Callable[[Path, LeftOut], Iterator[Photograph]]
"""Called with the folder or file, and where to say what is left out."""


def aflw2000(folder: Path, left_out: LeftOut) -> Iterator[Photograph]:
    """AFLW2000-3D: image00002.jpg beside image00002.mat. In the layout of 300W-LP, where folders with
    such pictures lie in the one given, these.

    Pose_Para is pitch, yaw, roll, ... in radians; the mean of pt3d_68 says which face is meant.

    Raises
    ------
    DataError: no .mat file.
    """
    below = {file.parent for file in folder.glob("*/*.jpg")} if not any(folder.glob("*.mat")) else ()
    files = [file for each in sorted(below) or [folder] for file in _labels(each, "*", ".mat", ".jpg")]
    for file in files:
        try:
            ypr_deg, points = _aflw2000_label(file)
            if np.abs(ypr_deg).max() > LARGEST_DEG:
                left_out.filtered[f"an angle beyond {LARGEST_DEG:g} degrees"] += 1
                continue
            bgr = read_bgr(file.with_suffix(".jpg"))
        except DataError as error:
            left_out.damaged.append(str(error))
            continue
        centre = None if points is None else points[:, :2].mean(axis=0)
        name = str(file.relative_to(folder).with_suffix(""))
        yield Photograph(name, name, bgr, rotation_from_angles(ypr_deg), centre, points)


def _aflw2000_label(file: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """(yaw, pitch, roll) in degrees, and the face's points, [68, 3], frame C, None where it has none.

    z of pt3d_68 is that of 3DDFA's model, towards the viewer.
    """
    try:
        label = read_arrays(file, ("Pose_Para", "pt3d_68"))
        pose = label["Pose_Para"].ravel()
        points = label.get("pt3d_68", np.empty((3, 0)))
    except FileNotFoundError as error:
        raise DataError(f"{file}: there is no such label beside {file.stem}.jpg") from error
    except (OSError, KeyError, ValueError) as error:
        raise DataError(f"{file}: no Pose_Para can be read from it") from error
    if pose.size < 3 or not np.isfinite(pose[:3]).all():
        raise DataError(f"{file}: Pose_Para is {pose[:7].tolist()}, expected pitch, yaw, roll, ...")
    pitch, yaw, roll = np.rad2deg(pose[:3])
    known = points.shape == (3, 68) and bool((np.abs(points) < FARTHEST_PX).all())
    return np.array([yaw, pitch, roll]), points.T * [1.0, 1.0, -1.0] if known else None


def biwi(folder: Path, left_out: LeftOut, colour_camera: bool = False) -> Iterator[Photograph]:
    """BIWI Kinect as published: NN/frame_00003_rgb.png beside NN/frame_00003_pose.txt.

    A pose file holds R_C (HopeNet, FSA-Net and 6DRepNet transpose it first and then read M = R_C^T; the
    angles are the same) and the head's place in mm, both in the frame of the depth camera. With NN/rgb.cal
    beside it, that place is projected into the picture and says which face is meant.

    colour_camera: turn R_C into the frame of the colour camera, which took the picture, by the rotation
    in rgb.cal, about a degree. The papers compare with the label as it is.

    Raises
    ------
    DataError: no pose file, an rgb.cal that cannot be read, or none where one is needed.
    """
    files = _labels(folder, "**/frame_*", "_pose.txt", "_rgb.png")
    cameras = {place: _colour_camera(place, colour_camera) for place in sorted({f.parent for f in files})}
    for file in files:
        picture = file.with_name(file.name.replace("_pose.txt", "_rgb.png"))
        try:
            numbers = _numbers(file, 12, "a rotation and a place")
            rotation, place = numbers[:9].reshape(3, 3), numbers[9:12]
            if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-2 or np.linalg.det(rotation) < 0:
                raise DataError(f"{file}: its first three lines are not a rotation")
            bgr = read_bgr(picture)
        except DataError as error:
            left_out.damaged.append(str(error))
            continue
        centre, camera = None, cameras[file.parent]
        if camera is not None:
            lens, turn, shift = camera
            seen = lens @ (turn @ place + shift)
            centre = seen[:2] / seen[2]
            rotation = turn @ rotation if colour_camera else rotation
        subject = file.parent.name
        yield Photograph(f"{subject}/{picture.stem}", subject, bgr, rotation, centre)


def _colour_camera(folder: Path, needed: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """K, R and t of NN/rgb.cal, X_colour = R X_depth + t in mm; None where there is no such file."""
    file = folder / "rgb.cal"
    if not file.is_file():
        if needed:
            raise DataError(f"{file}: there is no such file; use the format biwi, which needs none")
        return None
    # Four distortions stand between K and R.
    values = _numbers(file, 25, "K, distortion, rotation and translation")
    return values[:9].reshape(3, 3), values[13:22].reshape(3, 3), values[22:25]


def biwi_npz(file: Path, left_out: LeftOut) -> Iterator[Photograph]:
    """BIWI as FSA-Net packs it: image uint8 [N, H, W, 3] (BGR) and pose [N, 3] (yaw, pitch, roll), degrees.

    Raises
    ------
    DataError: not such a file, or angles in radians.
    """
    try:
        arrays = read_npz(file, ("image", "pose"))
        images, poses = arrays["image"], np.asarray(arrays["pose"], dtype=np.float64)
    except (OSError, ValueError, TypeError) as error:
        raise DataError(
            f"{file}: expected an .npz with the arrays image and pose ({_line(error)})"
        ) from error
    if images.ndim != 4 or images.shape[3] != 3 or poses.shape != (len(images), 3):
        raise DataError(f"{file}: image {images.shape} and pose {poses.shape} do not belong together")
    if images.dtype != np.uint8 or not np.isfinite(poses).all():
        raise DataError(f"{file}: expected images of uint8, not {images.dtype}, and finite angles")
    if len(poses) > 100 and np.abs(poses).max() < np.pi:
        raise DataError(f"{file}: no angle beyond {np.pi:.2f}; expected degrees, these look like radians")
    for n, (image, pose) in enumerate(zip(images, poses, strict=True)):
        yield Photograph(f"{n:06d}", file.stem, image, rotation_from_angles(pose))


FORMATS: dict[str, Loader] = {
    "aflw2000": aflw2000,
    "biwi": biwi,
    "biwi-colour": partial(biwi, colour_camera=True),
    "biwi-npz": biwi_npz,
}


def detected_rows(
    photographs: Iterator[Photograph], faces: Callable[[np.ndarray, int], np.ndarray]
) -> tuple[Rows, np.ndarray, np.ndarray]:
    """Rows of the photographs in which the labelled face is found; (yaw, pitch, roll) of the others,
    float64 [M, 3]; and the labels' own points of the rows, float64 [N, 68, 3], NaN where there are none.
    Another face than the labelled one is a miss.

    faces: :meth:`downstream_hpe.prediction.predictor.Predictor.faces`.

    Raises
    ------
    DataError: no photograph, or no face in any.
    """
    subjects, rotations, found = [], [], []
    missed, own = [], []
    for photograph in photographs:
        points = faces(photograph.bgr, 1 if photograph.centre is None else FACES)
        if photograph.centre is not None:
            points = _at(points, photograph.centre)
        if not len(points):
            missed.append(angles_from_rotation(photograph.rotation))
            continue
        subjects.append(photograph.subject)
        rotations.append(photograph.rotation)
        found.append(points[0].astype(np.float32))
        own.append(np.full((68, 3), np.nan) if photograph.points is None else photograph.points)
    if not found and not missed:
        raise DataError("no photograph is left to look at")
    if not found:
        raise DataError(f"no face found in {len(missed)} photographs")
    names, rotation = np.array(subjects), np.stack(rotations)
    rows = Rows(names, names, angles_from_rotation(rotation), rotation, np.stack(found), len(missed))
    return rows, np.array(missed).reshape(-1, 3), np.stack(own)


def _at(faces: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Of the faces [F, 468, 3] the one at centre, or none: [0 or 1, 468, 3]."""
    xy = faces[..., :2]
    low, high = xy.min(axis=1), xy.max(axis=1)
    distances = np.linalg.norm((low + high) / 2 - centre, axis=-1) / (high - low).max(axis=-1)
    # Half its size away, the labelled point would be on its edge.
    return faces[distances < 0.6][np.argsort(distances[distances < 0.6])[:1]]


def _numbers(file: Path, count: int, what: str) -> np.ndarray:
    """The first numbers of a text file."""
    try:
        text = read_limited(file, MAX_TEXT_BYTES).decode("ascii")
        numbers = np.array(text.split()[:count], dtype=np.float64)
    except FileNotFoundError as error:
        raise DataError(f"{file}: there is no such file") from error
    except (OSError, ValueError) as error:
        raise DataError(f"{file}: expected {count} numbers, {what}") from error
    if len(numbers) < count or not np.isfinite(numbers).all():
        raise DataError(f"{file}: expected {count} numbers, {what}")
    return numbers


def _line(error: Exception) -> str:
    """What a system or a reader says of a file, on one line."""
    return " ".join(str(getattr(error, "strerror", None) or error).split())


def _labels(folder: Path, pattern: str, label: str, picture: str) -> list[Path]:
    """The label file of everything that has a label or a picture, in order. DataError: no label at all.

    pattern: of their names, before the endings of a label and of a picture.
    """
    if not folder.is_dir():
        raise DataError(f"{folder}: not a folder; expected one with *{label} beside *{picture}")
    labels = set(folder.glob(pattern + label))
    if not labels:
        raise DataError(f"{folder}: no *{label} in it; expected one beside every *{picture}")
    pictures = folder.glob(pattern + picture)
    return sorted(labels | {file.with_name(file.name.removesuffix(picture) + label) for file in pictures})
