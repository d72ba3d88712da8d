# SPDX-License-Identifier: MIT
"""What downstream-hpe opens: graphs, labels, archives, tables, pictures, videos and models of strangers."""

from __future__ import annotations

import io
import shutil
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hostile_command import Command
from hostile_files import DEEP, JP2, NO_FILES, npy_header, npz, npz_of, png
from memory import peak_mb
from PIL import Image
from scipy.io import savemat

from downstream_hpe.errors import DataError, HpeError, ModelError
from downstream_hpe.evaluation.archive import read_npz
from downstream_hpe.evaluation.matlab import read_arrays
from downstream_hpe.evaluation.reference import load_reference
from downstream_hpe.model_file import read_safetensors, unpacked
from downstream_hpe.prediction.onnx_file import fault
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.tables.open import open_tables
from downstream_hpe.tables.pose_zero import pose_zero

CASES = Path(__file__).resolve().parents[3] / "shared" / "cases" / "hostile"
sys.path.append(str(Path(__file__).resolve().parents[1] / "downstream_hpe"))

onnx = pytest.importorskip("onnx")
from tiny_onnx import tiny_model  # noqa: E402


def _graph(*nodes: tuple[str, list[str], str, dict[str, Any]], **constants: np.ndarray) -> bytes:
    """The tiny model with more in front."""
    model = tiny_model()
    for name, value in constants.items():
        model.graph.initializer.append(onnx.numpy_helper.from_array(value, name))
    for place, (kind, inputs, output, attributes) in enumerate(nodes):
        node = onnx.helper.make_node(kind, inputs, [output], **attributes)
        model.graph.node.insert(place, node)
    return bytes(model.SerializeToString())


COLUMN, ROW = np.zeros((1 << 15, 1), np.float32), np.zeros((1, 1 << 15), np.float32)
MANY = np.zeros(1 << 20, np.int64)
FLAT = np.array([-1])


def _lying() -> bytes:
    model = tiny_model()
    model.graph.initializer[1].dims[:] = [1 << 20, 1 << 20]
    return bytes(model.SerializeToString())


def _twice() -> bytes:
    model = tiny_model()
    whole = model.SerializeToString()
    return bytes(whole + b"\x3a\x00")  # another graph, which some readers merge


def _constant(**attributes: Any) -> bytes:
    model = tiny_model()
    model.graph.node.insert(0, onnx.helper.make_node("Constant", [], ["k"], **attributes))
    return bytes(model.SerializeToString())


FOREIGN = [
    "Tile",
    "Expand",
    "Range",
    "ConstantOfShape",
    "Resize",
    "Upsample",
    "Pad",
    "OneHot",
    "Loop",
    "Scan",
    "If",
    "NonZero",
    "Einsum",
    "Conv",
    "RandomNormal",
    "EyeLike",
    "CumSum",
    "GatherND",
]
GRAPHS: dict[str, tuple[bytes, str]] = {
    "concat": (_graph(("Concat", ["landmarks"] * 100, "z", {"axis": 0})), "numbers of 1024 faces"),
    "outer sum": (_graph(("Add", ["c", "r"], "z", {}), c=COLUMN, r=ROW), "numbers of 1024 faces"),
    "outer product": (_graph(("MatMul", ["c", "r"], "z", {}), c=COLUMN, r=ROW), "numbers of 1024 faces"),
    "outer gemm": (_graph(("Gemm", ["c", "c"], "z", {"transB": 1}), c=COLUMN), "numbers of 1024 faces"),
    "choice": (_graph(("Equal", ["c", "r"], "e", {}), c=COLUMN, r=ROW), "numbers of 1024 faces"),
    "gather": (_graph(("Gather", ["landmarks", "i"], "z", {"axis": 1}), i=MANY), "numbers of 1024 faces"),
    "square of faces": (
        _graph(
            ("Reshape", ["landmarks", "f"], "x1", {}),
            ("Unsqueeze", ["x1", "u"], "x2", {}),
            ("Mul", ["x1", "x2"], "z", {}),
            f=FLAT,
            u=np.array([1]),
        ),
        "numbers of 1024 faces",
    ),
    "hours": (
        _graph(*(("MatMul", ["m", "m"], f"m{k}", {}) for k in range(3)), m=np.zeros((3000, 3000), "f4")),
        "take too long",
    ),
    "a computed shape": (
        _graph(("Cast", ["landmarks"], "s", {"to": 7}), ("Reshape", ["landmarks", "s"], "z", {})),
        "computes sizes",
    ),
    "text": (_graph(("Cast", ["landmarks"], "z", {"to": 8})), "it makes text"),
    "no such input": (_graph(("Relu", ["nothing"], "z", {})), "takes what there is not"),
    "unfit": (_graph(("Add", ["landmarks", "c"], "z", {}), c=np.zeros(5, np.float32)), "do not fit"),
    "axis": (_graph(("Concat", ["landmarks"], "z", {"axis": 9})), "an axis is none"),
    "the same name": (_graph(*[("Relu", ["landmarks"], "z", {})] * 2), "two tensors"),
    "2,500 nodes": (_graph(*(("Relu", ["landmarks"], f"z{k}", {}) for k in range(2500))), "more than 2000"),
    "a lying tensor": (_lying(), "holds less than it says"),
    "two graphs": (_twice(), "several graphs"),
    "a list as constant": (_constant(value_floats=[0.0] * 9), "a constant is no tensor"),
    **{name: (_graph((name, ["landmarks"], "z", {})), f"the operation '{name}'") for name in FOREIGN},
}  # fmt: skip


@pytest.mark.parametrize("name", GRAPHS)
def test_a_graph_that_would_fill_the_memory_is_refused_unopened(name: str) -> None:
    model, reason = GRAPHS[name]
    assert reason in (fault(model) or "")


def test_a_graph_of_this_program_is_none_of_these() -> None:
    assert fault(tiny_model().SerializeToString()) is None
    for file in (Path(__file__).resolve().parents[2] / "downstream_hpe" / "models").glob("*.onnx"):
        assert fault(file.read_bytes()) is None


def _mat(compressed: bool = True, **arrays: Any) -> bytes:
    stream = io.BytesIO()
    savemat(stream, arrays, do_compression=compressed)
    return stream.getvalue()


POSE = np.array([[0.1, 0.2, 0.3, 0, 0, 0, 1]])


def _element(kind: int, body: bytes) -> bytes:
    return struct.pack("<2I", kind, len(body)) + body + bytes(-len(body) % 8)


def _matrix(shape: tuple[int, ...], body: bytes, flags: int = 6, stored: int = 9) -> bytes:
    return (
        _element(6, struct.pack("<2I", flags, 0))
        + _element(5, struct.pack(f"<{len(shape)}i", *shape))
        + _element(1, b"Pose_Para")
        + _element(stored, body)
    )


def _file(*elements: bytes) -> bytes:
    return b"MATLAB 5.0".ljust(124) + struct.pack("<H2s", 0x100, b"IM") + b"".join(elements)


MATS = {
    "huge": _file(_element(14, _matrix((1 << 30, 1 << 30), bytes(8)))),
    "negative": _file(_element(14, _matrix((-1, -1), bytes(8)))),
    "short": _file(_element(14, _matrix((1, 7), bytes(8)))),
    "complex": _file(_element(14, _matrix((1, 1), bytes(8), flags=0x806))),
    "cell": _file(_element(14, _matrix((1, 1), bytes(8), flags=1))),
    "opaque": _file(_element(14, _matrix((1, 1), bytes(8), flags=17))),
    "unknown numbers": _file(_element(14, _matrix((1, 1), bytes(8), stored=99))),
    "bomb": _file(_element(15, zlib.compress(_element(14, _matrix((1, 1 << 25), bytes(1 << 28)))))),
    "not zlib": _file(_element(15, b"nonsense")),
    "cut": _mat(Pose_Para=POSE)[:-8],
    "size beyond": _file(struct.pack("<2I", 14, 1 << 31) + bytes(64)),
    "another name": _mat(Other=POSE),
    "version 4": bytes(200),
    "version 7.3": b"MATLAB 7.3".ljust(124) + struct.pack("<H2s", 0x200, b"IM") + bytes(512),
    "empty": b"",
}


@pytest.mark.parametrize("name", MATS)
def test_a_label_that_is_damaged_is_left_out_in_one_line(name: str, command: Command, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg")
    (tmp_path / "a.mat").write_bytes(MATS[name])
    code, said = command("downstream-hpe", "evaluate", "headturn", tmp_path, "--format", "aflw2000")
    assert code == 1 and "a.mat: no Pose_Para can be read from it; left out" in said


@pytest.mark.parametrize("compressed", [False, True])
def test_a_label_as_it_is_distributed_is_read_as_scipy_reads_it(compressed: bool, tmp_path: Path) -> None:
    arrays = {
        "pt2d": np.zeros((2, 21)),
        "roi": np.array([[1, 2, 3, 4]], np.int16),
        "Pose_Para": POSE,
        "pt3d_68": np.random.default_rng(0).normal(size=(3, 68)),
        "words": "text",
        "cell": {"a": 1},
    }
    (tmp_path / "a.mat").write_bytes(_mat(compressed, **arrays))
    found = read_arrays(tmp_path / "a.mat", ("Pose_Para", "pt3d_68", "roi"))
    assert set(found) == {"Pose_Para", "pt3d_68", "roi"}
    for key, value in found.items():
        np.testing.assert_array_equal(value, arrays[key])


IMAGES = np.zeros((2, 8, 8, 3), np.uint8)
GOOD = npz(image=IMAGES, pose=np.zeros((2, 3)))


def _encrypted() -> bytes:
    data = bytearray(GOOD)
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(mark)
        while at >= 0:
            data[at + place] |= 1
            at = data.find(mark, at + 1)
    return bytes(data)


ARCHIVES = {
    "bomb": npz_of({"image.npy": npy_header((1 << 28,)) + bytes(1 << 28), "pose.npy": b""}),
    "claims more": npz_of({"image.npy": npy_header((1 << 40,)) + b"x", "pose.npy": npy_header((1 << 40,))}),
    "negative": npz_of({"image.npy": npy_header((-1, 3)) + b"x", "pose.npy": npy_header((-1, 3))}),
    "short": npz_of({"image.npy": npy_header((10,)) + b"x", "pose.npy": npy_header((10,)) + b"x"}),
    "objects": npz_of({"image.npy": npy_header((1,), "|O") + b"x", "pose.npy": npy_header((1,), "|O")}),
    "no width": npz_of(
        {"image.npy": npy_header((1 << 40,), "|S0"), "pose.npy": npy_header((1 << 40,), "|S0")}
    ),
    "long header": npz_of(
        {"image.npy": b"\x93NUMPY\x02\x00\xff\xff\xff\x7f" + bytes(1 << 20), "pose.npy": b""}
    ),
    "deep header": npz_of({"image.npy": b"\x93NUMPY\x01\x00\xff\xff" + b"(" * 65535, "pose.npy": b""}),
    "bzip2": npz_of({"image.npy": b"x", "pose.npy": b"x"}, zipfile.ZIP_BZIP2),
    "lzma": npz_of({"image.npy": b"x", "pose.npy": b"x"}, zipfile.ZIP_LZMA),
    "many": npz_of({f"{k}.npy": b"" for k in range(5000)}),
    "encrypted": _encrypted(),
    "missing": npz(image=IMAGES),
    "cut": GOOD[:-30],
    "empty": b"",
}


@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", ARCHIVES)
def test_an_archive_that_is_damaged(name: str, command: Command, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    path = tmp_path / "b.npz"
    path.write_bytes(ARCHIVES[name])
    code, said = command("downstream-hpe", "evaluate", "headturn", path, "--format", "biwi-npz")
    assert code == 1 and "b.npz: expected an .npz with the arrays image and pose" in said
    with pytest.raises(DataError, match=r"b\.npz"):
        load_reference(path)


def test_an_archive_as_it_is_distributed_is_read(tmp_path: Path) -> None:
    (tmp_path / "b.npz").write_bytes(GOOD)
    assert read_npz(tmp_path / "b.npz", ("image",))["image"].shape == (2, 8, 8, 3)


def _row(**columns: pa.Array) -> pa.Table:
    base = {name: pa.array(["s"]) for name in ("subject", "expression", "split")}
    base |= {f"{angle}_deg": pa.array([0.0]) for angle in ("yaw", "pitch", "roll")}
    base |= {"rotation": pa.array([np.eye(3).ravel()]), "detected": pa.array([True])}
    base |= {"landmarks": pa.array([np.zeros(1404, np.float32)])}
    facts = {
        "headturn.schema_version": "1.0.0",
        "headturn.landmark_topology": "mediapipe-face-mesh-468",
        "headturn.conventions": '{"rotation": "Rx(-pitch) Ry(yaw) Rz(roll)"}',
    }
    return pa.table({**base, **columns}).replace_schema_metadata(facts)


def _metadata(key: str, value: bytes) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        table = _row()
        pq.write_table(table.replace_schema_metadata({**table.schema.metadata, key.encode(): value}), path)

    return write


def _table(**columns: pa.Array) -> Callable[[Path], None]:
    return lambda path: pq.write_table(_row(**columns), path)


def _repeated(path: Path) -> None:
    pq.write_table(pa.concat_tables([_row()] * 50_000), path, compression="zstd")


TABLES: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "conventions of brackets": _metadata("headturn.conventions", b"[" * DEEP),
    "conventions of another kind": _metadata("headturn.conventions", b'{"rotation": {"a": 1}}'),
    "versions of brackets": _metadata("headturn.schema_version", b"[" * DEEP),
    "bytes in the metadata": _metadata("headturn.landmark_topology", b"\xff\xfe"),
    "text as angles": _table(yaw_deg=pa.array(["x"])),
    "numbers as names": _table(subject=pa.array([1])),
    "text as landmarks": _table(landmarks=pa.array(["x"])),
    "numbers as detected": _table(detected=pa.array([1])),
    "a list too short": _table(landmarks=pa.array([[0.0]])),
    "nulls": _table(subject=pa.array([None], pa.string())),
    "50,000 rows in 100 kB": _repeated,
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 40),
    "empty": lambda path: path.touch(),
}


@pytest.mark.slow
@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", TABLES)
def test_a_table_that_no_build_writes(name: str, command: Command, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    folder = tmp_path / "d" / "data"
    folder.mkdir(parents=True)
    TABLES[name](folder / "t.parquet")
    code, said = command("downstream-hpe", "evaluate", "headturn", tmp_path / "d")
    assert code in (1, 2) and said.count("downstream-hpe: ") == 1, said
    assert len(said) < 1000


MANIFESTS: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "brackets": lambda path: path.write_bytes(b"[" * DEEP),
    "nested": lambda path: path.write_bytes(b'{"a":' * DEEP),
    "noise": lambda path: path.write_bytes(bytes(range(256))),
    "other kinds": lambda path: path.write_text('{"configuration": [1]}'),
    "empty": lambda path: path.touch(),
}


@pytest.mark.parametrize("name", MANIFESTS)
def test_a_manifest_that_no_build_writes(name: str, tmp_path: Path) -> None:
    MANIFESTS[name](tmp_path / "manifest.json")
    with pytest.raises(DataError, match=r"manifest\.json"):
        pose_zero(tmp_path)


PICTURES: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "bomb": lambda path: path.write_bytes(png(20_000, 20_000)),
    "JPEG 2000": lambda path: path.write_bytes(JP2),
    "PostScript": lambda path: path.write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n"),
    "text": lambda path: path.write_text("root:x:0:0"),
    "empty": lambda path: path.touch(),
}


@pytest.mark.timeout(30)
@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_that_is_none(name: str, tmp_path: Path) -> None:
    PICTURES[name](tmp_path / "a.png")
    with pytest.raises(DataError, match=r"a\.png: (not a readable picture|a picture of more than)"):
        read_bgr(tmp_path / "a.png")


VIDEOS: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "a list of files": lambda path: path.write_text("ffconcat version 1.0\nfile other.mp4\n"),
    "a list of addresses": lambda path: path.write_text("#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"),
    "text": lambda path: path.write_text("root:x:0:0\n" * 100),
    "JPEG 2000": lambda path: path.write_bytes(JP2),
    "empty": lambda path: path.touch(),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.timeout(60)
@pytest.mark.parametrize("name", VIDEOS)
def test_a_video_that_is_none(name: str, tmp_path: Path) -> None:
    pytest.importorskip("av")
    from downstream_hpe.prediction.video import VideoReader

    VIDEOS[name](tmp_path / "v.mp4")
    with pytest.raises(DataError, match=r"v\.mp4"):
        VideoReader(tmp_path / "v.mp4")


@pytest.mark.slow
def test_a_list_is_no_way_to_another_file(tmp_path: Path) -> None:
    """FFmpeg alone would take it for one."""
    av = pytest.importorskip("av")
    from downstream_hpe.prediction.video import VideoReader
    from downstream_hpe.prediction.video_file import VideoWriter

    with VideoWriter(tmp_path / "other.mp4") as writer:
        for n in range(5):
            writer.add(np.zeros((64, 64, 3), np.uint8), n / 10)
    assert len(list(VideoReader(tmp_path / "other.mp4"))) == 5
    (tmp_path / "v.mp4").write_text("ffconcat version 1.0\nfile other.mp4\n")
    with av.open(str(tmp_path / "v.mp4")) as list_of_files:
        assert list_of_files.format.name == "concat"
    with pytest.raises(DataError, match=r"v\.mp4"):
        VideoReader(tmp_path / "v.mp4")


@pytest.mark.timeout(30)
@pytest.mark.parametrize("kind", NO_FILES)
@pytest.mark.parametrize(
    "words",
    [
        ["predict", "FILE.png"],
        ["predict", "FILE.mp4"],
        ["predict", "a.png", "--model", "FILE.onnx"],
        ["evaluate", "FILE.onnx", "."],
        ["evaluate", "headturn", "FILE.npz", "--format", "biwi-npz"],
        ["evaluate", "headturn", "FILE.parquet"],
        ["evaluate", "headturn", ".", "--reference", "FILE.npz"],
        ["evaluate", "headturn", ".", "--reference", "FILE.csv"],
    ],
    ids=" ".join,
)
def test_what_is_no_file_is_not_waited_for(
    words: list[str], kind: str, command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("onnxruntime")
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (8, 8)).save("a.png")
    [name] = [word for word in words if word.startswith("FILE")]
    NO_FILES[kind](tmp_path / name)
    code, said = command("downstream-hpe", *words)
    assert code in (1, 2) and name in said


@pytest.mark.parametrize(
    "words",
    [
        *(
            ["fit", "d", "--out", "m", option, "1" + "0" * 26]
            for option in ("--epochs", "--seed", "--threads")
        ),
        ["fit", "d", "--out", "m", "--refinements", "1" + "0" * 26],
        ["fit", "d", "--out", "m", "--ranks", "9" * 5000 + ",3,3,3"],
        ["fit", "d", "--out", "m", "--ranks", "²,3,3,3"],
        *(["predict", f"webcam:{number}"] for number in ("²", "9" * 5000, "-1")),
        ["predict", "a.png", "--faces", "1" + "0" * 26],
    ],
    ids=lambda words: " ".join(words)[:50],
)
def test_a_number_that_nobody_means(words: list[str], command: Command) -> None:
    code, said = command("downstream-hpe", *words)
    assert code == 2 and "Traceback" not in said


@pytest.mark.parametrize("kind", NO_FILES)
def test_a_model_is_a_file(kind: str, tmp_path: Path) -> None:
    pytest.importorskip("safetensors")
    NO_FILES[kind](tmp_path / "m.safetensors")
    with pytest.raises(ModelError, match=r"m\.safetensors.*not a regular file"):
        read_safetensors(tmp_path / "m.safetensors", "x")


@pytest.mark.parametrize("facts", ["[" * DEEP, '{"a":' * DEEP, "[]", "7", '{"format": 1e999}'])
def test_facts_of_a_model_that_are_none(facts: str) -> None:
    with pytest.raises(HpeError):
        unpacked(Path("m"), "x", {"downstream-hpe": facts})


@pytest.mark.skipif(not CASES.exists(), reason="the cases are not beside this checkout")
def test_cases_that_failed(command: Command, tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    for case in CASES.glob("*.npz"):
        code, said = command("downstream-hpe", "evaluate", "headturn", case, "--format", "biwi-npz")
        assert code == 1 and case.name in said
    for case in CASES.glob("*.mat"):
        Image.new("RGB", (8, 8)).save(tmp_path / f"{case.stem}.jpg")
        shutil.copy(case, tmp_path)
    code, said = command("downstream-hpe", "evaluate", "headturn", tmp_path, "--format", "aflw2000")
    assert code == 1 and said.count("left out") == len(list(CASES.glob("*.mat")))
    code, said = command("downstream-hpe", "evaluate", CASES / "concat3.onnx", tmp_path)
    assert code == 1 and "concat3.onnx" in said and "numbers of 1024 faces" in said


@pytest.mark.slow
@pytest.mark.timeout(120)
def test_a_graph_at_the_limit_takes_less_than_a_gigabyte(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    model = tiny_model()
    for k in range(25):  # of 1.4 million numbers of a batch each
        model.graph.node.append(onnx.helper.make_node("Concat", ["landmarks"], [f"z{k}"], axis=0))
    model.graph.node.append(onnx.helper.make_node("Concat", [f"z{k}" for k in range(18)], ["z"], axis=1))
    path = tmp_path / "m.onnx"
    path.write_bytes(model.SerializeToString())
    assert fault(path.read_bytes()) is None
    folder = tmp_path / "d" / "data"
    folder.mkdir(parents=True)
    rows = pa.concat_tables([_row(subject=pa.array([f"t{k}"])) for k in range(2000)])
    face = np.random.default_rng(0).normal(size=(2000, 1404)).astype(np.float32)
    rows = rows.set_column(rows.schema.get_field_index("landmarks"), "landmarks", pa.array(list(face)))
    pq.write_table(rows, folder / "t.parquet")
    assert len(open_tables(tmp_path / "d", ["landmarks"]).files) == 1
    code, peak, said = peak_mb("downstream_hpe.cli", "evaluate", path, tmp_path / "d", "--all")
    assert code == 0, said
    assert peak < 1000, f"{peak:.0f} MB"
