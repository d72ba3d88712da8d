# SPDX-License-Identifier: MIT
"""``downstream-hpe doctor``."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict

import typer

from downstream_hpe.cli.console import JsonFlag, say
from downstream_hpe.errors import HpeError
from litert_faces import checkup
from litert_faces.checkup import POSE, Finding, doomed

FAULTS = (HpeError, ImportError, OSError)
LOOK = 64
"""Pixels along each side of the black picture that a detector is tried on."""


def doctor(as_json: JsonFlag = False) -> None:
    """Say what is here of what head pose needs, and the command that brings what is missing.

    Detectors are started, not only looked for. Paste what it prints into a report of a fault.

    Exit code 1 if no head pose can be predicted here.
    """
    from downstream_hpe.release import __version__

    found: list[Finding] = []
    if not as_json:
        say(f"downstream-hpe {__version__}")
    for one in findings():
        found.append(one)
        if not as_json:
            for line in one.lines():
                say(line)
    can_predict = not doomed(found)
    if as_json:
        about = {"downstream-hpe": __version__, "can_predict": can_predict}
        typer.echo(json.dumps({**about, "findings": [asdict(one) for one in found]}, indent=2))
    else:
        say("head pose can be predicted here" if can_predict else "no head pose here: see above")
    raise typer.Exit(0 if can_predict else 1)


def findings() -> Iterator[Finding]:
    """Everything, as it is found; detectors take seconds."""
    from downstream_hpe.release import DISTRIBUTION, install

    wanted = {
        "numpy": ("everything", install(POSE)),
        **checkup.pose_packages(install),
        "pyarrow": ("datasets, --out poses.parquet", install("tables")),
        "matplotlib": ("evaluate --out", install("tables")),
        "pillow-heif": ("HEIC", install("pictures")),
        "tifffile": ("TIFF of floats", install("pictures")),
    }
    yield checkup.python(DISTRIBUTION)
    yield checkup.models(vital=True)
    yield from checkup.packages(wanted, vital=("numpy", "onnxruntime"))
    yield opencv(install(POSE))
    remedies = checkup.detector_remedies(install, "pose")
    yield from checkup.detectors(remedies, _opened, FAULTS, ("predict", install(POSE)))
    yield checkup.npm(install)
    yield cameras()


def opencv(remedy: str) -> Finding:
    """Imported, as it may be there and lack a library of the system."""
    purpose = "finding faces, webcams"
    try:
        import cv2
    except ImportError as error:
        return Finding("opencv", "missing", str(error), purpose, remedy, vital=True)
    return Finding("opencv", "ok", cv2.__version__, purpose)


def cameras() -> Finding:
    """Which webcams there are, where that can be seen without opening them."""
    from downstream_hpe.prediction.webcam import usable_webcams

    there = usable_webcams()
    if there is None:
        return Finding("cameras", "note", "only opening one tells here: downstream-hpe predict webcam:0")
    shut = [f"webcam:{number}" for number, usable in there.items() if not usable]
    if shut:
        remedy = 'sudo usermod -aG video "$USER", and log in again'
        return Finding("cameras", "missing", f"{', '.join(shut)} may not be used", "predict webcam:0", remedy)
    return Finding("cameras", "note", ", ".join(f"webcam:{number}" for number in there) or "none")


def _opened(name: str) -> str:
    """Look at a black picture, for which everything is loaded that a face needs; its name."""
    import numpy as np

    from downstream_hpe.prediction.landmarkers import open_landmarker

    landmarker = open_landmarker(name)
    try:
        landmarker.mesh(np.zeros((LOOK, LOOK, 3), np.uint8), 1)
    finally:
        landmarker.close()
    return name
