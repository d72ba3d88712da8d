# SPDX-License-Identifier: MIT
"""Whether estimates follow pictures that are mirrored or turned in their plane: a check without any label.

    python scripts/mirrored.py
    python scripts/mirrored.py PICTURE|FOLDER ... --model pose.onnx --canonical canonical_face.csv --some 100

Every face is found anew in each copy of its picture. Mirrored, its yaw and roll change sign; turned clockwise
by an angle about itself, it is Rz(angle) R. What is left is the detector's doing and the estimator's: the
table has it for the model and for the rigid fit to a face, which learned nothing. Exit code 1 where the
model's MAE, the mean over the three angles, is beyond --limit degrees in mirrored or in turned pictures.

Without a picture the portraits are taken that scikit-image and matplotlib carry. --some is for a folder of
many, such as the images of a dataset, and --upright leaves out faces that lean already, which the larger
turns would lay on their side.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from downstream_hpe.cli.console import note, one_line_errors, say
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.estimators import rigid_fit
from downstream_hpe.evaluation.reference import load_reference
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import euler_errors, geodesic_errors
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.prediction.inputs import find_sources
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.predictor import DEFAULT_MODEL, Predictor

CARRIED = (
    ("skimage", "data/astronaut.png"),
    ("matplotlib", "mpl-data/sample_data/grace_hopper.jpg"),
)
"""Portraits in packages that many have."""
LIMIT_DEG = 1.5
TURNS_DEG = (10.0, 20.0, 30.0, 40.0)
FACES = 8
"""Of a picture, at most."""
MIRROR = np.diag([-1.0, 1.0, 1.0])
HEADER = """\
| | looks | missed | model: MAE | yaw / pitch / roll | geodesic | rigid: MAE | yaw / pitch / roll | geodesic |
| --- | ---: | ---: | ---: | --- | ---: | ---: | --- | ---: |"""


@dataclass(frozen=True)
class Change:
    """Of a picture: mirrored left to right, or turned clockwise by turn_deg."""

    mirrored: bool
    turn_deg: float = 0.0

    @property
    def name(self) -> str:
        """Turns to either side are one row of the table."""
        return "mirrored" if self.mirrored else f"turned by {abs(self.turn_deg):g}"

    def picture(self, bgr: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The changed copy of a picture uint8 [H, W, 3], turned about centre [2]; and where that is then."""
        if self.mirrored:
            return np.ascontiguousarray(bgr[:, ::-1]), np.array([bgr.shape[1] - centre[0], centre[1]])
        # MediaPipe brings OpenCV along. Its angles are counter-clockwise, its pixels' middles whole numbers.
        import cv2

        x, y = (centre - 0.5).tolist()
        matrix = cv2.getRotationMatrix2D((x, y), -self.turn_deg, 1.0)
        size = (bgr.shape[1], bgr.shape[0])
        turned = cv2.warpAffine(bgr, matrix, size, flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(turned), centre

    def rotation(self, rotation: np.ndarray) -> np.ndarray:
        """What R_C [..., 3, 3] becomes."""
        if self.mirrored:
            return MIRROR @ rotation @ MIRROR
        return rotation_from_angles(np.array([0.0, 0.0, self.turn_deg])) @ rotation


CHANGES = (Change(True), *(Change(False, sign * turn) for turn in TURNS_DEG for sign in (1, -1)))


@dataclass(frozen=True)
class Look:
    """A face before and after: landmarks float [468, 3]; after None where it is not found."""

    change: Change
    before: np.ndarray
    after: np.ndarray | None


def looks(predictor: Predictor, bgr: np.ndarray, upright_deg: float) -> Iterator[Look]:
    """Every change of every face of a picture that leans by no more than upright_deg, as its landmarks say,
    so that every model is asked the same."""
    for face in predictor.faces(bgr, FACES):
        if abs(rigid_fit(mean_head())(face[None])[0, 2]) > upright_deg:
            continue
        for change in CHANGES:
            copy, place = change.picture(bgr, _centre(face))
            others = predictor.faces(copy, FACES)
            distances = [float(np.linalg.norm(_centre(other) - place)) for other in others]
            near = min(distances, default=np.inf) < np.ptp(face[:, :2], axis=0).max() / 2
            yield Look(change, face, others[int(np.argmin(distances))] if near else None)


def left_over(change: Change, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, float]:
    """By how much estimates R_C [3, 3] do not follow: |difference| of yaw, pitch, roll [3], and geodesic;
    degrees."""
    expected = change.rotation(before)
    angles = euler_errors(angles_from_rotation(after), angles_from_rotation(expected))
    return angles, float(geodesic_errors(after, expected))


def report(every: Sequence[Look], predictor: Predictor, face: np.ndarray) -> tuple[list[str], float]:
    """The table, and the larger of the model's two MAEs, mirrored and turned.

    face: of the rigid fit, [468, 3]. DataError: nothing found.
    """
    found = [(look, look.after) for look in every if look.after is not None]
    if not found:
        raise DataError("no face was found both before and after")
    points = np.concatenate([[look.before for look, _ in found], [after for _, after in found]])
    estimates = (
        predictor.from_landmarks(points).rotation.astype(np.float64),
        rotation_from_angles(rigid_fit(face)(points)),
    )
    count = len(found)
    left = [[left_over(found[n][0].change, r[n], r[count + n]) for n in range(count)] for r in estimates]
    lines, worst = HEADER.splitlines(), 0.0
    for name in ("mirrored", *(f"turned by {turn:g}" for turn in TURNS_DEG), "turned"):
        whole = name in ("mirrored", "turned")
        total = sum(look.change.name.startswith(name) for look in every)
        chosen = [n for n, (look, _) in enumerate(found) if look.change.name.startswith(name)]
        cells = [name, str(total), str(total - len(chosen))]
        for k, one in enumerate(left):
            angles = np.mean([one[n][0] for n in chosen] or np.full((1, 3), np.nan), axis=0)
            geodesic = np.mean([one[n][1] for n in chosen] or [np.nan])
            cells += [f"{angles.mean():.2f}", " / ".join(f"{a:.2f}" for a in angles), f"{geodesic:.2f}"]
            # What no look is of is not judged.
            worst = max(worst, float(angles.mean())) if whole and chosen and k == 0 else worst
        lines.append(f"| {' | '.join(cells)} |")
    return lines, worst


def _centre(face: np.ndarray) -> np.ndarray:
    """[2], of the box of landmarks, pixels."""
    middle: np.ndarray = (face[:, :2].min(axis=0) + face[:, :2].max(axis=0)) / 2
    return middle


def carried() -> list[str]:
    """The portraits of packages that are installed."""
    found = []
    for package, name in CARRIED:
        spec = find_spec(package)
        file = Path(spec.origin).parent / name if spec is not None and spec.origin else None
        found += [str(file)] if file is not None and file.is_file() else []
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("pictures", nargs="*", help="pictures, or folders of them")
    parser.add_argument("--model", default=DEFAULT_MODEL, help="a model's name, its folder or an .onnx file")
    parser.add_argument("--canonical", type=Path, help="face of the rigid fit; else that of the mean head")
    parser.add_argument("--limit", type=float, default=LIMIT_DEG, help="degrees; default %(default)s")
    parser.add_argument("--upright", type=float, default=20.0, help="degrees of roll; default %(default)s")
    parser.add_argument("--some", type=int, help="at most so many pictures, evenly chosen")
    given = parser.parse_args()
    with one_line_errors():
        names = given.pictures or carried()
        if not names:
            raise DataError("neither scikit-image nor matplotlib is installed; name some pictures")
        sources = [source for source in find_sources(names, leave_out=note) if not source.moving]
        step = 1 if given.some is None else -(-len(sources) // max(1, given.some))
        face = load_reference(given.canonical) if given.canonical else mean_head()
        predictor = Predictor.load(given.model)
        pictures = [read_bgr(Path(source.name)) for source in sources[::step]]
        every = [look for bgr in pictures for look in looks(predictor, bgr, given.upright)]
        lines, worst = report(every, predictor, face)
        say(f"{len(every) // len(CHANGES)} faces of {len(pictures)} pictures; what is left, degrees")
        for line in ["", *lines, ""]:
            say(line)
        if not worst <= given.limit:
            raise DataError(f"off by {worst:.2f} degrees on average, expected at most {given.limit:g}")


if __name__ == "__main__":
    sys.exit(main())
