# SPDX-License-Identifier: MIT
"""Whether the 68 points of face-api hold up as a detector, beside MediaPipe's Face Mesh.

    npm pack @vladmandic/face-api && tar xzf vladmandic-face-api-*.tgz    # MIT; its network has 357 kB
    python benchmarks/face_api.py package DATASET [DATASET ...]

DATASET: of headturn build, with image files. Its network face_landmark_68 is run by torch on a square
around the box of MediaPipe's detector, not of face-api's own: the same faces for both. How large that square
is best, how low, and whether it is level with the eyes, which face-api's is not, is chosen on the first
dataset, for the smallest error in pixels.

Pixels are compared at iBUG's inner 51 points, brows to lips, which both have; off by what each means by a
point, too. Its points have no depth, so that a pose is a fit under scaled orthography: of what its own
points look like on other subjects' level heads, found from the true poses of the better half of their rows,
so that no offset between what it means by a point and what others do is held against it. Face Mesh is fitted
the same way, flat, at the same points; and rigidly, with depth, by the mean of its own level points on other
subjects. Flat points are fitted by the mean head of the package, too, with nothing learned. Errors are of the
rows on which both find the face.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product, starmap
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from torch.nn.functional import conv2d, pad

from downstream_hpe.cli.console import one_line_errors, say
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.constant import folds_of
from downstream_hpe.evaluation.scores import BOUNDS_DEG
from downstream_hpe.geometry.face_mesh import IBUG_INNER
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import euler_errors, geodesic_errors
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation
from downstream_hpe.tables.columns import angles_of, column, landmarks_of, vectors
from downstream_hpe.tables.missing import exact_in_pixels
from downstream_hpe.tables.open import open_tables
from litert_faces.boxes import BoxDetector
from litert_faces.crop import Square
from litert_faces.files import networks
from litert_faces.landmarks import ROOM, squares
from litert_faces.network import PictureNetwork

MODEL = "model/face_landmark_68_model"
SIZE = 112
MEAN_RGB = (122.782, 117.001, 104.298)
"""Both: src/faceFeatureExtractor/FaceFeatureExtractor.ts."""
SIDES, LOWER = (1.0, 1.15, 1.3, 1.45), (-0.1, 0.0, 0.1)
"""Of the square, in longer sides of the box; and how much lower than the box it lies, in the same unit."""
INNER = list(IBUG_INNER)
FOLDS = 6
YAWS = ((0, 20), (20, 50), (50, 90))
COLUMNS = (
    "subject", "yaw_deg", "pitch_deg", "roll_deg", "rotation", "detected", "landmarks", "landmarks_exact",
    "camera", "translation_mm", "projection", "image_path",
)  # fmt: skip
HEADER = """\
| dataset | points | yaw | rows | it misses | px | yaw / pitch / roll | MAE | geodesic |
| --- | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |"""


@dataclass(frozen=True)
class Renders:
    """pictures: uint8 [H, W, 3] each. subjects str [N]; ypr_deg [N, 3]; rotation [N, 3, 3], R_C. exact, and
    mesh, Face Mesh's, NaN where not found: [N, 468, 3], pixels, frame C."""

    pictures: list[np.ndarray]
    subjects: np.ndarray
    ypr_deg: np.ndarray
    rotation: np.ndarray
    exact: np.ndarray
    mesh: np.ndarray

    @staticmethod
    def read(dataset: Path) -> Renders:
        """DataError: no dataset, or one without image files."""
        parts = []
        for batch in open_tables(dataset, COLUMNS[:-1]).batches(COLUMNS):
            files = [dataset / str(name) for name in column(batch, "image_path")]
            if not all(file.is_file() for file in files):
                raise DataError(f"{dataset}: no image files; build it with --images files")
            mesh = np.where(column(batch, "detected")[:, None, None], landmarks_of(batch), np.nan)
            rotation = vectors(batch, "rotation", 9).reshape(-1, 3, 3)
            numbers = (column(batch, "subject"), angles_of(batch), rotation, exact_in_pixels(batch), mesh)
            parts.append((np.array(files), *numbers))
        files, *every = (np.concatenate(values) for values in zip(*parts, strict=True))
        return Renders([np.asarray(Image.open(file).convert("RGB")) for file in files], *every)


class FaceLandmark68:
    """face-api's network. DataError: it is not in the package.

    Four blocks of separable convolutions, each of which adds up what went before; the weights are bytes, with
    a scale and a least value a tensor: weights_manifest.json of tensorflow.js.
    """

    def __init__(self, package: Path) -> None:
        manifest, shard = package / f"{MODEL}-weights_manifest.json", package / f"{MODEL}.bin"
        try:
            [group], content = json.loads(manifest.read_text()), shard.read_bytes()
        except (OSError, ValueError) as error:
            raise DataError(f"{manifest}: no package of @vladmandic/face-api ({error})") from error
        self._weights, start = {}, 0
        for entry in group["weights"]:
            count, how = int(np.prod(entry["shape"])), entry["quantization"]
            values = np.frombuffer(content, np.uint8, count, start).astype(np.float32)
            start += count
            tensor = torch.from_numpy(values * how["scale"] + how["min"]).reshape(entry["shape"])
            # tensorflow.js has height, width, in, out.
            self._weights[entry["name"]] = tensor.permute(3, 2, 0, 1) if tensor.ndim == 4 else tensor

    @torch.inference_mode()
    def __call__(self, pictures: np.ndarray) -> np.ndarray:
        """Places in each, 0 to 1, x and y: [N, 68, 2]. pictures: float32 [N, SIZE, SIZE, 3], 0 to 255."""
        x = torch.from_numpy(((pictures - np.float32(MEAN_RGB)) / 255).astype(np.float32)).permute(0, 3, 1, 2)
        for block in range(4):
            total = torch.relu(self._convolved(x, f"dense{block}/conv0", 2))
            for layer in range(1, 4):
                total = total + self._convolved(torch.relu(total), f"dense{block}/conv{layer}", 1)
            x = torch.relu(total)
        flat = x.mean(dim=(2, 3)) @ self._weights["fc/weights"] + self._weights["fc/bias"]
        return flat.reshape(-1, 68, 2).numpy().astype(np.float64)

    def _convolved(self, x: torch.Tensor, name: str, stride: int) -> torch.Tensor:
        """As tensorflow pads "same": where a stride of 2 needs one pixel, it is right and below."""
        x = pad(x, (2 - stride, 1, 2 - stride, 1))
        bias = self._weights[f"{name}/bias"]
        if f"{name}/filters" in self._weights:
            return conv2d(x, self._weights[f"{name}/filters"], bias, stride)
        depthwise = self._weights[f"{name}/depthwise_filter"].permute(1, 0, 2, 3)
        x = conv2d(x, depthwise, stride=stride, groups=len(depthwise))
        return conv2d(x, self._weights[f"{name}/pointwise_filter"], bias)


def boxes(pictures: list[np.ndarray]) -> list[Square | None]:
    """Around the surest face of each, level with the eyes; None where the detector sees none."""
    detector = BoxDetector(PictureNetwork(networks("litert").near, "detector"))
    found = [detector.find(picture, 0.5) for picture in pictures]
    return [squares(boxes.take(np.arange(1)))[0] if len(boxes) else None for boxes in found]


@dataclass(frozen=True)
class Cut:
    """side, lower: see SIDES. level: with the eyes."""

    side: float
    lower: float
    level: bool

    def of(self, place: Square) -> Square:
        """place: as :func:`boxes` gives them."""
        box, angle = place.side / ROOM, place.angle if self.level else 0.0
        down = self.lower * box * np.array([-np.sin(angle), np.cos(angle)])
        return Square(place.centre + down, self.side * box, angle)


def points_68(
    network: FaceLandmark68, pictures: list[np.ndarray], places: list[Square | None], cut: Cut
) -> np.ndarray:
    """Pixels, [N, 68, 2], NaN where there is no box."""
    found = np.full((len(pictures), 68, 2), np.nan)
    for n, (picture, place) in enumerate(zip(pictures, places, strict=True)):
        if place is not None:
            square = cut.of(place)
            found[n] = square.pixels(network(255 * square.cut(picture, SIZE, 0, replicate=False))[0])
    return found


def apart(flat: np.ndarray, renders: Renders) -> np.ndarray:
    """Mean distance to the exact points, pixels [N]. flat: [N, 51, 2]."""
    return np.linalg.norm(flat - renders.exact[:, INNER, :2], axis=2).mean(axis=1)


def learned(points: np.ndarray, rotation: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """The level face [P, 3] whose points, turned by the true R_C, lie where they were found: float [N, P, 2].

    exact: [N, Q, 3], of the same heads, which say where each is and how large.
    """
    middle = exact.mean(axis=1, keepdims=True)
    size = np.sqrt(np.square(exact - middle).sum(axis=2).mean(axis=1))
    flat = (points - middle[..., :2]) / size[:, None, None]
    seen = flat.transpose(0, 2, 1).reshape(-1, points.shape[1])
    return np.linalg.lstsq(rotation[:, :2].reshape(-1, 3), seen, rcond=None)[0].T


def fitted(face: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """R_C of the least-squares fit of a face [P, 3] under scaled orthography to points [P, 2]: [3, 3]."""
    face, flat = face - face.mean(axis=0), flat - flat.mean(axis=0)

    def residual(values: np.ndarray) -> np.ndarray:
        turned = face @ Rotation.from_rotvec(values[:3]).as_matrix()[:2].T
        return (np.exp(values[3]) * turned - scaled).ravel()

    scaled = flat / np.sqrt(np.square(flat).sum(axis=1).mean())
    rows = np.linalg.lstsq(face, scaled, rcond=None)[0].T
    u, sizes, vt = np.linalg.svd(rows, full_matrices=False)
    across = u @ vt
    first = Rotation.from_matrix(np.vstack([across, np.cross(*across)])).as_rotvec()
    best = least_squares(residual, [*first, np.log(sizes.mean())]).x
    return Rotation.from_rotvec(best[:3]).as_matrix()


def flat_poses(points: np.ndarray, renders: Renders) -> np.ndarray:
    """R_C of each row by what points [N, P, 2] look like on other subjects; NaN where there are none.

    The last 51 points are iBUG's inner ones.
    """
    found, there = np.full((len(points), 3, 3), np.nan), np.isfinite(points).all(axis=(1, 2))
    off = apart(points[:, -len(INNER) :], renders)
    for others, rows in _folds(renders.subjects, there):
        better = others & (off <= np.median(off[others]))
        face = learned(points[better], renders.rotation[better], renders.exact[better][:, INNER])
        found[rows] = [fitted(face, flat) for flat in points[rows]]
    return found


def mean_head_poses(inner: np.ndarray) -> np.ndarray:
    """R_C of each row by the mean head's points, with nothing learned; NaN where there are none."""
    found, there = np.full((len(inner), 3, 3), np.nan), np.isfinite(inner).all(axis=(1, 2))
    found[there] = [fitted(mean_head()[INNER], flat) for flat in inner[there]]
    return found


def rigid_poses(renders: Renders) -> np.ndarray:
    """R_C of each row by the rigid fit of Face Mesh's level mean on other subjects; NaN without a face."""
    found, there = np.full((len(renders.mesh), 3, 3), np.nan), np.isfinite(renders.mesh).all(axis=(1, 2))
    for others, rows in _folds(renders.subjects, there):
        mean = (normalise(renders.mesh[others]) @ renders.rotation[others]).mean(axis=0)
        found[rows] = fit_rotation(mean, renders.mesh[rows])
    return found


def _folds(subjects: np.ndarray, there: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    fold = folds_of(subjects, FOLDS)
    for k in np.unique(fold):
        yield there & (fold != k), there & (fold == k)


def lines(
    dataset: str, name: str, off: np.ndarray, poses: np.ndarray, both: np.ndarray, renders: Renders
) -> Iterator[str]:
    """Of the table. off: pixels [N], NaN where there is no face; poses: [N, 3, 3]; both: bool [N]."""
    yaw = np.abs(renders.ypr_deg[:, 0])
    groups = [(f"{low} to {high}", (yaw >= low) & (yaw < high)) for low, high in YAWS]
    within = (np.abs(renders.ypr_deg) <= BOUNDS_DEG).all(axis=1)
    for which, rows in [*groups, ("the paper's bounds", within), ("all", yaw >= 0)]:
        seen, missed = rows & both, int((rows & np.isnan(off)).sum())
        errors = euler_errors(angles_from_rotation(poses[seen]), renders.ypr_deg[seen]).mean(axis=0)
        yield (
            f"| {dataset} | {name} | {which} | {seen.sum()} | {missed} | {off[seen].mean():.1f} "
            f"| {' / '.join(f'{error:.1f}' for error in errors)} | {errors.mean():.2f} "
            f"| {geodesic_errors(poses[seen], renders.rotation[seen]).mean():.2f} |"
        )


@one_line_errors()
def main() -> None:
    """Choose the square, fit, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("package", type=Path)
    parser.add_argument("datasets", type=Path, nargs="+")
    given = parser.parse_args()
    torch.set_num_threads(1)
    network, cut, left_out = FaceLandmark68(given.package), None, []
    for dataset in given.datasets:
        renders = Renders.read(dataset)
        places = boxes(renders.pictures)
        if cut is None:
            tried = {}
            for one in starmap(Cut, product(SIDES, LOWER, (False, True))):
                inner = points_68(network, renders.pictures, places, one)[:, -len(INNER) :]
                tried[one] = float(np.nanmean(apart(inner, renders)))
            cut = min(tried, key=lambda one: tried[one])
            say(f"{cut}: {tried[cut]:.2f} px; the worst of {len(tried)} {max(tried.values()):.2f}")
            for line in HEADER.splitlines():
                say(line)
        every = points_68(network, renders.pictures, places, cut)
        inner, mesh = every[:, -len(INNER) :], renders.mesh[:, INNER, :2]
        both = np.isfinite(every).all(axis=(1, 2)) & np.isfinite(mesh).all(axis=(1, 2))
        for name, flat, poses in (
            ("Face Mesh, 468 with depth", mesh, rigid_poses(renders)),
            ("Face Mesh, 51 flat", mesh, flat_poses(mesh, renders)),
            ("face-api, 51 flat", inner, flat_poses(inner, renders)),
            ("face-api, 68 flat", inner, flat_poses(every, renders)),
            ("Face Mesh, 51 flat, mean head", mesh, mean_head_poses(mesh)),
            ("face-api, 51 flat, mean head", inner, mean_head_poses(inner)),
        ):
            for line in lines(dataset.name, name, apart(flat, renders), poses, both, renders):
                say(line)
            alone = np.isfinite(poses).all(axis=(1, 2)) & ~both
            if alone.any():
                off = geodesic_errors(poses[alone], renders.rotation[alone])
                left_out.append(f"{dataset.name}, {name}: {alone.sum()} rows, geodesic {off.mean():.2f}")
    say("Found by one of the two alone:")
    for line in left_out:
        say(line)


if __name__ == "__main__":
    main()
