# SPDX-License-Identifier: GPL-3.0-or-later
"""Configurations, heads and numbers that nobody means: one line each, in seconds."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hostile_command import Command
from hostile_files import DEEP, NO_FILES
from PIL import Image

from generator.dataset.format.passes import read_channels, write_passes
from generator.dataset.show.report.facts import timings
from generator.errors import DatasetError, UsageError
from generator.execution.executors import ray
from generator.heads.describe import describe_source
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.limits import MAX_HEADS, MAX_POSES
from generator.plan.config import load_config
from generator.plan.pose_plans import plan_poses
from generator.reading import parse_json, parse_toml

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases" / "hostile"

CONFIGS: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "brackets": lambda path: path.write_text("a = " + "[" * DEEP),
    "tables": lambda path: path.write_text("a = " + "{a=" * DEEP),
    "dots": lambda path: path.write_text("a" + ".a" * DEEP + " = 1"),
    "quoted dots": lambda path: path.write_text('"="' + '."="' * DEEP + " = 1"),
    "digits": lambda path: path.write_text("[poses]\ncount = " + "9" * 5000),
    "large": lambda path: path.write_text("#" * (1 << 23)),
    "noise": lambda path: path.write_bytes(bytes(range(256))),
    "other kind": lambda path: path.write_text("[render]\nresolution = " + "[" * 200 + "]" * 200),
}


@pytest.mark.timeout(30)
@pytest.mark.parametrize("payload", CONFIGS)
def test_a_configuration_that_nobody_wrote(payload: str, command: Command, tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    CONFIGS[payload](path)
    code, said = command("headturn", "build", path, "--out", tmp_path / "d")
    assert code == 2 and said.count("headturn: ") == 1 and "c.toml" in said
    assert len(said) < 600 and not (tmp_path / "d").exists()


HUGE = "1" + "0" * 26
NUMBERS = [
    *(["build", option, HUGE] for option in ("--count", "--seed", "--sampled-expressions", "--resolution")),
    *(["build", option, HUGE] for option in ("--samples", "--unit-size", "--workers", "--deadline")),
    *(["build", "--memory", HUGE], ["build", "--poses", f"uniform:{HUGE}"], ["build", "--lens", HUGE]),
    *(["build", "--poses", "sobol:" + "9" * 5000], ["build", "--yaw=-50,50,1e-300"]),
    *(["build", f"--yaw={axis}"] for axis in ("-50,50,1e-26", "-50,50,7.000000000000001", "1e26,2e26,1")),
    ["verify", "x", "--workers", HUGE],
    *(["compact", "x", "--out", "y", "--megabytes", HUGE], ["heads", "make", "--out", "z", "--count", HUGE]),
    ["heads", "make", "--out", "z", "--seed", HUGE],
]  # fmt: skip


@pytest.mark.timeout(30)
@pytest.mark.parametrize("words", NUMBERS, ids=lambda words: " ".join(words)[:60])
def test_a_number_that_nobody_means(
    words: list[str], command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    # Never as far as a renderer.
    monkeypatch.setattr("generator.execution.executors.open.open_executor", _no_executor)
    code, said = command("headturn", *words)
    assert code in (1, 2) and "Traceback" not in said and len(said) < 1500, said
    assert [p for p in tmp_path.iterdir() if p.name != "dataset"] == []


def _no_executor(**_: object) -> object:
    import contextlib

    return contextlib.nullcontext()


def test_rows_are_counted_before_poses_are_drawn() -> None:
    config = load_config(None, {"poses": {"kind": "uniform", "count": MAX_POSES}})
    with pytest.raises(UsageError, match="rows, more than"):
        plan_poses(config, [("s", str(k)) for k in range(1000)])


def test_heads_are_counted_before_one_is_made(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="more than 100,000 meshes"):
        make_heads(tmp_path / "heads", count=MAX_HEADS, seed=0, expressions=1000)
    assert not (tmp_path / "heads").exists()


@pytest.mark.timeout(30)
@pytest.mark.parametrize("payload", NO_FILES)
def test_a_table_of_poses_is_a_file(payload: str, command: Command, tmp_path: Path) -> None:
    NO_FILES[payload](tmp_path / "p.csv")
    code, said = command("headturn", "build", "--poses", tmp_path / "p.csv", "--out", tmp_path / "d")
    assert code == 2 and "p.csv" in said and "not a regular file" in said


def test_nested_too_deeply_is_a_value_error() -> None:
    for text in ("[" * DEEP, '{"a":' * DEEP):
        with pytest.raises(ValueError, match=r"deep|Expecting"):
            parse_json(text)
    with pytest.raises(ValueError, match="deep"):
        parse_toml("a = " + "[" * DEEP)
    with pytest.raises(ValueError, match="deep"):
        ray.parse_json("[" * DEEP)
    assert parse_toml('a = [0.5, 1.5, "x.y"]\n[b.c]\nd.e = 1')["b"] == {"c": {"d": {"e": 1}}}


LOG = '12:00 unit {"seconds": {"load": 1.5}}\n'
LOGS = {
    "cut": (LOG + LOG[:30], {"load": 1.5}),
    "brackets": (LOG + "12:01 unit " + "[" * DEEP, {"load": 1.5}),
    "other kinds": (LOG + '12:01 unit {"seconds": [1]}\n12:02 unit 7\n', {"load": 1.5}),
    "text": (LOG + '12:03 unit {"seconds": {"load": "x"}}', {"load": 1.5}),
    "infinite": (LOG + '12:01 unit {"seconds": {"load": Infinity, "x": -1.0, "y": NaN}}', {"load": 1.5}),
    "nothing": ("\n\n12:00\n", None),
}  # fmt: skip


@pytest.mark.parametrize("name", LOGS)
def test_a_log_that_a_build_did_not_end(name: str, tmp_path: Path) -> None:
    text, expected = LOGS[name]
    (tmp_path / "build.log").write_text(text)
    assert timings(tmp_path / "build.log") == expected


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def _ply(faces: str, count: int = 1) -> Callable[[Path], object]:
    header = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {count}\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
    )
    return lambda folder: (folder / "h.ply").write_text(header + faces)


def _gltf(**parts: object) -> Callable[[Path], object]:
    header = {"asset": {"version": "2.0"}, **parts}
    return lambda folder: (folder / "h.gltf").write_text(json.dumps(header))


def _text(name: str, text: str, numbers: Sequence[int] = ()) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(text.format(*numbers) if numbers else text)


def _mtl(text: str) -> Callable[[Path], object]:
    def write(folder: Path) -> None:
        (folder / "h.obj").write_text("mtllib h.mtl\n" + TRIANGLE + "f 1 2 3\n")
        (folder / "h.mtl").write_text(text)

    return write


GLB = struct.pack("<5I", 0x46546C67, 2, 99, 1 << 31, 0)
NAMES = [str(k) for k in range(20_000)]
CHAIN = [{"children": [k + 1]} for k in range(5000)] + [{}]
HEADS: dict[str, Callable[[Path], object]] = {
    "two corners": _ply("2 0 1\n"),
    "no corners": _ply("0\n"),
    "many faces": _ply("", 10**26),
    "20,000 materials of an OBJ": _text("h.obj", TRIANGLE + "usemtl {}\nf 1 2 3\n" * 20_000, range(20_000)),
    "20,000 materials of an MTL": _mtl("".join(f"newmtl m{k}\nKd 1 1 1\n" for k in range(20_000))),
    "20,000 materials of a glTF": _gltf(materials=[{}] * 20_000, meshes=[]),
    "20,000 nodes": _gltf(nodes=[{"mesh": 0}] * 20_000, meshes=[{"primitives": []}]),
    "20,000 pieces": _gltf(meshes=[{"primitives": [{"attributes": {}}] * 20_000}]),
    "a chain of nodes": _gltf(nodes=CHAIN, meshes=[]),
    "no bytes behind": _gltf(accessors=[{"count": 10**9, "type": "MAT4", "componentType": 5126}], meshes=[]),
    "one view a thousand times": _gltf(bufferViews=[{"buffer": 0, "byteLength": 10**6}] * 1000, meshes=[]),
    "a huge count": _gltf(accessors=[{"count": 10**26, "type": "VEC3", "componentType": 5126}], meshes=[]),
    "other kinds": _gltf(buffers=3, images={"a": 1}, meshes="x", nodes=[[]]),
    "brackets": _text("h.gltf", "[" * DEEP),
    "millions of values": _text("h.gltf", "[" + "0," * 3_000_000 + "0]"),
    "brackets in head.json": _text("head.json", "[" * DEEP),
    "nested head.json": _text("head.json", '{"expressions":' * DEEP),
    "20,000 expressions": _text("head.json", json.dumps({"expressions": dict.fromkeys(NAMES, "h.obj")})),
    "large head.json": _text("head.json", " " * (1 << 23)),
    "broken GLB": lambda folder: (folder / "h.glb").write_bytes(GLB),
    **{
        f"{kind} {name}": (lambda folder, name=name, make=make: make(folder / name))
        for kind, make in NO_FILES.items()
        for name in ("h.obj", "h.ply", "h.glb", "h.gltf", "h.fbx", "head.json")
    },
}  # fmt: skip


@pytest.mark.timeout(30)
@pytest.mark.parametrize("name", HEADS)
def test_a_head_that_nobody_made_is_skipped_with_its_reason(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "h"
    folder.mkdir()
    HEADS[name](folder)
    rows = describe_source(find_heads(tmp_path), deep=True)
    assert len(rows) == 1
    assert rows[0]["vertices"] is None
    assert rows[0]["problems"] and all(len(p) < 700 and "\n" not in p for p in rows[0]["problems"])
    assert rows[0]["skipped"]


def test_a_chain_that_a_rig_may_have_is_read(tmp_path: Path) -> None:
    import trimesh

    scene = trimesh.Scene(trimesh.creation.icosphere(subdivisions=1))
    files = scene.export(file_type="gltf")
    for name, data in files.items():
        (tmp_path / name.replace("model.gltf", "head.gltf")).write_bytes(data)
    header = json.loads((tmp_path / "head.gltf").read_text())
    first = len(header["nodes"])
    header["nodes"] += [{"children": [first + k + 1]} for k in range(100)] + [{"mesh": 0}]
    header["nodes"][0].setdefault("children", []).append(first)
    (tmp_path / "head.gltf").write_text(json.dumps(header))
    [row] = describe_source(find_heads(tmp_path / "head.gltf"), deep=True)
    assert row["vertices"], row["problems"]


def _attribute(data: bytes, name: bytes, change: Callable[[bytearray, int], None]) -> bytes:
    """change gets the place of the attribute's name."""
    changed = bytearray(data)
    change(changed, data.index(name))
    return bytes(changed)


def _put(offset: int, value: bytes) -> Callable[[bytearray, int], None]:
    def change(data: bytearray, at: int) -> None:
        data[at + offset : at + offset + len(value)] = value

    return change


# name and type with their zeros stand before the size and the value
_WINDOW = len(b"dataWindow\0box2i\0") + 4
EXRS = {
    "no text": (b"headturn.frame", _put(len(b"headturn.frame\0string\0") + 4, b"\xff\xfe\xff")),
    "no name": (b"dataWindow", _put(0, b"\xff\xfe")),
    "a huge window": (b"dataWindow", _put(_WINDOW + 8, struct.pack("<2i", 10**9, 10**9))),
    "a negative window": (b"dataWindow", _put(_WINDOW + 8, struct.pack("<2i", -9, -9))),
    "a size": (b"dataWindow", _put(_WINDOW - 4, struct.pack("<i", 1 << 30))),
    "a negative size": (b"dataWindow", _put(_WINDOW - 4, struct.pack("<i", -1))),
    "an unknown compression": (b"compression", _put(len(b"compression\0compression\0") + 4, b"\x09")),
    "tiles": (b"\x02\0\0\0", _put(1, b"\x02")),
    "another version": (b"\x02\0\0\0", _put(0, b"\x07")),
}


@pytest.mark.parametrize("name", EXRS)
def test_a_header_of_openexr_is_blamed_on_its_own_file(name: str, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    path = tmp_path / "p.exr"
    write_passes({"depth.Z": np.ones((16, 16), np.float32)}, path)
    read_channels(path)
    place, change = EXRS[name]
    path.write_bytes(_attribute(path.read_bytes(), place, change))
    with pytest.raises(DatasetError, match=r"p\.exr: not a readable OpenEXR"):
        read_channels(path)


@pytest.mark.parametrize("payload", NO_FILES)
def test_passes_are_a_file(payload: str, tmp_path: Path) -> None:
    pytest.importorskip("OpenEXR")
    NO_FILES[payload](tmp_path / "p.exr")
    with pytest.raises(DatasetError, match=r"p\.exr.*not a regular file"):
        read_channels(tmp_path / "p.exr")


@pytest.mark.skipif(not CASES.exists(), reason="the cases are not beside this checkout")
def test_cases_that_failed(tmp_path: Path) -> None:
    Image.new("RGB", (8, 8)).save(tmp_path / "t.png")
    (tmp_path / "h.ply").write_bytes((CASES / "two_corner_face.ply").read_bytes())
    [row] = describe_source(find_heads(tmp_path), deep=True)
    assert "fewer than three corners" in row["problems"][-1]
    pytest.importorskip("OpenEXR")
    with pytest.raises(DatasetError, match=r"header\.exr"):
        read_channels(CASES / "header.exr")
