# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's own copy of ICT-FaceKit: where it lies, and its neutral mesh and modes as arrays.

As its authors publish it, the folder ``FaceXModel`` holds an OBJ a mode, all with the vertices of
``generic_neutral_mesh.obj`` in its order. A light copy holds what differs in ``modes.npz`` instead.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from generator.errors import HeadError, UsageError
from generator.escape import quoted
from generator.heads.mtl import decode
from generator.heads.obj_lines import ObjLines, parse_lines
from generator.reading import check_regular, parse_json, read_limited

ADDRESS = "https://github.com/USC-ICT/ICT-FaceKit"
MODEL_FOLDER = "FaceXModel"
NEUTRAL_FILE = "generic_neutral_mesh.obj"
MODES_FILE = "modes.npz"
LANDMARKS_FILE = "vertex_indices.json"
IDENTITIES = tuple(f"identity{number:03d}" for number in range(100))
LANDMARKS = 68
"""Vertices of the face in :data:`LANDMARKS_FILE`, in the order of Multi-PIE."""

EXPRESSIONS = (
    *(f"{name}_{side}" for name in (
        "browDown", "browInnerUp", "browOuterUp", "cheekPuff", "cheekSquint", "eyeBlink", "eyeLookDown",
        "eyeLookIn", "eyeLookOut", "eyeLookUp", "eyeSquint", "eyeWide", "mouthDimple", "mouthFrown",
        "mouthLowerDown", "mouthPress", "mouthSmile", "mouthStretch", "mouthUpperUp", "noseSneer",
    ) for side in "LR"),
    "jawForward", "jawLeft", "jawOpen", "jawRight", "mouthFunnel", "mouthLeft", "mouthPucker",
    "mouthRight", "mouthRollLower", "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper",
)  # fmt: skip
"""Of the 53 expressions those that are mixed here."""

MODES = (*IDENTITIES, *EXPRESSIONS)
MAX_FILE_BYTES = 1 << 26
"""Of a mesh; the published ones have 2.5 MB."""

MAX_MODES_BYTES = 1 << 29
"""Of what modes.npz unpacks to; the light copy has 25 MB."""

MAX_MODES = 1000
MAX_VERTICES, MAX_CORNERS = 1 << 17, 1 << 20
"""The published mesh has 26,719, each with a place in every mode, and faces with 104,988 corners."""

MAX_CM = 1000.0


@dataclass(frozen=True)
class FaceKit:
    """What was read. mesh: lines of the neutral OBJ, V vertices in cm, frame U.

    neutral float64 [V, 3] cm. modes: float32 [len(MODES), V, 3] cm, differences from neutral.
    landmarks: int [LANDMARKS] vertices.
    """

    mesh: ObjLines
    neutral: np.ndarray
    modes: np.ndarray
    landmarks: np.ndarray


def find_folder(argument: str) -> Path:
    """The folder with :data:`NEUTRAL_FILE`: the one named, or ``FaceXModel`` in it.

    Raises UsageError: it is not there, or no folder.
    """
    example = "--heads ict:/data/ICT-FaceKit"
    if not argument.strip():
        raise UsageError(f"--heads ict: names no folder; give that of ICT-FaceKit ({ADDRESS}): {example}")
    given = Path(argument)
    if not given.exists():
        raise UsageError(f"{given}: no such folder; give that of ICT-FaceKit ({ADDRESS}): {example}")
    if not given.is_dir():
        raise UsageError(f"{given}: not a folder; give that of ICT-FaceKit, with {MODEL_FOLDER} in it")
    for folder in (given, given / MODEL_FOLDER):
        if (folder / NEUTRAL_FILE).exists():
            return folder.absolute()
    raise UsageError(
        f"{given}: neither {NEUTRAL_FILE} nor {MODEL_FOLDER}/{NEUTRAL_FILE} is there; "
        f"give the folder of ICT-FaceKit as {ADDRESS} has it"
    )


@lru_cache(maxsize=1)
def read_facekit(folder: Path) -> FaceKit:
    """Everything of the folder of :func:`find_folder`, once a process: three seconds for 140 OBJs.

    Raises HeadError: a file is missing, too large, or not what it should be.
    """
    mesh = _read_neutral(folder / NEUTRAL_FILE)
    neutral = mesh.table(mesh.positions, 3).copy()
    landmarks = _read_landmarks(folder / LANDMARKS_FILE, len(neutral))
    packed = folder / MODES_FILE
    modes = _read_packed(packed, len(neutral)) if packed.exists() else _read_meshes(folder, neutral)
    return FaceKit(mesh, neutral, modes, landmarks)


def _read_neutral(path: Path) -> ObjLines:
    text = decode(_read(path, MAX_FILE_BYTES))
    try:
        mesh = parse_lines(text)
    except HeadError as error:
        raise HeadError(f"{path}: {error}") from error
    if not mesh.positions or not mesh.face_corners:
        raise HeadError(f"{path}: has no vertices or no faces; {_again()}")
    if len(mesh.positions) > 3 * MAX_VERTICES:
        raise HeadError(f"{path}: has more than {MAX_VERTICES:,} vertices; {_again()}")
    if len(mesh.corner_position) > MAX_CORNERS:
        raise HeadError(f"{path}: its faces have more than {MAX_CORNERS:,} corners; {_again()}")
    _check_reach(path, mesh.table(mesh.positions, 3))
    return mesh


def _check_reach(path: Path, numbers: np.ndarray) -> None:
    # Written so that what is no number does not pass.
    if not (np.abs(numbers) < MAX_CM).all():
        raise HeadError(f"{path}: a coordinate is no number within {MAX_CM:g} cm; {_again()}")


def _read_landmarks(path: Path, count: int) -> np.ndarray:
    try:
        value: Any = parse_json(_read(path, MAX_FILE_BYTES))
        found = value["idx_to_landmark_verts"]
        landmarks = np.array(found)
        if landmarks.shape != (LANDMARKS,) or landmarks.dtype.kind != "i":
            raise ValueError("has another shape")
    except (ValueError, KeyError, TypeError, OverflowError) as error:
        raise HeadError(
            f"{path}: no list idx_to_landmark_verts of {LANDMARKS} vertices in it; {_again()}"
        ) from error
    if landmarks.min() < 0 or landmarks.max() >= count:
        raise HeadError(f"{path}: names a vertex outside of 0 to {count - 1} of {NEUTRAL_FILE}; {_again()}")
    return landmarks


def _read_meshes(folder: Path, neutral: np.ndarray) -> np.ndarray:
    modes = np.empty((len(MODES), *neutral.shape), dtype=np.float32)
    for mode, name in zip(modes, MODES, strict=True):
        mode[:] = _vertices(folder / f"{name}.obj", len(neutral)) - neutral
    return modes


def _vertices(path: Path, count: int) -> np.ndarray:
    """float64 [count, 3] of an OBJ, of which nothing else is read."""
    lines = _read(path, MAX_FILE_BYTES).split(b"\nv ")
    # The last vertex is followed by what is left of the file.
    lines[-1] = lines[-1].partition(b"\n")[0]
    first = 0 if lines[0].startswith(b"v ") else 1
    lines[0] = lines[0].removeprefix(b"v ")
    try:
        numbers = np.array(b" ".join(lines[first:]).split(), dtype=np.float64)
    except ValueError as error:
        raise HeadError(f"{path}: a vertex line is not made of three numbers; {_again()}") from error
    if len(numbers) != 3 * count or len(lines) - first != count:
        raise HeadError(
            f"{path}: has {len(lines) - first} vertices where {NEUTRAL_FILE} has {count}, each of three "
            f"numbers; {_again()}"
        )
    _check_reach(path, numbers)
    return numbers.reshape(count, 3)


def _read_packed(path: Path, count: int) -> np.ndarray:
    """The modes of a light copy: ``names`` [M] and ``delta_cm`` float [M, V, 3]."""
    try:
        check_regular(path, MAX_MODES_BYTES)
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MAX_MODES_BYTES:
                raise HeadError(f"{path}: unpacks to more than {MAX_MODES_BYTES} bytes; {_again()}")
            names, delta = (_header(archive, f"{key}.npy") for key in ("names", "delta_cm"))
        if delta[0] != (*names[0], count, 3) or len(names[0]) != 1 or names[0][0] > MAX_MODES:
            raise HeadError(
                f"{path}: delta_cm has the shape {delta[0]}, names {names[0]}; expected names x {count} "
                f"vertices of {NEUTRAL_FILE} x 3; {_again()}"
            )
        if names[1].kind != "U" or delta[1].kind != "f":
            raise HeadError(f"{path}: names are no text or delta_cm no decimal numbers; {_again()}")
        with np.load(path, allow_pickle=False) as packed:
            known = {str(name): row for row, name in enumerate(packed["names"])}
            missing = [name for name in MODES if name not in known]
            if missing:
                raise HeadError(f"{path}: lacks {quoted(missing[0])}; {_again()}")
            modes = packed["delta_cm"][[known[name] for name in MODES]].astype(np.float32)
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, NotImplementedError) as error:
        raise HeadError(f"{path}: cannot be read ({error}); {_again()}") from error
    _check_reach(path, modes)
    return modes


def _header(archive: zipfile.ZipFile, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array, before anything of it is unpacked."""
    with archive.open(name) as file:
        version = np.lib.format.read_magic(file)
        if version == (1, 0):
            shape, _, dtype = np.lib.format.read_array_header_1_0(file)
        else:
            shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    return shape, dtype


def _read(path: Path, limit: int) -> bytes:
    try:
        return read_limited(path, limit)
    except FileNotFoundError as error:
        raise HeadError(f"{path}: is missing; {_again()}") from error
    except ValueError as error:
        raise HeadError(f"{path}: {error}; {_again()}") from error
    except OSError as error:
        raise HeadError(f"{path}: cannot be read ({error.strerror or error}); {_again()}") from error


def _again() -> str:
    return f"take ICT-FaceKit as {ADDRESS} has it"
