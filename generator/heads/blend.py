# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads in Blender scenes: what a .blend holds, as Blender itself says, and its head as plain arrays.

A scene is opened by processes with Blender alone, which run none of its scripts: see
:mod:`generator.blender.scene_file`.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from generator.errors import HeadError, UsageError
from generator.escape import printable
from generator.heads.folders import UNKNOWN_LICENSE
from generator.heads.head import NEUTRAL, SCENE, Finder, Head, SkippedHead, is_scene
from generator.heads.mesh import HeadMesh
from generator.heads.package import load_package
from generator.heads.paths import check_name
from generator.interpreter import python_command, python_environment
from generator.names import name_problem
from generator.reading import check_regular, parse_json, read_limited
from litert_faces.installing import install_command

MAX_BLEND_BYTES = 1 << 35
MAX_ANSWER_BYTES = 1 << 24
DEADLINE_S = 300.0
_STARTS = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""Of a .blend: as it is, and packed by Blender 3.0 or later, or by an earlier one."""


def find_scene(path: Path, head_object: str = "") -> tuple[list[Head], list[SkippedHead]]:
    """The head of a .blend: as the scene stands, and with each of its shape keys; nothing for another path.

    head_object: the object or collection that is the head, where the scene does not say.
    Raises UsageError: it is no .blend, cannot be opened, or does not say what its head is.
    """
    if not is_scene(path) or not path.is_file():
        return [], []
    try:
        check_regular(path, MAX_BLEND_BYTES)
        with path.open("rb") as file:
            start = file.read(8)
        status = path.stat()
    except (OSError, ValueError) as error:
        raise UsageError(f"{path}: cannot be read ({error})") from error
    if not start.startswith(_STARTS):
        raise UsageError(f"{path}: not a .blend; save it in Blender again")
    said = _described(path, status.st_mtime_ns, status.st_size, head_object)
    try:
        subject = check_name(path.stem, "subject")
    except HeadError as error:
        raise UsageError(f"{path}: {error}") from error
    outside = tuple(map(Path, said["files"]))
    heads = []
    for expression, key in {NEUTRAL: "", **_expressions(said["shape_keys"])}.items():
        head = Head(
            subject=subject,
            expression=expression,
            source=SCENE,
            mesh_path=path,
            files=(path, *outside),
            problems=(*said["problems"], UNKNOWN_LICENSE),
            head_object=said["head_object"],
            shape_key=key,
        )
        heads.append(head)
    return heads, []


def read_scene(head: Head, scratch: Path, import_with_blender: Callable[..., Path] | None) -> HeadMesh:
    """The head's surface as it is rendered: modifiers, armature and shape key done; metres, and its own axes.

    Raises HeadError: no Blender, or there is no surface.
    """
    if import_with_blender is None:
        raise HeadError("a scene is read by Blender, which is not available here")
    return load_package(import_with_blender(head.mesh_path, scratch, head.head_object, head.shape_key))


def _expressions(keys: list[str]) -> dict[str, str]:
    """Shape keys by the names of their expressions, which become names of files."""
    found: dict[str, str] = {}
    for key in keys:
        name = "".join(c if not name_problem(f"a{c}a") else "_" for c in key).strip(" ._") or "key"
        taken = {NEUTRAL, *(other.casefold() for other in found)}
        numbered = (name if k == 1 else f"{name}_{k}" for k in range(1, len(keys) + 3))
        found[next(one for one in numbered if one.casefold() not in taken)] = key
    return found


@lru_cache(maxsize=16)
def _described(path: Path, _changed: int, _size: int, head_object: str) -> dict[str, Any]:
    """What :mod:`generator.blender.describe` says of a .blend. Raises UsageError with its reason."""
    if find_spec("bpy") is None:
        remedy = install_command("build")
        raise UsageError(f"{path}: a scene is read with bpy: {remedy} with Python 3.11")
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "scene.json"
        command = python_command("generator.blender.describe", str(path), str(answer), head_object)
        # Not another colour management, as in render workers; and what Blender leaves behind goes with ours.
        own = {"OCIO": "", **dict.fromkeys(("TMPDIR", "TEMP", "TMP"), folder)}
        try:
            subprocess.run(
                command,
                env={**python_environment(), **own},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=DEADLINE_S,
                check=False,
            )
            said = parse_json(read_limited(answer, MAX_ANSWER_BYTES))
        except subprocess.TimeoutExpired as error:
            raise UsageError(f"{path}: Blender did not open it within {DEADLINE_S:.0f} s") from error
        except (OSError, ValueError) as error:
            raise UsageError(f"{path}: Blender ended while it opened the file; is it damaged?") from error
    if said["error"]:
        raise UsageError(printable(f"{path}: {said['error']}"))
    return said


FINDER = Finder(find_scene, choose=find_scene)
