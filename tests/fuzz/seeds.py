# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes the sound files from which the fuzzer starts: python tests/fuzz/seeds.py. All are made here."""

from __future__ import annotations

import base64
import io
import json
import struct
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

HERE = Path(__file__).resolve().parent
sys.path[:0] = [
    str(HERE),
    str(HERE.parent / "dataset"),
    str(HERE.parent / "downstream_hpe"),
    str(HERE.parent / "heads"),
    str(HERE.parents[1]),
]

RAW, EDITS = b"\0", b"\xff"

PREDICTIONS = (
    b"sample_id,yaw_deg,pitch_deg,roll_deg\n"
    b"s1/neutral/y+0_p+0_r+0,1.5,-2,0\ns1/neutral/y+0_p+0_r+0~light,,,\n"
)


def main() -> None:
    """Write every seed into its target's folder."""
    from targets import TARGETS

    for name, content in seeds():
        folder = TARGETS[name].corpus
        folder.mkdir(parents=True, exist_ok=True)
        number = sum(1 for _ in folder.glob("sound-*")) if (folder / "sound-0").exists() else 0
        (folder / f"sound-{number}").write_bytes(content)
    for one in TARGETS.values():
        assert (one.corpus / "sound-0").is_file(), one.name


def seeds() -> Iterator[tuple[str, bytes]]:
    """Each target with a sound input."""
    yield from dataset_seeds()
    yield from head_seeds()
    yield from hpe_seeds()


def dataset_seeds() -> Iterator[tuple[str, bytes]]:
    """Of a dataset of one head at one pose, and of what a build leaves beside it."""
    import pyarrow as pa
    import pyarrow.parquet as pq
    from small_dataset import HEADS, build_dataset

    from generator.heads.placement import Placement
    from generator.messages import HeadFacts, Placed, to_json
    from generator.plan.config import config_toml, load_config
    from generator.plan.poses import grid_plan
    from generator.sealed import sealed_line

    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "dataset"
        built = build_dataset(root, "none", HEADS[:1], grid_plan((0, 0, 1), (0, 0, 1), (0, 0, 1)))
        yield "manifest", RAW + (root / "manifest.json").read_bytes()
        yield "hpe_manifest", RAW + b'{"configuration": {"poses": {"frame": "canonical"}}}'
        matrix = b"[[900.0, 0, 500], [0, 900.0, 375], [0, 0, 1]]"
        yield "boxes", RAW + b"picture,x,y,w,h\na.png,20,30.5,99,100\n"
        yield "boxes", b'\x40[{"picture": "a.png", "x": 20, "y": 30.5, "w": 99, "h": 100}]'
        yield "camera", RAW + b'{"K": %b, "width": 1000, "height": 750}' % matrix
        [file] = root.glob("data/*/*.parquet")
        row = pq.read_table(file)
        for name in ("landmarks", "landmarks_exact"):  # of which zeros take no room
            kind = row.schema.field(name).type
            zeros = pa.array([[0.0] * kind.list_size], kind)
            row = row.set_column(row.schema.get_field_index(name), row.schema.field(name), zeros)
        packed = io.BytesIO()
        pq.write_table(row, packed, compression="zstd", write_statistics=False)
        yield "part", RAW + packed.getvalue()
        yield "hpe_table", RAW + packed.getvalue()
        for name in ("heads", "anchors"):
            small = io.BytesIO()
            table = pq.read_table(root / f"{name}.parquet")
            pq.write_table(table, small, compression="zstd", write_statistics=False)
            yield name, RAW + small.getvalue()
        yield "poses", (root / "poses.csv").read_bytes()
        yield "poses", b"yaw,pitch,roll\n0,0,0\n10.5,-3,2\n"
        yield "predictions", PREDICTIONS
        yield "predictions", PREDICTIONS.replace(b"sample_id", b"input").replace(b"_r+0,", b"_r+0.png,")
        receipt = {"part": asdict(built.parts[0]), "stamp": [1, 2, "0" * 64]}
        yield "receipts", RAW + sealed_line(receipt).encode() + b"\n"
    placement = Placement("cm", 10.0, "+Y", "+Z", (0.0, 1.0, 2.0), 100.0, 90.0)
    receipt = to_json(Placed(placement, (HeadFacts(10, 20, ("a note",)),)))
    yield "placed", RAW + sealed_line({"key": "0" * 64, "receipt": receipt}).encode() + b"\n"
    yield "messages", RAW + json.dumps(receipt).encode()
    array = {"dtype": "<f8", "shape": [1, 3], "data": base64.b64encode(bytes(24)).decode()}
    yield "messages", RAW + json.dumps({"is": "Rendered", "frames": array}).encode()
    yield "config", RAW + config_toml(load_config(None, {"poses": {"kind": "uniform", "count": 3}})).encode()
    yield "build_log", b'2026-01-01T00:00:00Z unit {"attempts": 1, "seconds": {"detect": 1.5}}\n'
    yield "passes", exr()


def exr() -> bytes:
    from generator.dataset.format.passes import write_passes

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.exr"
        write_passes({"depth.Z": np.zeros((4, 4), np.float32)}, path)
        return path.read_bytes()


def picture(kind: str, mode: str = "RGB") -> bytes:
    file = io.BytesIO()
    Image.new(mode, (8, 8)).save(file, kind)
    return file.getvalue()


def head_seeds() -> Iterator[tuple[str, bytes]]:
    """Of heads: a tetrahedron each."""
    from targets import _MTL, _OBJ

    card = {"license": "CC0-1.0", "redistributable": True, "units": "cm", "up": "+Y", "forward": "+Z"}
    card |= {"subject": "s1", "attribution": "A. Person", "expressions": {"neutral": {"file": "head.obj"}}}
    yield "head_json", RAW + json.dumps(card).encode()
    points = [{"landmark": k, "point": [k, k * k, 0.5]} for k in range(4)]
    worn = {"label": "headwear", "units": "cm", "points": points, "opacity": 0.5, "gloss": 0.1}
    yield "thing", RAW + json.dumps(worn).encode()
    yield "obj", _OBJ.encode()
    yield "obj", b"v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvn 0 0 1\nf -3//1 -2//1 -1//1\n"
    yield "mtl", _MTL.encode() + b"map_d -s 1 1 1 a.png\n"
    for kind, mode in (
        ("PNG", "RGBA"),
        ("JPEG", "RGB"),
        ("TIFF", "RGB"),
        ("BMP", "RGB"),
        ("TGA", "RGBA"),
        ("WEBP", "RGB"),
    ):
        yield "texture", RAW + picture(kind, mode)
    yield from gltf()
    square = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
    header = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    header += "property list uchar int vertex_indices\nend_header\n"
    yield "ply", f"ply\nformat ascii 1.0\n{header}{square}4 0 1 2 3\n".encode()
    binary = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4").tobytes()
    yield (
        "ply",
        f"ply\nformat binary_little_endian 1.0\n{header}".encode()
        + binary
        + struct.pack("<B4i", 4, 0, 1, 2, 3),
    )
    strip = header.replace("element face", "element tristrips").replace("uchar int", "int int")
    yield "ply", f"ply\nformat ascii 1.0\n{strip}{square}6 0 1 2 -1 3 2\n".encode()
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
    yield "stl", f"solid head\n{facet}endsolid head\n".encode()
    yield "stl", bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    from small_collada import SHOWN, TEXTURED, collada
    from small_usd import mesh, stage, usdz

    yield "collada", collada().encode()
    inner = f"<node><matrix>{'1 0 0 0 0 ' * 3}1</matrix>{SHOWN}</node>"
    nested = f'<node id="n"><rotate>1 0 0 90</rotate>{inner}</node>'
    yield "collada", collada(shader=TEXTURED, nodes=nested, asset='<unit meter="0.01"/>').encode()
    with tempfile.TemporaryDirectory() as folder:
        layer = stage(mesh()).encode()
        yield "package", usdz(Path(folder) / "a.usdz", {"a.usda": layer, "b/c.png": b"x"}).read_bytes()
    yield (
        "facescape",
        b"1_neutral.obj\n1_neutral.jpg\n2_smile.obj\n2_smile.obj.mtl\0newmtl a\nmap_Kd 1_neutral.jpg\n",
    )


def gltf() -> Iterator[tuple[str, bytes]]:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4").tobytes()
    corners = np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    uv = np.zeros((4, 2), "<f4").tobytes()
    image = picture("PNG")
    views, whole = [], b""
    for piece in (points, corners, uv, image):
        views.append({"buffer": 0, "byteOffset": len(whole), "byteLength": len(piece)})
        whole += piece + bytes(-len(piece) % 4)
    kinds = (("VEC3", 5126, 4), ("SCALAR", 5123, 6), ("VEC2", 5126, 4))
    scene: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [1, 1, 1], "rotation": [0, 0, 0, 1], "children": []}],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 2}, "indices": 1, "material": 0}]}
        ],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": place, "type": kind, "componentType": component, "count": count}
            for place, (kind, component, count) in enumerate(kinds)
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(whole)}],
    }
    text = json.dumps(scene, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(whole), b"BIN\0") + whole
    )
    yield "glb", struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
    scene["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(whole).decode()
    yield "gltf", RAW + json.dumps(scene, separators=(",", ":")).encode()


def hpe_seeds() -> Iterator[tuple[str, bytes]]:
    """Of what downstream_hpe reads."""
    from scipy.io import savemat

    label = {"Pose_Para": np.array([[0.1, 0.2, 0.3, 0, 0, 0, 1]]), "pt3d_68": np.zeros((3, 68))}
    for packed in (False, True):
        file = io.BytesIO()
        savemat(file, label, do_compression=packed)
        yield "mat", file.getvalue()
    face = np.random.default_rng(0).normal(size=(468, 3)).round(1)
    for name, arrays in (
        ("npz", {"image": np.zeros((1, 4, 4, 3), np.uint8), "pose": np.zeros((1, 3))}),
        ("reference", {"face": face.astype(np.float16)}),
    ):
        file = io.BytesIO()
        np.savez_compressed(file, **arrays)
        yield name, RAW + file.getvalue()
    yield "reference", RAW + b"0,0,0\n1,2,3\n"
    pose = b"1 0 0\n0 1 0\n0 0 1\n\n0 0 700\n"
    yield "biwi", pose
    yield (
        "biwi",
        pose + b"--\n500 0 32\n0 500 32\n0 0 1\n\n0 0 0 0\n\n1 0 0\n0 1 0\n0 0 1\n\n0 0 0\n\n64 64\n",
    )
    for way in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        file = io.BytesIO()
        with zipfile.ZipFile(file, "w", way) as archive:
            for name in ("face_detector.tflite", "face_landmarks_detector.tflite"):
                archive.writestr(zipfile.ZipInfo(name), name.encode() * 9, way)
        yield "task", file.getvalue()
    for kind in ("PNG", "JPEG", "TIFF", "WEBP", "BMP"):
        yield "picture", RAW + picture(kind)
    yield from model_seeds()


def model_seeds() -> Iterator[tuple[str, bytes]]:
    import torch
    from safetensors.numpy import save
    from targets import _trained

    from downstream_hpe.manifold import tensor_model
    from downstream_hpe.model_file import packed
    from downstream_hpe.networks import checkpoint
    from downstream_hpe.networks.pose_network import PoseNetwork
    from downstream_hpe.networks.weights import Weights

    model = onnx_model()
    yield "onnx_checks", RAW + model
    yield "onnx_model", RAW + model
    arrays = {"core": np.zeros((1, 3, 3, 3, 2)), "reference": np.zeros((468, 3))}
    for angle in ("yaw", "pitch", "roll"):
        arrays |= {
            f"{angle}.axis_deg": np.zeros(2),
            f"{angle}.factor": np.zeros((2, 3)),
            f"{angle}.params": np.zeros((3, 4)),
        }
    arrays = {name: np.asarray(array, np.float64)[:4] for name, array in arrays.items()}
    yield "tensor_model", RAW + save(arrays, metadata=packed(tensor_model.FORMAT, {"normalisation": "rms"}))
    network, average, optimizer = _trained()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.safetensors"
        small = PoseNetwork([1404, 1, 9], [3, 1])
        Weights(small, "rms", np.zeros((3, 2)), None, ("s1",), "source").save(file)
        yield "weights", RAW + file.read_bytes()
        network(torch.zeros(1, 4)).sum().backward()
        checkpoint.save(file, network, average, optimizer, "fuzz", 3)
        yield "checkpoint", RAW + file.read_bytes()


def onnx_model() -> bytes:
    """A graph of the form that is exported, of few numbers."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper
    from tiny_onnx import FACTS

    arrays = {"flat": np.array([-1, 1404]), "axes": np.array([1])}
    nodes = [helper.make_node("Reshape", ["landmarks", "flat"], ["x"])]
    nodes.append(helper.make_node("ReduceSum", ["x", "axes"], ["sum"], keepdims=1))
    outputs = [("ypr_deg", [3]), ("rotation", [3, 3])]
    for name, shape in outputs:
        arrays |= {
            f"w_{name}": np.ones((1, int(np.prod(shape))), np.float32),
            f"s_{name}": np.array([-1, *shape]),
        }
        nodes.append(helper.make_node("MatMul", ["sum", f"w_{name}"], [f"y_{name}"]))
        nodes.append(helper.make_node("Reshape", [f"y_{name}", f"s_{name}"], [name]))
    graph = helper.make_graph(
        nodes,
        "tiny",
        [helper.make_tensor_value_info("landmarks", TensorProto.FLOAT, ["N", 468, 3])],
        [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["N", *s]) for n, s in outputs],
        [numpy_helper.from_array(value, name) for name, value in arrays.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    onnx.helper.set_model_props(model, {"downstream-hpe": json.dumps(FACTS)})
    return model.SerializeToString()


if __name__ == "__main__":
    main()
