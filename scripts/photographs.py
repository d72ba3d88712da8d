# SPDX-License-Identifier: MIT
"""The rigid fit and a model on labelled photographs whose landmarks are kept in a file: a table.

    python scripts/photographs.py FILE.npz
    python scripts/photographs.py FILE.npz --model pose.onnx --canonical canonical_face.csv

FILE.npz: ``landmarks`` [N, 468, 3], isotropic pixels, frame C; ``detected`` [N]; ``ypr_deg`` [N, 3], the
labels, signs of docs/conventions.md; ``image`` [N], names. The rigid fit is that of all 468 points to
MediaPipe's canonical face, by default ``canonical_face.csv`` beside FILE. To choose and to diagnose with:
nothing here is learned from.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from downstream_hpe import escape
from downstream_hpe.cli.console import one_line_errors, say
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.archive import read_npz
from downstream_hpe.evaluation.constant import constant
from downstream_hpe.evaluation.estimators import rigid_fit
from downstream_hpe.evaluation.photographs import LARGEST_DEG
from downstream_hpe.evaluation.reference import load_reference
from downstream_hpe.evaluation.reliability import reliability
from downstream_hpe.evaluation.scores import BOUNDS_DEG, evaluate, within_bounds
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.predictor import DEFAULT_MODEL, Predictor

BINS = np.linspace(0, 1, 6)
"""Of confidence."""
RANGES = {
    "within " + ", ".join(f"{bound:g}" for bound in BOUNDS_DEG) + " degrees": BOUNDS_DEG,
    f"up to {LARGEST_DEG:g} degrees": (LARGEST_DEG,) * 3,
}
HEADER = """\
| | faces | MAE | yaw / pitch / roll | geodesic | constant | MAE without a constant |
| --- | ---: | ---: | --- | ---: | --- | ---: |"""


@dataclass(frozen=True)
class Photographs:
    """landmarks float [N, 468, 3], of what is not detected anything; detected bool [N]; ypr_deg float64
    [N, 3], labels; image str [N]."""

    landmarks: np.ndarray
    detected: np.ndarray
    ypr_deg: np.ndarray
    image: np.ndarray

    def take(self, chosen: np.ndarray) -> Photographs:
        """The chosen ones. chosen: bool [N]."""
        return Photographs(
            self.landmarks[chosen], self.detected[chosen], self.ypr_deg[chosen], self.image[chosen]
        )


def read_photographs(file: Path) -> Photographs:
    """Raises DataError: not such a file."""
    try:
        arrays = read_npz(file, ("landmarks", "detected", "ypr_deg", "image"))
    except (OSError, ValueError) as error:
        why = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise DataError(
            f"{file}: expected an .npz with the arrays landmarks, detected, ypr_deg and image ({why})"
        ) from error
    found = Photographs(**arrays)
    count = len(found.ypr_deg) if found.ypr_deg.ndim else 0
    shapes = {name: array.shape for name, array in arrays.items()}
    expected = {
        "landmarks": (count, POINTS, 3),
        "detected": (count,),
        "ypr_deg": (count, 3),
        "image": (count,),
    }
    if not count or shapes != expected:
        raise DataError(f"{file}: its arrays have the shapes {shapes}, expected {expected} and N > 0")
    kinds = {"landmarks": "f", "detected": "b", "ypr_deg": "f", "image": "U"}
    wrong = [name for name, kind in kinds.items() if arrays[name].dtype.kind != kind]
    if wrong:
        raise DataError(
            f"{file}: {', '.join(wrong)} of another type; expected numbers, bool, numbers and text"
        )
    if not np.isfinite(found.ypr_deg).all() or not np.isfinite(found.landmarks[found.detected]).all():
        raise DataError(f"{file}: a label, or a landmark of a detected face, is not finite")
    return found


def row(name: str, predicted_deg: np.ndarray, true_deg: np.ndarray, faces: np.ndarray) -> str:
    """A line of the table: raw; the median error of each angle; MAE without a constant rotation."""
    true = rotation_from_angles(true_deg)
    found = evaluate(name, predicted_deg, true)
    median = np.median(predicted_deg - true_deg, axis=0)
    rest = constant(predicted_deg, true, faces)
    return (
        f"| {escape.markdown(name)} | {found.count} | {found.mean_mae:.2f} | {_three(found.mae)} "
        f"| {found.geodesic:.2f} | {_three(median, '+.1f')} | {rest.mean_mae:.2f} |"
    )


def misses(photographs: Photographs) -> list[str]:
    """How many have no face that was found, and each by name and label."""
    missed = photographs.take(~photographs.detected)
    count = len(photographs.image)
    lines = [f"no face found in {len(missed.image)} of {count} ({len(missed.image) / count:.1%})"]
    for name, ypr_deg in zip(missed.image, missed.ypr_deg, strict=True):
        lines.append(f"  {name}: {_three(ypr_deg, '.0f')}")
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("--model", default=DEFAULT_MODEL, help="a model's name, its folder or an .onnx file")
    parser.add_argument("--canonical", type=Path, help="face of the rigid fit, .csv or .npz [468, 3]")
    given = parser.parse_args()
    with one_line_errors():
        report(given.file, given.model, given.canonical or given.file.parent / "canonical_face.csv")


def report(file: Path, model: str, canonical: Path) -> None:
    """Both ranges of labels, misses, and what confidence was worth. DataError: as the readers."""
    every, reference, predictor = read_photographs(file), load_reference(canonical), Predictor.load(model)
    for title, bounds in RANGES.items():
        labelled = every.take(within_bounds(every.ypr_deg, bounds))
        faces = labelled.take(labelled.detected)
        if len(faces.image) < 2:
            raise DataError(f"{file}: fewer than two faces found {title}")
        pose = predictor.from_landmarks(faces.landmarks)
        fitted = rigid_fit(reference)(faces.landmarks)
        lines = [f"Labels {title}", "", *HEADER.splitlines()]
        lines.append(row("rigid fit to the canonical face", fitted, faces.ypr_deg, faces.image))
        lines += [row(f"model {model}", pose.ypr_deg, faces.ypr_deg, faces.image), ""]
        if pose.confidence is not None:
            errors = evaluate(model, pose.ypr_deg, rotation_from_angles(faces.ypr_deg)).geodesic_errors
            lines += [*reliability(pose.confidence, errors, BINS.tolist()).splitlines(), ""]
        for line in [*lines, *misses(labelled), ""]:
            say(line)


def _three(values: np.ndarray | tuple[float, ...], form: str = ".2f") -> str:
    return " / ".join(f"{value:{form}}" for value in values)


if __name__ == "__main__":
    main()
