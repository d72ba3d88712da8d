# SPDX-License-Identifier: GPL-3.0-or-later
"""USD through Blender's importer: as it says, with the textures of its folder, and nothing else."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.errors import HeadError
from generator.execution.lanes.renderer import Renderer
from generator.heads.gltf_file import split_gltf
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))

from small_usd import TEXTURED, material, mesh, stage, usdz

FLAT = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0]])


def read(path: Path, renderer: Renderer) -> HeadMesh:
    (head,) = find_heads(path).heads
    scratch = path.parent / f"scratch{len(list(path.parent.iterdir()))}"
    scratch.mkdir()
    return read_mesh(head, scratch, import_with_blender=renderer.import_mesh)


def usda(folder: Path, text: str, renderer: Renderer) -> HeadMesh:
    (folder / "head.usda").write_text(text)
    return read(folder / "head.usda", renderer)


def skin(folder: Path) -> Path:
    Image.new("RGB", (8, 8), (200, 150, 130)).save(folder / "skin.png")
    return folder / "skin.png"


def same_triangle(found: np.ndarray, expected: np.ndarray) -> bool:
    """Whichever corner comes first."""
    return any(np.allclose(np.roll(found, k, axis=0), expected, atol=1e-6) for k in range(3))


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ('upAxis = "Y"\nmetersPerUnit = 1', FLAT),
        ('upAxis = "Y"\nmetersPerUnit = 0.001', FLAT / 1000),
        ('upAxis = "Y"', FLAT / 100),  # USD's own default is the centimetre
        ('upAxis = "Z"\nmetersPerUnit = 1', [[-1, 0, 1], [1, 0, 1], [1, 0, -1]]),
    ],
)
def test_unit_and_up_axis(header: str, expected: np.ndarray, renderer: Renderer, tmp_path: Path) -> None:
    found = usda(tmp_path, stage(mesh(), header), renderer)
    assert same_triangle(found.vertices[found.triangles[0]], expected)


@pytest.mark.parametrize("name", ["skin.png", "./skin.png", "C:\\art\\skin.png", "/art/skin.png"])
def test_a_texture_is_the_file_in_the_folder(name: str, renderer: Renderer, tmp_path: Path) -> None:
    skin(tmp_path)
    found = usda(tmp_path, stage(mesh() + material(TEXTURED, name)), renderer)
    (texture,) = found.materials
    assert texture.texture == tmp_path / "skin.png"
    assert found.uv is not None
    corner = found.vertices[found.triangles[0]]
    np.testing.assert_allclose(found.uv[0], (corner[:, :2] + 1) / 2, atol=1e-6)
    assert "no texture" not in str(found.problems)


def test_a_missing_texture_refuses(renderer: Renderer, tmp_path: Path) -> None:
    with pytest.raises(HeadError, match=r"head\.usda: the texture 'skin\.png' is missing"):
        usda(tmp_path, stage(mesh() + material(TEXTURED)), renderer)


def test_a_missing_map_that_is_not_drawn_does_not(renderer: Renderer, tmp_path: Path) -> None:
    found = usda(tmp_path, stage(mesh() + material()), renderer)
    assert found.materials[0].base_color == pytest.approx((0.7354, 0.3492, 0), abs=2e-3)


def test_colours_of_vertices_are_linear(renderer: Renderer, tmp_path: Path) -> None:
    colors = "color3f[] primvars:displayColor = [(0.5, 0.1, 0), (1, 1, 1), (0, 0, 0)]"
    found = usda(tmp_path, stage(mesh(f'{colors} (interpolation = "vertex")')), renderer)
    assert found.vertex_colors is not None
    at = np.argmin(np.linalg.norm(found.vertices - FLAT[0], axis=1))
    np.testing.assert_allclose(found.vertex_colors[at], [0.7354, 0.3492, 0], atol=5e-3)


def test_shells_that_one_looks_through_are_left_out(renderer: Renderer, tmp_path: Path) -> None:
    clear = material("float inputs:opacity = 0.05").replace('"m"', '"k"').replace("/m/", "/k/")
    eye = (
        mesh().replace('"mesh"', '"eye"').replace("/root/m>", "/root/k>").replace("(1, 1, 0)]", "(1, 2, 0)]")
    )
    found = usda(tmp_path, stage(mesh() + eye + material() + clear), renderer)
    assert len(found.triangles) == 1 and found.vertices.max() == pytest.approx(1)
    assert any("see-through" in problem for problem in found.problems)


def test_what_is_animated_is_where_it_begins(renderer: Renderer, tmp_path: Path) -> None:
    samples = "point3f[] points.timeSamples = {{ 5: [{}], 9: [(0, 0, 0), (0, 0, 1), (0, 1, 0)] }}"
    points = samples.format("(-1, -1, 0), (1, -1, 0), (1, 1, 0)")
    found = usda(tmp_path, stage(mesh(points=points)), renderer)
    assert same_triangle(found.vertices[found.triangles[0]], FLAT)


EXPORT = """
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.obj_import(filepath=sys.argv[1], forward_axis="Y", up_axis="Z")
bpy.ops.wm.usd_export(filepath=sys.argv[2])
"""


@pytest.mark.parametrize("kind", ["usd", "usda", "usdc", "usdz"])
def test_what_blender_writes_comes_back(kind: str, renderer: Renderer, tmp_path: Path) -> None:
    folder = tmp_path / "head"
    folder.mkdir()
    skin(tmp_path)
    (tmp_path / "h.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
    (tmp_path / "h.obj").write_text(
        "mtllib h.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl skin\nf 1/1 2/2 3/3\n"
    )
    command = [sys.executable, "-c", EXPORT, str(tmp_path / "h.obj"), str(folder / f"head.{kind}")]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    found = read(folder / f"head.{kind}", renderer)
    assert same_triangle(found.vertices[found.triangles[0]], np.array([[0, 0, 0], [1, 0, 0], [0, 0, -1]]))
    assert found.materials[0].texture is not None
    assert found.materials[0].texture.name == "skin.png"
    assert found.materials[0].texture.read_bytes() == skin(tmp_path).read_bytes()


def test_a_package_holds_its_textures(renderer: Renderer, tmp_path: Path) -> None:
    layer = stage(mesh() + material(TEXTURED, "textures/skin.png")).encode()
    path = usdz(tmp_path / "head.usdz", {"a.usda": layer, "textures/skin.png": skin(tmp_path).read_bytes()})
    found = read(path, renderer)
    assert found.materials[0].texture is not None
    assert found.materials[0].texture.parts[-2:] == ("textures", "skin.png")
    assert found.materials[0].texture.is_relative_to(tmp_path)


BAD = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 3]"
COMPOSED = "it is put together from parts elsewhere"
JOINTS = 'int[] primvars:skel:jointIndices = [0, 0, 7] (elementSize = 1\ninterpolation = "vertex")'
SKINNED = 'def Skeleton "s"\n{\nuniform token[] joints = ["a"]\n}\n' + mesh(JOINTS)
REFUSED = {
    "sublayers": (stage(mesh(), "subLayers = [@other.usda@]"), COMPOSED),
    "reference": (stage(mesh(meta="references = @/etc/other.usda@")), COMPOSED),
    "reference inside": (stage(mesh() + 'def "b" (references = </root/mesh>) {}'), COMPOSED),
    "payload": (stage(mesh(meta="payload = @other.usda@")), COMPOSED),
    "inherits": (stage(mesh() + 'def "b" (inherits = </root/mesh>) {}'), COMPOSED),
    "reference in a variant": (
        stage(
            'def "b" (variants = { string v = "a" }\nprepend variantSets = "v")\n{\n'
            'variantSet "v" = {\n"a" {\ndef "c" (references = @other.usda@) {}\n}\n}\n}\n'
        ),
        COMPOSED,
    ),
    "above": (stage(mesh() + material(TEXTURED, "../private.png")), "outside of the head's folder"),
    "absolute": (stage(mesh() + material(TEXTURED, "/etc/private.png")), "absolute path"),
    "link": (stage(mesh() + material(TEXTURED, "linked.png")), "is a link out of"),
    "web": (stage(mesh() + material(TEXTURED, "http://example.org/private.png")), "missing"),
    "expression": (stage(mesh() + material(TEXTURED, '`"private.png"`')), "missing"),
    "points nowhere": (stage(mesh(faces=BAD)), "point nowhere"),
    "negative": (stage(mesh(faces=BAD.replace("3]\n", "3]\n").replace("1, 3", "1, -3"))), "point nowhere"),
    "too few corners": (stage(mesh(faces=BAD.replace("[3]", "[4]"))), "point nowhere"),
    "joints nowhere": (stage(SKINNED), "point nowhere"),
    "instances of points": (stage('def PointInstancer "p" {}\n' + mesh()), "instances of points"),
    "20,000 prims": (stage(mesh() + "".join(f'def "p{k}" {{}}\n' for k in range(20_000))), "10,000 prims"),
    "broken": ("#usda 1.0\ndef Mesh {", "not a USD layer"),
    "broken crate": ("PXR-USDC" + "\0" * 90, "not a USD layer"),
    "nothing": (stage(""), "head.usda"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_usd_is_refused_with_its_reason(name: str, renderer: Renderer, tmp_path: Path) -> None:
    text, reason = REFUSED[name]
    folder = tmp_path / "head"
    folder.mkdir()
    skin(tmp_path).rename(tmp_path / "private.png")
    (folder / "linked.png").symlink_to(tmp_path / "private.png")
    (folder / "other.usda").write_text(stage(mesh()))
    with pytest.raises(HeadError) as error:
        usda(folder, text, renderer)
    assert reason in str(error.value), str(error.value)
    assert "\n" not in str(error.value)


def test_blender_opens_no_image(renderer: Renderer, tmp_path: Path) -> None:
    """Not even one that is there: it sees pictures of one pixel, and the host reads the real ones."""
    skin(tmp_path)
    text = stage(mesh() + material(TEXTURED, str(tmp_path / "skin.png")))
    (tmp_path / "layer.usda").write_text(text)
    renderer.import_mesh(tmp_path / "layer.usda", tmp_path)
    header, binary = split_gltf(tmp_path / "layer.glb")
    (image,) = header["images"]
    view = header["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    with Image.open(io.BytesIO(binary[start : start + view["byteLength"]])) as seen:
        assert seen.size == (1, 1)
    assert json.loads((tmp_path / "layer.json").read_text()) == {image["name"]: str(tmp_path / "skin.png")}
