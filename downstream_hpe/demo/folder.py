# SPDX-License-Identifier: MIT
"""The page as one folder, for any static host."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from downstream_hpe.demo.packages import PACKAGES, cache_folder, files_of
from downstream_hpe.errors import UsageError
from downstream_hpe.prediction.detector import ALIKE_DEG, CLOSER, DOUBTFUL, LARGE_ENOUGH
from downstream_hpe.prediction.face import LOW_CONFIDENCE
from downstream_hpe.prediction.pictures import MAX_PIXELS
from downstream_hpe.prediction.plausibility import DOUBTED, STEEP, UPRIGHT_DEG, FaceShapes
from downstream_hpe.prediction.predictor import DEFAULT_MODEL, MODELS, Predictor
from downstream_hpe.prediction.smoothing import BETA, MIN_CUTOFF, SPEED_CUTOFF
from downstream_hpe.prediction.tracks import MEMORY_S
from downstream_hpe.prediction.way_up import PATIENCE_S
from downstream_hpe.writing import writing

SOURCE = Path(__file__).parent / "page"


def page_facts() -> dict[str, Any]:
    """What the page knows from this package: the numbers that its code in Python decides with."""
    shapes = FaceShapes.load()
    return {
        "detector": {
            "closer": CLOSER,
            "doubtful": DOUBTFUL,
            "alike_deg": ALIKE_DEG,
            "large_enough": LARGE_ENOUGH,
            "patience_s": PATIENCE_S,
        },
        "shapes": {
            "mean": shapes.mean.ravel().tolist(),
            "basis": shapes.basis.tolist(),
            "weights": shapes.weights.tolist(),
            "bias": shapes.bias,
            "doubted": DOUBTED,
            "steep": STEEP,
            "upright_deg": UPRIGHT_DEG,
        },
        "pose": {
            "range_deg": Predictor.load(DEFAULT_MODEL).range_deg.tolist(),
            "low_confidence": LOW_CONFIDENCE,
        },
        "smoothing": {
            "min_cutoff": MIN_CUTOFF,
            "beta": BETA,
            "speed_cutoff": SPEED_CUTOFF,
            "memory_s": MEMORY_S,
        },
        "pictures": {"max_pixels": MAX_PIXELS},
    }


def write_page(
    folder: Path, cache: Path | None = None, note: Callable[[str], object] = lambda line: None
) -> int:
    """Write everything that the page needs into a folder, which must be new or empty; its size in bytes.

    cache: where packages of npm are kept. note: called with one line for each that has to be fetched.

    Raises
    ------
    UsageError: something lies in the folder. DataError: it cannot be written, or a package is not what it
    should be. ModelError: npm is missing or cannot fetch a package.
    """
    with writing(folder):
        if folder.exists() and not folder.is_dir():
            raise UsageError(f"{folder}: a file; give a folder that is new or empty")
        if folder.exists() and any(folder.iterdir()):
            raise UsageError(f"{folder}: not empty; give a folder that is new or empty")
        folder.mkdir(parents=True, exist_ok=True)
        files = dict(_files(cache or cache_folder(), note))  # all or nothing
        for target, content in files.items():
            path = folder / target
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    return sum(map(len, files.values()))


def _files(cache: Path, note: Callable[[str], object]) -> Iterator[tuple[str, bytes]]:
    for package in PACKAGES:
        yield from files_of(package, cache, note)
    for path in sorted(SOURCE.rglob("*")):
        if path.is_file():
            yield path.relative_to(SOURCE).as_posix(), path.read_bytes()
    yield "licences/VENDORED.txt", _notices().encode()
    yield f"model/{DEFAULT_MODEL}.onnx", (MODELS / f"{DEFAULT_MODEL}.onnx").read_bytes()
    yield "model/facts.json", json.dumps(page_facts(), separators=(",", ":")).encode()


def _notices() -> str:
    lines = [
        "The page itself, its model and its head are Headturn's: MIT.txt.",
        "What lies in vendor/ is of these packages of npm, unchanged:",
        "",
    ]
    for package in PACKAGES:
        lines.append(f"{package.name} {package.version}: {package.notice}. {package.licence}.txt")
        lines.append(f"    sha512-{package.integrity}")
        lines += [f"    {taken.target}, of {taken.path}" for taken in package.taken]
    return "\n".join(lines) + "\n"
