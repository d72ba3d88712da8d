# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of ICT-FaceKit: the layouts that are read, and everything that may be wrong with one."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from generator.errors import HeadError, UsageError
from generator.heads.ict import source
from generator.heads.ict.source import LANDMARKS, MODES, find_folder, read_facekit

COUNT = 70
POINTS = np.random.default_rng(0).normal(0, 5, (COUNT, 3)).round(4)
DELTA = np.random.default_rng(1).normal(0, 0.1, (len(MODES), COUNT, 3)).astype(np.float16)


def obj(points: np.ndarray) -> str:
    lines = "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points.tolist())
    return f"# a test\n{lines}vt 0 0\nusemtl M_Face\nf 1/1 2/1 3/1\n"


def light(folder: Path) -> Path:
    """A copy of 70 vertices and a triangle."""
    folder.mkdir(parents=True)
    (folder / "generic_neutral_mesh.obj").write_text(obj(POINTS))
    (folder / "vertex_indices.json").write_text(json.dumps({"idx_to_landmark_verts": list(range(LANDMARKS))}))
    np.savez(folder / "modes.npz", names=np.array(MODES), delta_cm=DELTA)
    return folder


def published(root: Path) -> Path:
    folder = light(root / "FaceXModel")
    (folder / "modes.npz").unlink()
    for name, delta in zip(MODES, DELTA.astype(float), strict=True):
        (folder / f"{name}.obj").write_text(obj(POINTS + delta))
    return folder


def test_every_layout_gives_the_same(tmp_path: Path) -> None:
    folder = published(tmp_path / "clone")
    assert find_folder(str(tmp_path / "clone")) == find_folder(str(folder)) == folder
    whole, small = read_facekit(folder), read_facekit(find_folder(str(light(tmp_path / "light"))))
    assert np.abs(whole.neutral - POINTS).max() < 1e-9
    assert np.abs(whole.modes - DELTA).max() < 2e-6 and np.abs(small.modes - DELTA).max() == 0
    assert whole.landmarks.tolist() == small.landmarks.tolist() == list(range(LANDMARKS))


def test_files_of_windows_are_read(tmp_path: Path) -> None:
    folder = published(tmp_path / "clone")
    for path in folder.glob("*.obj"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert np.abs(read_facekit(folder).modes - DELTA).max() < 2e-6


def test_a_copy_is_read_once_a_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = published(tmp_path / "clone")
    first = read_facekit(folder)
    monkeypatch.setattr(source, "read_limited", None)
    assert read_facekit(folder) is first


@pytest.mark.parametrize("argument", ["", "  "])
def test_a_folder_has_to_be_named(argument: str) -> None:
    with pytest.raises(UsageError, match=r"names no folder; .*ICT-FaceKit.*--heads ict:/data/ICT-FaceKit"):
        find_folder(argument)


def test_what_is_no_copy_is_told_from_one(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="nowhere: no such folder"):
        find_folder(str(tmp_path / "nowhere"))
    (tmp_path / "file").write_text("x")
    with pytest.raises(UsageError, match="file: not a folder"):
        find_folder(str(tmp_path / "file"))
    with pytest.raises(UsageError, match=r"neither generic_neutral_mesh\.obj nor FaceXModel/"):
        find_folder(str(tmp_path))


def rewrite(name: str, change: Callable[[str], str]) -> Callable[[Path], None]:
    return lambda folder: (folder / name).write_text(change((folder / name).read_text())) and None


def remove(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def packed(**arrays: np.ndarray) -> Callable[[Path], None]:
    """modes.npz with other arrays."""
    given = {"names": np.array(MODES), "delta_cm": DELTA, **arrays}
    return lambda folder: np.savez(folder / "modes.npz", **given)  # type: ignore[arg-type]


def with_nan(delta: np.ndarray) -> np.ndarray:
    changed = delta.copy()
    changed[3, 4, 1] = np.nan
    return changed


def bomb(folder: Path) -> None:
    """Thousands of bytes that say they unpack to more than any machine holds."""
    with zipfile.ZipFile(folder / "modes.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        for name, shape in (("names", (len(MODES),)), ("delta_cm", (10**6, 10**6, 3))):
            with archive.open(f"{name}.npy", "w") as file:
                kind = "<U16" if name == "names" else "<f2"
                header = {"descr": kind, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(file, header)


def zeros(folder: Path) -> None:
    packing = zipfile.ZipFile(folder / "modes.npz", "a", zipfile.ZIP_DEFLATED)
    with packing as archive, archive.open("more.npy", "w") as file:
        for _ in range(65):
            file.write(bytes(1 << 23))


def garble(folder: Path) -> None:
    (folder / "modes.npz").write_bytes(b"PK\x03\x04 and no more")


def pickled(folder: Path) -> None:
    np.savez(folder / "modes.npz", names=np.array(MODES), delta_cm=np.array([{}], dtype=object))


def huge(name: str) -> Callable[[Path], None]:
    def grow(folder: Path) -> None:
        with (folder / name).open("r+b") as file:
            file.truncate(source.MAX_FILE_BYTES + 1)

    return grow


def lists(value: object) -> str:
    return json.dumps({"idx_to_landmark_verts": value})


LIGHT = {
    "neutral of nothing": (
        rewrite("generic_neutral_mesh.obj", lambda _: "hello\n"),
        "no vertices or no faces",
    ),
    "neutral with NaN": (
        rewrite("generic_neutral_mesh.obj", lambda text: text.replace("\nv ", "\nv nan 0 0\nv ", 1)),
        "no number within 1000 cm",
    ),
    "neutral too large": (huge("generic_neutral_mesh.obj"), "more than the 67108864"),
    "neutral with a broken face": (
        rewrite("generic_neutral_mesh.obj", lambda text: text + "f 1 2\n"),
        "line 75 cannot be read",
    ),
    "no landmarks": (remove("vertex_indices.json"), "vertex_indices.json: is missing"),
    "landmarks are no JSON": (rewrite("vertex_indices.json", lambda _: "["), "no list idx_to_landmark_verts"),
    "landmarks nested": (rewrite("vertex_indices.json", lambda _: "[" * 200_000), "idx_to_landmark_verts"),
    "landmarks of text": (rewrite("vertex_indices.json", lambda _: lists("abc")), "idx_to_landmark_verts"),
    "landmarks too few": (rewrite("vertex_indices.json", lambda _: lists([1, 2])), "of 68 vertices"),
    "landmarks of halves": (rewrite("vertex_indices.json", lambda _: lists([0.5] * 68)), "of 68 vertices"),
    "landmarks nowhere": (
        rewrite("vertex_indices.json", lambda _: lists([COUNT] * 68)),
        "outside of 0 to 69",
    ),
    "landmarks beyond numbers": (
        rewrite("vertex_indices.json", lambda _: lists([10**30] * 68)),
        "idx_to_landmark_verts",
    ),
    "modes are no zip": (garble, "modes.npz: cannot be read"),
    "modes of other vertices": (packed(delta_cm=DELTA[:, :-1]), r"\(152, 69, 3\).*names x 70 vertices"),
    "a mode is missing": (packed(names=np.array(("x", *MODES[1:]))), "lacks 'identity000'"),
    "modes with NaN": (packed(delta_cm=with_nan(DELTA)), "no number within 1000 cm"),
    "modes of whole numbers": (packed(delta_cm=DELTA.astype(int)), "no decimal numbers"),
    "modes that unpack to a terabyte": (bomb, r"\(1000000, 1000000, 3\)"),
    "modes with much beside": (zeros, "unpacks to more than"),
    "modes that are pickled": (pickled, r"\(1,\)"),
}


@pytest.mark.parametrize(("change", "says"), LIGHT.values(), ids=LIGHT.keys())
def test_a_light_copy_that_is_not_as_it_should_be(
    change: Callable[[Path], None], says: str, tmp_path: Path
) -> None:
    folder = light(tmp_path / "light")
    change(folder)
    refused(folder, says)


PUBLISHED = {
    "a mode is missing": (remove("jawOpen.obj"), "jawOpen.obj: is missing; take ICT-FaceKit"),
    "a mode has a vertex less": (
        rewrite("identity007.obj", lambda _: obj(POINTS[1:])),
        "identity007.obj: has 69 vertices where generic_neutral_mesh.obj has 70",
    ),
    "a mode has no vertices": (rewrite("identity007.obj", lambda _: ""), "has 0 vertices"),
    "a mode is text": (
        rewrite("identity007.obj", lambda text: text.replace("\nv ", "\nv x", 1)),
        "identity007.obj: ",
    ),
    "a mode with NaN": (
        rewrite("identity007.obj", lambda _: obj(np.where(np.arange(COUNT)[:, None] == 3, np.nan, POINTS))),
        "identity007.obj: a coordinate is no number within",
    ),
    "a mode too large": (huge("mouthSmile_L.obj"), "mouthSmile_L.obj: has 67108865 bytes"),
    "a mode is a folder": (
        lambda folder: (folder / "jawOpen.obj").unlink() or (folder / "jawOpen.obj").mkdir(),
        "jawOpen.obj: cannot be read",
    ),
}


@pytest.mark.parametrize(("change", "says"), PUBLISHED.values(), ids=PUBLISHED.keys())
def test_a_published_copy_that_is_not_as_it_should_be(
    change: Callable[[Path], None], says: str, tmp_path: Path
) -> None:
    folder = published(tmp_path / "clone")
    change(folder)
    refused(folder, says)


def refused(folder: Path, says: str) -> None:
    with pytest.raises(HeadError, match=says) as error:
        read_facekit(folder)
    said = str(error.value)
    assert "\n" not in said and said.startswith(str(folder))
    assert "take ICT-FaceKit as https://" in said or "export the mesh again" in said


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    folder = published(tmp_path / "clone")
    (folder / "jawOpen.obj").unlink()
    os.mkfifo(folder / "jawOpen.obj")
    refused(folder, "jawOpen.obj: cannot be read")


def test_more_vertices_than_a_head_has_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "MAX_VERTICES", COUNT - 1)
    refused(light(tmp_path / "light"), "more than 69 vertices")
